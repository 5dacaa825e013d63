"""The yardstick is what it claims to be: equal to the official outputs, and to the plugin."""

import json
import zlib

import cv2
import numpy as np
import pytest
import torch
from peers import kindpp

from nat2024_enhancers.kindpp.convert import from_tensorflow
from nat2024_enhancers.kindpp.model import KindPlusPlusNet

pytestmark = pytest.mark.slow  # yardsticks of benchmarks, not the product


def test_the_yardstick_has_the_keys_of_the_plugin_network():
    ours = KindPlusPlusNet().state_dict()
    theirs = kindpp.build().state_dict()
    assert theirs.keys() == {key for key in ours if not key.startswith("I_enhance_Net")}
    assert all(theirs[key].shape == ours[key].shape for key in theirs)


@pytest.mark.shared
def test_the_yardstick_gives_the_official_outputs(shared):
    kit = shared / "parity" / "enhancers"
    arrays = {}
    for entry in json.loads((kit / "keys" / "kindpp.json").read_text()):
        arrays[entry["key"]] = make_variable(entry["key"], entry["shape"])
    with np.load(kit / "checkpoints" / "kindpp_decom_illu_tf_layout.npz") as stored:
        arrays.update(stored)
    network = kindpp.build()
    assert not network.training
    network.load_state_dict(from_tensorflow(arrays), strict=False)
    image = cv2.imread(str(kit / "inputs" / "dt76_101x77.png"))[..., ::-1]
    batch = torch.from_numpy(image.transpose(2, 0, 1)[None].astype(np.float32) / np.float32(255))
    low, high = batch.min(), batch.max()
    batch = (batch - low) / (high - low)  # before cutting, which could change the range
    with torch.no_grad():
        actual = network.enhance(batch[..., :100, :76].contiguous())[0].numpy()
    with np.load(kit / "outputs" / "kindpp" / "dt76_101x77.npz") as stored:
        np.testing.assert_allclose(actual, stored["fusion_default"], rtol=0, atol=1e-5)


def make_variable(name, shape):
    z = np.random.Generator(np.random.PCG64(zlib.crc32(name.encode()))).standard_normal(shape)
    if name.endswith("moving_mean"):
        z = 0.1 * z
    elif name.endswith("moving_variance"):
        z = 1 + 0.1 * np.abs(z)
    elif z.ndim >= 2:
        z = np.sqrt(2) * z / np.sqrt(np.prod(shape[:-1]))
    else:
        z = 1 + 0.1 * z if name.endswith("gamma") else 0.05 * z
    return z.astype(np.float32)
