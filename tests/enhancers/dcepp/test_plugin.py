"""DCE++ as users create it: its size rules and its scale factor."""

from functools import partial

import numpy as np
import pytest
import torch
import torch.nn.functional as F

from nat2024.errors import ArrayContract, InvalidOption
from nat2024.images import image_to_batch
from nat2024.registry import create_enhancer
from nat2024.testing.enhancers import night_image


@pytest.fixture
def create(procedural_enhancer):
    return partial(procedural_enhancer, "dcepp")


@pytest.mark.parametrize(("size", "scale"), [((33, 50), 12), ((13, 300), 12), ((30, 31), 5)])
def test_sides_are_padded_by_reflection_and_cut_back(create, procedural_batch, size, scale):
    enhancer = create(scale_factor=scale)
    batch = procedural_batch("dcepp.pad", (1, 3, *size))
    height, width = size
    padded = F.pad(batch, (0, -width % scale, 0, -height % scale), mode="reflect")
    with torch.no_grad():
        expected = enhancer.model.enhance(padded)[..., :height, :width].clamp(0, 1)
    torch.testing.assert_close(enhancer.enhance_batch(batch), expected, rtol=0, atol=0)


def test_short_sides_are_padded_by_replication(create):
    enhancer = create()
    whole = enhancer.enhance(np.full((12, 12, 3), (40, 20, 10), np.uint8))
    pixel = np.full((1, 1, 3), (40, 20, 10), np.uint8)
    assert np.array_equal(enhancer.enhance(pixel), whole[:1, :1])


def test_crop_cuts_right_and_bottom_off(create):
    image = night_image(40, 59)
    cut = create(size_rule="crop")
    expected = create().enhance(np.ascontiguousarray(image[:36, :48]))
    assert np.array_equal(cut.enhance(image), expected)
    assert cut.maps(image_to_batch(image))["x_r"].shape == (1, 3, 36, 48)


@pytest.mark.parametrize("size", [(11, 40), (40, 11), (1, 1)])
def test_crop_refuses_what_it_would_cut_to_nothing(create, size):
    with pytest.raises(ArrayContract, match=r"at least 12 pixels a side, not \d+x\d+"):
        create(size_rule="crop").enhance(night_image(*size))


def test_scale_factor_1_needs_no_padding(create, procedural_batch):
    enhancer = create(scale_factor=1)
    batch = procedural_batch("dcepp.one", (1, 3, 17, 23))
    assert enhancer.maps(batch)["x_r"].shape == batch.shape
    assert not torch.equal(enhancer.enhance_batch(batch), create().enhance_batch(batch))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"scale_factor": 0}, "scale_factor must be at least 1"),
        ({"size_rule": "cut"}, "size_rule"),
        ({"scale": 2}, "no option 'scale'; closest: scale_factor"),
    ],
)
def test_wrong_options_are_refused(options, message):
    with pytest.raises(InvalidOption, match=message):
        create_enhancer("dcepp", weights=False, **options)
