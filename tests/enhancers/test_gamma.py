import numpy as np
import pytest
import torch

from nat2024.errors import InvalidOption
from nat2024.registry import create_enhancer


def test_values_are_raised_to_the_power():
    image = np.arange(256, dtype=np.uint8).reshape(16, 16, 1).repeat(3, axis=2)
    expected = np.round(255 * np.sqrt(image / 255.0)).astype(np.uint8)
    assert np.array_equal(create_enhancer("gamma").enhance(image), expected)
    assert np.array_equal(create_enhancer("gamma", gamma=1.0).enhance(image), image)


def test_batches_are_not_rounded():
    batch = torch.tensor([0.0, 0.1, 0.25, 1.0]).reshape(1, 1, 2, 2).expand(1, 3, 2, 2)
    answer = create_enhancer("gamma", gamma=2).enhance_batch(batch)
    torch.testing.assert_close(answer, batch**2, rtol=0, atol=1e-7)


def test_values_outside_the_range_are_limited_first():
    batch = torch.tensor([-0.5, 2.0, 0.0]).reshape(1, 3, 1, 1)
    answer = create_enhancer("gamma").enhance_batch(batch)
    assert answer.flatten().tolist() == [0.0, 1.0, 0.0]


@pytest.mark.parametrize("gamma", [0, -1.0, float("nan"), float("inf")])
def test_powers_that_make_no_sense_are_refused(gamma):
    with pytest.raises(InvalidOption, match="must be a finite number above 0"):
        create_enhancer("gamma", gamma=gamma)
