"""The yardstick is what it claims to be: equal to the official outputs."""

import cv2
import numpy as np
import pytest
import torch
from peers import ruas

from nat2024.zoo import read_checkpoint

pytestmark = pytest.mark.slow  # yardsticks of benchmarks, not the product


@pytest.mark.shared
@pytest.mark.parametrize(
    ("variant", "case"), [("upe", "dt36_127x127"), ("lol", "dt76_101x77"), ("dark", "dt92_96x160")]
)
@pytest.mark.parametrize("denoise", [False, True])
def test_the_yardstick_gives_the_official_outputs(shared, variant, case, denoise):
    kit = shared / "parity" / "enhancers"
    network = ruas.build(denoise=denoise)
    assert not network.training
    network.load_state_dict(read_checkpoint(kit / "checkpoints" / f"ruas_{variant}.pt"))
    image = cv2.imread(str(kit / "inputs" / f"{case}.png"))[..., ::-1]
    batch = torch.from_numpy(image.transpose(2, 0, 1)[None].astype(np.float32) / np.float32(255))
    with torch.no_grad():
        actual = network(batch)[0].numpy()
    with np.load(kit / "outputs" / f"ruas_{variant}" / f"{case}.npz") as stored:
        expected = stored["denoised" if denoise else "u3"]
    np.testing.assert_allclose(actual, expected, rtol=0, atol=1e-5)


def test_the_yardstick_has_the_keys_of_the_plugin_network():
    from nat2024_enhancers.ruas.model import RUASNet

    ours, theirs = RUASNet().state_dict(), ruas.build().state_dict()
    assert {k: v.shape for k, v in theirs.items()} == {k: v.shape for k, v in ours.items()}
