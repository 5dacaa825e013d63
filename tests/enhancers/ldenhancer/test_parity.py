"""Equality with the official code: its checkpoints, its outputs, its training forward pass."""

import json

import cv2
import numpy as np
import pytest
import torch
import torch.nn.functional as F

from nat2024.registry import create_enhancer
from nat2024_enhancers.ldenhancer.model import LDEnhancerNet

pytestmark = pytest.mark.shared
FILES = {"epoch66": "ldenhancer_model.pth", "epoch99": "ldenhancer_epoch99.pth"}
PUBLISHED = {"epoch66": "model.pth", "epoch99": "Epoch99.pth"}
CASES = [
    ("epoch66", "p11_256x256_rgb"),
    ("epoch66", "dt12_287x287_rgb"),
    ("epoch66", "dt36_127x127_rgb"),
    ("epoch66", "dt36_127x127_bgr"),
    ("epoch66", "dt76_101x77_rgb"),
    ("epoch66", "dt92_96x160_rgb"),
    ("epoch66", "dt68_360x640_rgb_sampled"),
    ("epoch99", "dt36_127x127_rgb"),
]


@pytest.fixture(scope="module")
def official(kit):
    return {
        epoch: create_enhancer("ldenhancer", weights=kit / "checkpoints" / name, clamp=False)
        for epoch, name in FILES.items()
    }


def read_rgb(path):
    image = cv2.imread(str(path))
    assert image is not None, path
    return np.ascontiguousarray(image[..., ::-1])


def to_batch(*images):
    stacked = np.stack(images).transpose(0, 3, 1, 2)
    return torch.from_numpy(stacked.astype(np.float32) / np.float32(255))


def test_every_case_of_the_kit_is_tried(kit):
    stored = {
        (path.parent.name.removeprefix("ldenhancer_"), path.stem)
        for path in (kit / "outputs").glob("ldenhancer_*/*.npz")
    }
    assert stored == set(CASES)


@pytest.mark.parametrize("epoch", FILES)
def test_official_state_dict_loads_unchanged(official, epoch, check_official_state):
    assert official[epoch].weights.known_as == PUBLISHED[epoch]
    check_official_state(official[epoch])


@pytest.mark.parametrize(("epoch", "case"), CASES)
def test_outputs_equal_the_official_ones(kit, official, epoch, case):
    name, order = case.removesuffix("_sampled").rsplit("_", 1)
    image = read_rgb(kit / "inputs" / f"{name}.png")
    batch = to_batch(image if order == "rgb" else image[..., ::-1])
    maps = official[epoch].maps(batch)
    maps["enhanced"] = official[epoch].enhance_batch(batch)
    with np.load(kit / "outputs" / f"ldenhancer_{epoch}" / f"{case}.npz") as stored:
        expected = dict(stored)
    means = expected.pop("channel_mean", None), expected.pop("channel_std", None)
    for key, value in expected.items():
        plain = key.removesuffix("_sub8")
        step = 8 if key != plain else 1
        actual = maps[plain][0].numpy()[:, ::step, ::step]
        np.testing.assert_allclose(
            actual, value, rtol=0, atol=1e-4 if plain == "O2" else 1e-5, err_msg=key
        )
    if means[0] is not None:
        enhanced = maps["enhanced"][0].numpy().astype(np.float64)
        np.testing.assert_allclose(enhanced.mean(axis=(1, 2)), means[0], rtol=0, atol=1e-5)
        np.testing.assert_allclose(enhanced.std(axis=(1, 2)), means[1], rtol=0, atol=1e-5)


def test_images_are_the_rounded_official_ones(kit):
    enhancer = create_enhancer("ldenhancer", weights=kit / "checkpoints" / "ldenhancer_model.pth")
    image = read_rgb(kit / "inputs" / "dt76_101x77.png")
    with np.load(kit / "outputs" / "ldenhancer_epoch66" / "dt76_101x77_rgb.npz") as stored:
        expected = stored["enhanced"].clip(0, 1).transpose(1, 2, 0) * 255
    for answer in (
        enhancer.enhance(image),
        enhancer.enhance(np.ascontiguousarray(image[..., ::-1]), bgr=True)[..., ::-1],
    ):
        assert np.abs(answer - expected).max() <= 0.5 + 0.01


@pytest.mark.parametrize("weights", ["epoch66", "procedural"])
def test_training_forward_equals_the_official_one(kit, official, procedural_state, weights):
    net = LDEnhancerNet(dropout=0.0).train()
    fresh = weights == "procedural"
    net.load_state_dict(procedural_state(net) if fresh else official["epoch66"].model.state_dict())
    images, lights = (
        to_batch(*(read_rgb(kit / "train_batch" / f"{name}_{i}.png") for i in range(4)))
        for name in ("NAT", "NAT_G")
    )
    with torch.no_grad():
        enhanced, light, amount = net(images)
    pooled = F.avg_pool2d(enhanced.mean(dim=1, keepdim=True), 16)
    count, _, height, width = amount.shape
    rows = amount.diff(dim=-2).square().sum() / ((height - 1) * width)
    columns = amount.diff(dim=-1).square().sum() / (height * (width - 1))
    terms = {
        "light": F.smooth_l1_loss(light, lights).item(),
        "ie": 10 * F.smooth_l1_loss(1.5 * pooled, torch.full_like(pooled, 0.6)).item(),
        "L_TV": (2000 * (rows + columns) / count).item(),
    }
    losses = json.loads((kit / "losses" / "losses.json").read_text())
    expected = losses[f"lde_step_{weights}"]["terms_weighted"]
    for name, value in terms.items():
        assert value == pytest.approx(expected[name], rel=1e-5), name
