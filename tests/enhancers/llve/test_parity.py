"""Equality with the official code: names and shapes, outputs, maps."""

import json

import cv2
import numpy as np
import pytest
import torch

from nat2024.registry import create_enhancer
from nat2024_enhancers.llve.model import LLVENet

pytestmark = pytest.mark.shared
GAINS = {"gain1": 1.0, "gain_sqrt2": float(np.float32(2**0.5))}
CASES = [
    ("gain1", "dt76_101x77_bgr"),
    ("gain1", "dt92_96x160_bgr"),
    ("gain_sqrt2", "dt76_101x77_bgr"),
    ("gain_sqrt2", "dt92_96x160_bgr"),
]


@pytest.fixture(scope="module")
def kit(shared):
    return shared / "parity" / "enhancers"


@pytest.fixture(scope="module")
def enhancers(procedural_state, tmp_path_factory):
    """One enhancer for each gain, loaded from files as users have them, wrapped and prefixed."""
    folder = tmp_path_factory.mktemp("weights")
    created = {}
    for gain, factor in GAINS.items():
        path = folder / f"{gain}.pth"
        state = procedural_state(LLVENet(), factor)
        torch.save({"state_dict": {f"module.{key}": value for key, value in state.items()}}, path)
        created[gain] = create_enhancer("llve", weights=path, clamp=False)
    return created


def read_batch(kit, name):
    image = cv2.imread(str(kit / "inputs" / f"{name}.png"))
    return torch.from_numpy(image.transpose(2, 0, 1)[None].astype(np.float32) / np.float32(255))


def test_every_case_of_the_kit_is_tried(kit):
    stored = {
        (path.parent.name.removeprefix("llve_procedural_"), path.stem)
        for path in (kit / "outputs").glob("llve_procedural_*/*.npz")
    }
    assert stored == set(CASES)


def test_names_and_shapes_are_the_official_ones(kit):
    keys = json.loads((kit / "keys" / "llve.json").read_text())
    official = {entry["key"]: (tuple(entry["shape"]), entry["dtype"]) for entry in keys}
    state = LLVENet().state_dict()
    ours = {k: (tuple(v.shape), str(v.dtype).removeprefix("torch.")) for k, v in state.items()}
    assert ours == official


@pytest.mark.parametrize(("gain", "case"), CASES)
def test_outputs_equal_the_official_ones(kit, enhancers, gain, case):
    batch = read_batch(kit, case.removesuffix("_bgr"))
    actual = enhancers[gain].enhance_batch(batch)[0].numpy()
    with np.load(kit / "outputs" / f"llve_procedural_{gain}" / f"{case}.npz") as stored:
        np.testing.assert_allclose(actual, stored["out"], rtol=0, atol=1e-5)


def test_images_in_either_order_are_fed_as_bgr_and_cut_as_the_official_test_does(kit, enhancers):
    path = enhancers["gain_sqrt2"].weights.path
    truncating = create_enhancer("llve", weights=path, quantise="truncate")
    image = cv2.imread(str(kit / "inputs" / "dt76_101x77.png"))
    folder = kit / "outputs" / "llve_procedural_gain_sqrt2"
    with np.load(folder / "dt76_101x77_bgr.npz") as stored:
        exact = stored["out"].transpose(1, 2, 0).clip(0, 1) * 255.0
    for answer in (
        truncating.enhance(image, bgr=True),
        truncating.enhance(np.ascontiguousarray(image[..., ::-1]))[..., ::-1],
    ):
        lost = exact - answer
        assert lost.min() > -0.01
        assert lost.max() < 1.01
