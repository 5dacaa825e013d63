"""Radar, light levels, speed."""

from typing import Any

import numpy as np
import pandas as pd
import pytest

from nat2024_reports.figures.light_levels import DAY, light_levels_figure
from nat2024_reports.figures.looks import NamedRun, looks_of, views_of
from nat2024_reports.figures.radar import radar_figure
from nat2024_reports.figures.speed import speed_figure

RUNS = [NamedRun("a", "A"), NamedRun("a+x", "A", "X")]
(VIEW,) = views_of(RUNS)


def by_label(values: dict[str, tuple[float, float]]) -> Any:
    rows = [
        (label, run, value)
        for label, pair in values.items()
        for run, value in zip(("a", "a+x"), pair, strict=True)
    ]
    return pd.DataFrame(rows, columns=["label", "run", "value"])


def test_radar_lines_are_closed_and_start_in_the_middle() -> None:
    table = by_label(
        {"traffic sign (3)": (0.2, 0.3), "UL* (2)": (0.4, 0.5), "$FM$ (9)": (0.1, np.nan)}
    )
    figure = radar_figure(table, VIEW.looks, title="* computed attribute")
    (axes,) = figure.axes
    alone, enhanced = axes.lines
    assert alone.get_ydata().tolist() == [0.2, 0.4, 0.1, 0.2]
    np.testing.assert_array_equal(enhanced.get_ydata(), [0.3, 0.5, np.nan, 0.3])
    assert alone.get_xdata()[:-1] == pytest.approx([0, 2 * np.pi / 3, 4 * np.pi / 3])
    assert axes.get_ylim() == (0, pytest.approx(0.5))
    names = [text.get_text() for text in axes.get_xticklabels()]
    assert names == ["traffic\nsign\n(3)", "UL*\n(2)", "\\$FM\\$\n(9)"]
    assert figure.get_suptitle() == "* computed attribute"
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["A", "A + X"]


def levels() -> Any:
    rows = [(0.03, "a", 0.2), (0.12, "a", 0.4), (DAY, "a", 0.6), (0.12, "a+x", 0.5)]
    return pd.DataFrame(rows, columns=["level", "run", "value"])


def test_light_levels_are_spaced_by_stops_and_day_stands_apart() -> None:
    (axes,) = light_levels_figure(levels(), VIEW.looks).axes
    dark, day = axes.lines[:2]
    assert dark.get_xdata()[1] - dark.get_xdata()[0] == pytest.approx(2)
    assert dark.get_ydata().tolist() == [0.2, 0.4]
    assert day.get_ydata().tolist() == [0.6]
    assert day.get_xdata()[0] > dark.get_xdata()[1]
    assert [text.get_text() for text in axes.get_xticklabels()] == ["0.03", "0.12", "day"]
    assert dark.get_linestyle() == "--"
    assert axes.lines[2].get_linestyle() == "-"


def test_speed_has_a_point_a_run_and_a_line_from_each_tracker_alone() -> None:
    table = pd.DataFrame(
        {"run": ["a", "a+x"], "frames_per_second": [100.0, 20.0], "value": [0.3, 0.4]}
    )
    looks = looks_of(RUNS, RUNS, by_tracker=True)
    (axes,) = speed_figure(table, {run.run: run for run in RUNS}, looks).axes
    link, alone, enhanced = axes.lines[:3]
    assert link.get_xdata().tolist() == [100, 20]
    assert (alone.get_marker(), enhanced.get_marker()) == (looks["a"].shape, looks["a+x"].shape)
    assert alone.get_marker() != enhanced.get_marker()
    assert alone.get_markerfacecolor() == "white"
    texts = [text.get_text() for text in axes.get_legend().get_texts()]
    assert texts == ["A", "no enhancer", "X"]
    assert axes.get_xscale() == "log"
    assert axes.texts[0].get_text() == "30 frames/s"


def test_speed_of_one_run() -> None:
    table = pd.DataFrame({"run": ["a+x"], "frames_per_second": [2.0], "value": [0.4]})
    looks = looks_of(RUNS[1:], RUNS, by_tracker=True)
    (axes,) = speed_figure(table, {"a+x": RUNS[1]}, looks).axes
    assert len(axes.lines) == 1
    assert not axes.texts


def test_names_around_a_radar_stay_on_the_page() -> None:
    table = by_label({f"a_very_long_category_{n} (100)": (0.2, 0.3) for n in range(16)})
    figure = radar_figure(table, VIEW.looks, title="* computed attribute")
    figure.draw_without_rendering()
    width, height = figure.get_size_inches() * figure.dpi
    (axes,) = figure.axes
    legend = axes.get_legend().get_window_extent()
    assert legend.y0 >= 0
    for text in axes.get_xticklabels():
        extent = text.get_window_extent()
        assert 0 <= extent.x0 < extent.x1 <= width
        assert legend.y1 <= extent.y0 < extent.y1 <= height
