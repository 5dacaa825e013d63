from typing import Any

import pandas as pd
import pytest
from matplotlib.colors import to_rgba

from nat2024_reports.figures.bars import gains_figure, overall_figure, overall_table
from nat2024_reports.figures.looks import NamedRun, views_of

NAN = float("nan")
RUNS = [
    NamedRun("a", "A"),
    NamedRun("a+x", "A", "X"),
    NamedRun("b", "B"),
    NamedRun("b+x", "B", "X"),
]


def summary() -> Any:
    scores = {"precision_20": [0.4, 0.5, 0.3, 0.2], "success_auc": [0.372, 0.434, 0.3, 0.2]}
    undefined = {"normalized_precision_20": NAN, "average_overlap": NAN}
    return pd.DataFrame(
        {"run": [r.run for r in RUNS], "tracker": list("aabb"), **scores, **undefined}
    )


def gains() -> Any:
    rows = [
        ("a+x", "success_auc", 16.667, True),
        ("a+x", "precision_20", 25.0, True),
        ("b+x", "success_auc", -33.333, False),
    ]
    return pd.DataFrame(rows, columns=["run", "metric", "gain", "certain"])


def test_bars_have_values_and_gains() -> None:
    (view,) = views_of(RUNS)
    table = overall_table(summary(), gains())
    precision, success = overall_figure(table, view.looks).axes
    assert [bar.get_width() for bar in success.patches] == [0.372, 0.434, 0.3, 0.2]
    assert [text.get_text() for text in success.texts] == [
        "0.372",
        "0.434  +16.7 %",
        "0.300",
        "0.200  \N{MINUS SIGN}33.3 %",
    ]
    assert [text.get_text() for text in precision.texts][3] == "0.200"
    labels = [text.get_text() for text in precision.get_yticklabels()]
    assert labels == ["A", "A + X", "B", "B + X"]
    assert [text.get_color() == "black" for text in success.texts] == [True, True, True, False]


def test_trackers_alone_are_hollow() -> None:
    (view,) = views_of(RUNS)
    success = overall_figure(overall_table(summary(), gains()), view.looks).axes[1]
    alone, enhanced = success.patches[:2]
    assert alone.get_facecolor() == to_rgba("white")
    assert enhanced.get_facecolor() == alone.get_edgecolor() == to_rgba(view.looks["a"].color)


def test_bars_of_one_tracker_lie_together() -> None:
    (view,) = views_of(RUNS)
    success = overall_figure(overall_table(summary(), gains()), view.looks).axes[1]
    tops = [bar.get_y() for bar in success.patches]
    assert tops[1] - tops[0] == pytest.approx(1)
    assert tops[2] - tops[1] > 1.3


def differences(**changes: Any) -> Any:
    row = {
        "label": "A + X",
        "metric": "success_auc",
        "difference": 0.06,
        "difference_low": 0.01,
        "difference_high": 0.1,
        "gain": 16.667,
        "certain": True,
    }
    return pd.DataFrame([row, {**row, "label": "B $x$", **changes}])


def test_uncertain_gains_are_hatched_and_said() -> None:
    figure = gains_figure(differences(certain=False, difference_low=-0.02), colors={"A + X": "red"})
    sure, unsure = figure.axes[0].patches
    assert sure.get_facecolor() == to_rgba("red")
    assert not sure.get_hatch()
    assert unsure.get_hatch()
    assert unsure.get_facecolor()[3] < 0.5
    assert "includes 0" in figure.get_supxlabel()
    assert gains_figure(differences()).get_supxlabel() == ""
    assert [t.get_text() for t in figure.axes[0].get_yticklabels()] == ["A + X", r"B \$x\$"]


def test_intervals_are_drawn_where_they_are_known() -> None:
    axes = gains_figure(differences(difference_low=NAN, difference_high=NAN)).axes[0]
    ((segment,),) = [bars.get_segments() for bars in axes.collections]
    assert segment[:, 0].tolist() == pytest.approx([0.01, 0.1])


def test_gains_without_a_base_have_no_percentage_and_nan_no_bar() -> None:
    axes = gains_figure(differences(gain=NAN)).axes[0]
    assert [text.get_text() for text in axes.texts] == ["+16.7 %"]
    axes = gains_figure(differences(difference=NAN, gain=NAN)).axes[0]
    assert len(axes.patches) == 1


def test_each_metric_has_a_panel_in_order() -> None:
    both = pd.concat([differences(), differences().assign(metric="precision_20")])
    titles = [axes.get_title() for axes in gains_figure(both).axes]
    assert titles == ["Precision (20 px)", "Success (AUC)"]
