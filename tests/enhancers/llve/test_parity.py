"""Equality with the official test of LLVE: the order of channels, and cut numbers."""

import cv2
import numpy as np
import pytest
import torch

from nat2024.registry import create_enhancer
from nat2024_enhancers.llve.model import LLVENet

pytestmark = pytest.mark.shared


def test_images_in_either_order_are_fed_as_bgr_and_cut_as_the_official_test_does(
    kit, procedural_state, tmp_path
):
    path = tmp_path / "procedural.pth"
    torch.save(procedural_state(LLVENet(), float(np.float32(2**0.5))), path)
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
