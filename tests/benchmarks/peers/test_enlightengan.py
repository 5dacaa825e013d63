"""The yardstick is what it claims to be: equal to the official outputs."""

import importlib.util
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from peers import enlightengan

pytestmark = pytest.mark.slow  # yardsticks of benchmarks, not the product

CONFTEST = Path(__file__).parents[2] / "enhancers" / "conftest.py"


@pytest.fixture(scope="module")
def procedural_state():
    spec = importlib.util.spec_from_file_location("enhancer_conftest", CONFTEST)
    helpers = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(helpers)
    return helpers.make_procedural_state


@pytest.mark.shared
@pytest.mark.parametrize(
    ("gain", "folder"), [(1.0, "gain1"), (float(np.float32(2**0.5)), "gain_sqrt2")]
)
def test_the_yardstick_gives_the_official_outputs(shared, procedural_state, gain, folder):
    case = "dt76_101x77"
    kit = shared / "parity" / "enhancers"
    network = enlightengan.build()
    assert not network.training
    network.load_state_dict(procedural_state(network, gain))
    image = cv2.imread(str(kit / "inputs" / f"{case}.png"))[..., ::-1]
    batch = torch.from_numpy(image.transpose(2, 0, 1)[None].astype(np.float32) / np.float32(255))
    with torch.no_grad():
        actual = network(batch)[0].numpy()
    with np.load(kit / "outputs" / f"enlightengan_procedural_{folder}" / f"{case}.npz") as stored:
        expected = (stored["output"] + 1) / 2
    np.testing.assert_allclose(actual, expected, rtol=0, atol=1e-5)


def test_the_yardstick_has_the_keys_of_the_plugin_network():
    from nat2024_enhancers.enlightengan.model import EnlightenGANNet

    ours, theirs = EnlightenGANNet().state_dict(), enlightengan.build().state_dict()
    assert {k: v.shape for k, v in theirs.items()} == {k: v.shape for k, v in ours.items()}
