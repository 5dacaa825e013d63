import numpy as np
import pytest
import torch

from nat2024.errors import ArrayContract, InvalidOption
from nat2024.registry import create_enhancer
from nat2024.testing.enhancers import night_image


def test_it_gives_an_equal_copy():
    enhancer = create_enhancer("none")
    image = night_image(5, 7)
    answer = enhancer.enhance(image, bgr=True)
    assert np.array_equal(answer, image)
    assert not np.shares_memory(answer, image)
    assert answer.flags.c_contiguous
    batch = torch.rand(2, 3, 4, 5)
    copied = enhancer.enhance_batch(batch)
    assert torch.equal(copied, batch)
    assert copied.data_ptr() != batch.data_ptr()


def test_a_reversed_view_is_answered_contiguously():
    image = night_image(5, 7)[:, ::-1, ::-1]
    answer = create_enhancer("none").enhance(image)
    assert np.array_equal(answer, image)
    assert answer.flags.c_contiguous


def test_it_refuses_what_is_no_image_and_has_no_weights():
    enhancer = create_enhancer("none")
    with pytest.raises(ArrayContract):
        enhancer.enhance(np.zeros((4, 4), np.uint8))
    with pytest.raises(InvalidOption, match="takes no weights"):
        create_enhancer("none", weights="model.pth")
