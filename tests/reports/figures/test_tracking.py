import numpy as np
import pandas as pd
import pytest

from nat2024_reports.figures.looks import NamedRun, views_of
from nat2024_reports.figures.tracking import center_error_figure, center_errors_figure


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


def several(errors):
    runs = [NamedRun("a", "A"), NamedRun("a+x", "A", "X")]
    (view,) = views_of(runs)
    parts = [
        pd.DataFrame({"frame": np.arange(len(rows)), "run": run, "error": rows})
        for run, rows in errors.items()
    ]
    (axes,) = center_errors_figure(pd.concat(parts), view.looks, title="car_$1$").axes
    return axes


def test_errors_of_several_runs_share_the_line_at_20_px():
    nan = np.nan
    axes = several({"a": [1.0, 5.0, 300.0], "a+x": [1.0, nan, 2.0]})
    alone, alone_points, enhanced, enhanced_points, limit = axes.lines
    assert alone.get_ydata().tolist() == [1, 5, 300]
    assert (alone.get_linestyle(), enhanced.get_linestyle()) == ("--", "-")
    assert alone_points.get_xdata().tolist() == []
    assert enhanced_points.get_xdata().tolist() == [0, 2]
    assert set(limit.get_ydata()) == {20}
    assert axes.get_yscale() == "symlog"
    assert axes.get_ylim() == (0, pytest.approx(345))
    assert axes.figure.get_suptitle() == r"car_\$1\$"


def test_small_errors_leave_the_limit_in_view():
    axes = several({"a": [1.0, 2.0]})
    assert axes.get_ylim() == (0, 50)
    assert [tick for tick in axes.get_yticks() if tick <= 50] == [0, 10, 20, 50]


def test_the_label_of_errors_above_1000_px_stays_on_the_page():
    axes = several({"a": [1.0, 1500.0], "a+x": [1.0, 2.0]})
    axes.figure.draw_without_rendering()
    assert axes.yaxis.label.get_window_extent().x0 >= 0
