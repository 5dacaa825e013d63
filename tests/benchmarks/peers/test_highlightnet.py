"""The yardstick is what it claims to be: equal to the official outputs."""

import cv2
import numpy as np
import pytest
import torch
from peers import highlightnet

from nat2024.registry import create_enhancer
from nat2024.zoo import read_checkpoint

pytestmark = pytest.mark.slow  # yardsticks of benchmarks, not the product


@pytest.mark.shared
@pytest.mark.parametrize("case", ["dt36_127x127", "dt76_101x77", "p11_256x256"])
def test_the_yardstick_gives_the_official_outputs(shared, case):
    kit = shared / "parity" / "enhancers"
    network = highlightnet.build()
    assert not network.training
    network.load_state_dict(read_checkpoint(kit / "checkpoints" / "highlightnet_epoch99.pth"))
    image = cv2.imread(str(kit / "inputs" / f"{case}.png"))[..., ::-1]
    batch = torch.from_numpy(image.transpose(2, 0, 1)[None].astype(np.float32) / np.float32(255))
    with torch.no_grad():
        actual = network(batch)[0].numpy()
    with np.load(kit / "outputs" / "highlightnet_epoch99" / f"{case}.npz") as stored:
        np.testing.assert_allclose(actual, stored["enhanced"], rtol=0, atol=1e-5)


def test_the_yardstick_has_the_keys_of_the_plugin_network():
    ours = create_enhancer("highlightnet", weights=False).model.state_dict()
    theirs = highlightnet.build().state_dict()
    assert {k: v.shape for k, v in theirs.items()} == {k: v.shape for k, v in ours.items()}
