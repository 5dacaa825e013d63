from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd
import pytest

from nat2024_reports.figures.curves import curve_table, curves_figure, ranking_score
from nat2024_reports.figures.looks import NamedRun, views_of

NAN = float("nan")


def tables(scores: dict[str, tuple[float, float, float]]) -> tuple[Any, Any]:
    """Straight curves that end at the score of their metric."""
    ends = {"precision": 50, "normalized_precision": 0.5, "success": 1}
    parts = [
        pd.DataFrame(
            {
                "run": run,
                "metric": metric,
                "threshold": np.linspace(0, end, 21),
                "value": np.linspace(0, 1, 21) * score,
            }
        )
        for run, values in scores.items()
        for (metric, end), score in zip(ends.items(), values, strict=True)
    ]
    columns = ["precision_20", "normalized_precision_20", "success_auc"]
    summary = pd.DataFrame.from_dict(scores, orient="index", columns=columns)
    return pd.concat(parts), summary.rename_axis("run").reset_index()


def drawn(scores: dict[str, tuple[float, float, float]], **options: Any) -> tuple[Any, Any]:
    named = [NamedRun(run, run) for run in scores]
    (view,) = views_of(named)
    table = curve_table(*tables(scores))
    return table, curves_figure(table, view.looks, **options)


def legend(axes: Any) -> list[str]:
    return [text.get_text() for text in axes.get_legend().get_texts()]


def test_legends_are_ranked_by_their_own_metric() -> None:
    _, figure = drawn({"a": (0.5, 0.2, 0.1), "b": (0.4, 0.3, 0.434), "c": (0.6, 0.25, 0.434)})
    precision, normalized, success = figure.axes
    assert legend(precision) == ["[0.600] c", "[0.500] a", "[0.400] b"]
    assert legend(normalized) == ["[0.300] b", "[0.250] c", "[0.200] a"]
    assert legend(success) == ["[0.434] b", "[0.434] c", "[0.100] a"]  # equals in their order
    assert [axes.get_title() for axes in figure.axes] == [
        "Precision plot",
        "Normalized precision plot",
        "Success plot",
    ]


def test_the_table_is_what_is_drawn() -> None:
    table, figure = drawn({"a": (0.5, 0.2, 0.1), "b": (0.4, 0.3, 0.2)})
    for axes, metric in zip(
        figure.axes, ("precision", "normalized_precision", "success"), strict=True
    ):
        rows = table[table.metric == metric]
        lines = [line for line in axes.lines if len(line.get_xdata()) > 2]
        for line, (_, curve) in zip(lines, rows.groupby("run", sort=False), strict=True):
            assert line.get_ydata().tolist() == curve.value.tolist()
            assert line.get_xdata().tolist() == curve.threshold.tolist()


def test_metrics_and_runs_without_numbers_have_no_line() -> None:
    table, figure = drawn({"a": (0.5, NAN, 0.1), "b": (NAN, NAN, 0.2)})
    assert [axes.get_title() for axes in figure.axes] == ["Precision plot", "Success plot"]
    assert legend(figure.axes[0]) == ["[0.500] a"]
    assert legend(figure.axes[1]) == ["[0.200] b", "[0.100] a"]
    assert not table.value.isna().any()


def test_nothing_but_nan_is_an_empty_table() -> None:
    table = curve_table(*tables({"a": (NAN, NAN, NAN)}))
    assert table.empty
    assert list(table.columns) == ["metric", "run", "score_name", "score", "threshold", "value"]


def test_a_protocol_without_area_ranks_by_average_overlap() -> None:
    summary = pd.DataFrame({"success_auc": [NAN], "average_overlap": [0.5]})
    assert ranking_score(summary, "success") == "average_overlap"
    assert ranking_score(summary, "precision") == ""


@pytest.mark.parametrize("count", [1, 12, 30])
def test_legends_stay_on_the_page_and_off_the_lines(count: int) -> None:
    names = [f"a_tracker_of_a_long_name_{n}_and_a_label" for n in range(count)]
    _, figure = drawn({name: (0.5, 0.5, 0.5) for name in names}, title="$<b>$ one sequence")
    figure.draw_without_rendering()
    width, height = figure.get_size_inches() * figure.dpi
    boxes = [axes.get_legend().get_window_extent() for axes in figure.axes]
    for axes, box in zip(figure.axes, boxes, strict=True):
        assert box.y0 >= 0
        assert box.y1 <= axes.xaxis.label.get_window_extent().y0
    for one, other in pairwise(boxes):
        assert one.x1 <= other.x0
    assert boxes[-1].x1 <= width
    assert figure.get_suptitle() == r"\$<b>\$ one sequence"
    assert figure._suptitle.get_window_extent().y1 <= height
