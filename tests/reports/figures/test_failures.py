import numpy as np
import pandas as pd
import pytest

from nat2024_reports.figures.failures import (
    Correlation,
    LossBand,
    gain_against_light_figure,
    losses_figure,
)
from nat2024_reports.figures.looks import Look
from nat2024_reports.style import figure_bytes

LOOK = Look("T", "#0072B2", False, "", "o")


def test_a_correlation_is_told_with_its_interval_and_number() -> None:
    assert Correlation(0.416, 0.1, 0.62, 40).text() == (
        "rank correlation +0.42 [+0.10, +0.62]; 40 sequences"
    )
    nan = float("nan")
    assert Correlation(-0.5, nan, nan, 4).text(", ") == (
        "rank correlation -0.50, 4 sequences, too few for an interval"
    )
    assert Correlation(nan, nan, nan, 1).text() == "no rank correlation; 1 sequence"


def test_points_are_where_gain_and_light_say() -> None:
    means = pd.DataFrame({"sequence": ["a", "b"], "gain": [0.1, -0.2], "unevenness": [0.4, 1.2]})
    table = pd.concat([means.assign(tracker="T"), means.assign(tracker="U")])
    figure = gain_against_light_figure(
        table,
        means,
        {"unevenness": Correlation(-1, -1, 1, 2)},
        {"T": "#0072B2", "U": "#D55E00"},
        title="E",
        uneven_from=0.88,
    )
    (axes,) = figure.axes
    lines = [line for line in axes.lines if line.get_marker() == "D"]
    assert lines[0].get_xydata().tolist() == [[0.4, 0.1], [1.2, -0.2]]  # type: ignore[union-attr]
    assert "uneven" in [text.get_text() for text in axes.texts]
    assert figure_bytes(figure, ".png")
    alone = gain_against_light_figure(
        table[table.tracker == "T"], means, {"unevenness": Correlation(1, 0, 1, 2)}, {"T": "k"}
    )
    assert not [line for line in alone.axes[0].lines if line.get_marker() == "D"]


@pytest.mark.parametrize("with_light", [True, False])
def test_bands_are_empty_where_lost_and_grey_where_nothing_is_known(with_light: bool) -> None:
    overlap = np.array([1.0, 1.0, 0.0, 0.0, np.nan, 0.5])
    band = LossBand("t", np.arange(6), overlap, overlap == 0, 2)
    light = pd.DataFrame(
        {
            "frame": [0, 3],
            "luminance": [0.1, 0.2],
            "target_luminance": [0.1, np.nan],
            "unevenness": [0.5, 0.6],
            "target_unevenness": [0.2, 0.3],
        }
    )
    figure = losses_figure([band], {"t": LOOK}, light if with_light else None, title="s")
    assert len(figure.axes) == (3 if with_light else 1)
    colors = [tuple(one.get_facecolor()[0][:3]) for one in figure.axes[-1].collections]
    assert colors[0] == pytest.approx((0, 0x72 / 255, 0xB2 / 255))
    assert colors[1] == (1, 1, 1)
    assert colors[2] == pytest.approx((0.85, 0.85, 0.85))
    crosses = [line for line in figure.axes[-1].lines if line.get_marker() == "x"]
    assert crosses[0].get_xdata()[0] == 2  # type: ignore[index]
    assert figure_bytes(figure, ".svg")
