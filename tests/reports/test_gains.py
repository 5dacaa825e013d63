"""Relative gains against the reference paper's tables."""

import math

import pytest

from nat2024_reports import relative_gain

# The paper's Table IV: success, its gain, precision, its gain; the tracker alone has .372 / .474.
TABLE_IV = {
    "RUAS": (0.381, 2.419, 0.490, 3.376),
    "KinD++": (0.386, 3.763, 0.485, 2.321),
    "LIME": (0.393, 5.645, 0.501, 5.696),
    "EnlightenGAN": (0.397, 6.720, 0.505, 6.540),
    "LLVE": (0.397, 6.720, 0.508, 7.173),
    "DCE++": (0.402, 8.065, 0.512, 8.017),
    "DarkLighter": (0.385, 3.495, 0.495, 4.430),
    "HighlightNet": (0.376, 1.075, 0.483, 1.899),
    "SCT": (0.421, 13.172, 0.547, 15.401),
    "LDEnhancer": (0.434, 16.667, 0.560, 18.143),
}


@pytest.mark.parametrize("name", TABLE_IV)
def test_table_iv_digit_by_digit(name: str) -> None:
    success, success_gain, precision, precision_gain = TABLE_IV[name]
    assert f"{relative_gain(success, 0.372):.3f}" == f"{success_gain:.3f}"
    assert f"{relative_gain(precision, 0.474):.3f}" == f"{precision_gain:.3f}"


def test_no_gain_over_nothing() -> None:
    assert math.isnan(relative_gain(0.5, 0.0))
    assert math.isnan(relative_gain(math.nan, 0.5))
    assert math.isnan(relative_gain(0.5, math.nan))
