"""Equality with the official code: names and shapes, outputs, maps."""

import json

import cv2
import numpy as np
import pytest
import torch

from nat2024.registry import create_enhancer
from nat2024_enhancers.sct.model import SCTNet

pytestmark = pytest.mark.shared
GAINS = {"gain1": 1.0, "gain_sqrt2": float(np.float32(2**0.5))}
CASES = [
    ("gain1", "dt12_287x287"),
    ("gain1", "dt36_127x127"),
    ("gain1", "dt76_101x77"),
    ("gain1", "p11_256x256"),
    ("gain_sqrt2", "dt76_101x77"),
]


@pytest.fixture(scope="module")
def kit(shared):
    return shared / "parity" / "enhancers"


@pytest.fixture(scope="module")
def enhancers(procedural_state, tmp_path_factory):
    """One enhancer for each gain, loaded from files as users have them."""
    folder = tmp_path_factory.mktemp("weights")
    created = {}
    for gain, factor in GAINS.items():
        path = folder / f"{gain}.pth"
        state = procedural_state(SCTNet(), factor)
        torch.save(state, path)
        created[gain] = create_enhancer("sct", weights=path, clamp=False)
    return created


def read_batch(kit, name):
    image = cv2.imread(str(kit / "inputs" / f"{name}.png"))[..., ::-1]
    return torch.from_numpy(image.transpose(2, 0, 1)[None].astype(np.float32) / np.float32(255))


def test_every_case_of_the_kit_is_tried(kit):
    stored = {
        (path.parent.name.removeprefix("sct_procedural_"), path.stem)
        for path in (kit / "outputs").glob("sct_procedural_*/*.npz")
    }
    assert stored == set(CASES)


def test_names_and_shapes_are_the_official_ones(kit):
    keys = json.loads((kit / "keys" / "sct.json").read_text())
    official = {entry["key"]: (tuple(entry["shape"]), entry["dtype"]) for entry in keys}
    state = SCTNet().state_dict()
    ours = {k: (tuple(v.shape), str(v.dtype).removeprefix("torch.")) for k, v in state.items()}
    assert ours == official


@pytest.mark.parametrize(("gain", "case"), CASES)
def test_outputs_equal_the_official_ones(kit, enhancers, gain, case):
    batch = read_batch(kit, case)
    found = {**enhancers[gain].maps(batch), "enhanced": enhancers[gain].enhance_batch(batch)}
    with np.load(kit / "outputs" / f"sct_procedural_{gain}" / f"{case}.npz") as stored:
        assert set(stored) <= set(found)
        for name, expected in stored.items():
            # with the larger gain tanh meets values so large that the plain layers differ by 1e-5
            tolerance = 1e-5 if gain == "gain1" else 5e-5
            actual = found[name][0].numpy()
            np.testing.assert_allclose(actual, expected, rtol=0, atol=tolerance, err_msg=name)
