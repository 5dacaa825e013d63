"""The yardstick is what it claims to be: equal to the official outputs."""

import cv2
import numpy as np
import pytest
import torch
from peers import ldenhancer

from nat2024.zoo import read_checkpoint

pytestmark = pytest.mark.shared


@pytest.mark.parametrize(
    ("epoch", "checkpoint", "case"),
    [
        ("epoch66", "ldenhancer_model.pth", "dt36_127x127_rgb"),
        ("epoch66", "ldenhancer_model.pth", "dt36_127x127_bgr"),
        ("epoch66", "ldenhancer_model.pth", "dt76_101x77_rgb"),
        ("epoch99", "ldenhancer_epoch99.pth", "dt36_127x127_rgb"),
    ],
)
def test_the_yardstick_gives_the_official_outputs(shared, epoch, checkpoint, case):
    kit = shared / "parity" / "enhancers"
    network = ldenhancer.build()
    assert not network.training
    network.load_state_dict(read_checkpoint(kit / "checkpoints" / checkpoint), strict=False)
    name, order = case.rsplit("_", 1)
    image = cv2.imread(str(kit / "inputs" / f"{name}.png"))
    image = image[..., ::-1] if order == "rgb" else image
    batch = torch.from_numpy(image.transpose(2, 0, 1)[None].astype(np.float32) / np.float32(255))
    with torch.no_grad():
        actual = network(batch)[0].numpy()
    with np.load(kit / "outputs" / f"ldenhancer_{epoch}" / f"{case}.npz") as stored:
        np.testing.assert_allclose(actual, stored["enhanced"], rtol=0, atol=1e-5)


def test_the_yardstick_has_the_keys_of_the_plugin_network():
    from nat2024_enhancers.ldenhancer.model import LDEnhancerNet

    ours, theirs = LDEnhancerNet().state_dict(), ldenhancer.build().state_dict()
    assert {k: v.shape for k, v in theirs.items()} == {k: v.shape for k, v in ours.items()}
