import numpy as np
import pytest

from nat2024.errors import ArrayContract
from nat2024.measures import over_enhancement


def flat(level: int) -> np.ndarray:
    return np.full((8, 8, 3), level, np.uint8)


def test_the_share_of_the_way_to_white() -> None:
    assert over_enhancement(flat(204), flat(204)) == 0
    assert over_enhancement(flat(204), flat(255)) == pytest.approx(1)
    assert over_enhancement(flat(195), flat(225)) == pytest.approx(0.5)
    assert over_enhancement(flat(204), flat(100)) == 0  # darker is not over-enhanced


def test_only_what_was_bright_but_not_white_counts() -> None:
    before = np.concatenate([flat(20), flat(204), flat(255)])
    after = np.concatenate([flat(200), flat(204), flat(255)])
    assert over_enhancement(before, after) == 0
    assert np.isnan(over_enhancement(flat(20), flat(250)))
    assert np.isnan(over_enhancement(flat(255), flat(255)))
    with pytest.raises(ArrayContract):
        over_enhancement(flat(0), flat(0)[:4])
