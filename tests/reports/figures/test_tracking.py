import numpy as np

from nat2024_reports.figures.tracking import center_error_figure


def drawn(errors):
    errors = np.array(errors, dtype=np.float64)
    axes = center_error_figure(np.arange(5, 5 + len(errors)), errors, "kcf").axes[0]
    line, points = axes.lines[0], axes.lines[1]
    assert line.get_linestyle() == "-"
    assert points.get_marker() == "."
    return points.get_xdata().tolist(), points.get_ydata().tolist(), axes


def test_errors_of_single_key_frames_are_points():
    nan = np.nan
    x, y, _ = drawn([3, nan, nan, 7, 8, nan, 2])
    assert x == [5, 11]
    assert y == [3, 2]


def test_a_whole_curve_has_no_points():
    x, _, axes = drawn([1, 2, 90])
    assert x == []
    assert axes.get_ylim()[1] == 1.05 * 90


def test_without_any_error_the_limit_is_shown():
    x, _, axes = drawn([np.nan, np.nan])
    assert x == []
    assert axes.get_ylim() == (0, 40)
