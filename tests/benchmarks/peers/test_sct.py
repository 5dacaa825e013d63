"""The yardstick is what it claims to be: equal to the official outputs."""

import importlib.util
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from peers import sct

pytestmark = pytest.mark.slow  # yardsticks of benchmarks, not the product

CONFTEST = Path(__file__).parents[2] / "enhancers" / "conftest.py"


@pytest.fixture(scope="module")
def procedural_state():
    spec = importlib.util.spec_from_file_location("enhancer_conftest", CONFTEST)
    helpers = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(helpers)
    return helpers.make_procedural_state


@pytest.mark.shared
@pytest.mark.parametrize("case", ["dt36_127x127", "dt76_101x77"])
def test_the_yardstick_gives_the_official_outputs(shared, procedural_state, case):
    kit = shared / "parity" / "enhancers"
    network = sct.build()
    assert not network.training
    network.load_state_dict(procedural_state(network))
    image = cv2.imread(str(kit / "inputs" / f"{case}.png"))[..., ::-1]
    batch = torch.from_numpy(image.transpose(2, 0, 1)[None].astype(np.float32) / np.float32(255))
    with torch.no_grad():
        actual = network(batch)[0].numpy()
    with np.load(kit / "outputs" / "sct_procedural_gain1" / f"{case}.npz") as stored:
        expected = stored["enhanced"]
    np.testing.assert_allclose(actual, expected, rtol=0, atol=1e-5)


def test_the_yardstick_has_the_keys_of_the_plugin_network():
    from nat2024_enhancers.sct.model import SCTNet

    ours, theirs = SCTNet().state_dict(), sct.build().state_dict()
    assert {k: v.shape for k, v in theirs.items()} == {k: v.shape for k, v in ours.items()}
