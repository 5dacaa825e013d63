from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from nat2024_reports import statistics_markdown
from nat2024_reports.figures.dataset import (
    FirstFrame,
    co_occurrence_figure,
    contact_sheets,
    length_figure,
    light_figure,
    motion_figure,
    place_figure,
)
from nat2024_reports.style import figure_style, save_figure


def lengths(count: int) -> Any:
    return pd.Series(np.arange(count) * 10 + 50, index=[f"s{n}$" for n in range(count)])


@pytest.fixture
def boxes() -> Any:
    rng = np.random.default_rng(0)
    step = rng.exponential(3, 200) * (rng.random(200) > 0.2)
    size = rng.uniform(8, 60, 200)
    return pd.DataFrame({"size": size, "step": step, "relative_step": step / size})


@pytest.fixture
def light() -> Any:
    rng = np.random.default_rng(0)
    names = np.repeat(["a", "b"], 10)
    columns = {"mean": rng.random(20), "spread": rng.random(20), "target_spread": rng.random(20)}
    return pd.DataFrame({"sequence": names, **columns})


def frame(number: int) -> FirstFrame:
    image = np.full((18, 32, 3), 40, np.uint8)
    return FirstFrame(f"n{number}", image, (4.0, 5.0, 6.0, 7.0) if number else None)


def test_few_sequences_are_named_and_many_are_counted() -> None:
    (few,) = length_figure(lengths(40)).axes
    assert next(text.get_text() for text in few.get_yticklabels()) == r"s0\$"
    assert [bar.get_width() for bar in few.patches][-1] == 440
    (many,) = length_figure(lengths(41)).axes
    assert sum(bar.get_height() for bar in many.patches) == pytest.approx(41)


def test_letters_that_the_font_lacks_do_not_warn(tmp_path: Path) -> None:
    figure = length_figure(pd.Series([3, 2], index=["nächtlich", "夜间car"]))
    save_figure(figure, tmp_path, "lengths")
    names = [text.get_text() for text in figure.axes[0].get_yticklabels()]
    assert names == ["??car", "nächtlich"]


def test_motion(boxes: Any) -> None:
    size, step, ratio = motion_figure(boxes, small_area=400, fast_step=20).axes
    assert [line.get_xdata()[0] for line in size.lines] == [20]
    assert [line.get_xdata()[0] for line in step.lines] == [20]
    assert not ratio.lines
    zeros = 100 * (boxes.step == 0).mean()
    assert f"{zeros:.1f} % are 0" in [text.get_text() for text in step.texts]
    assert sum(bar.get_height() for bar in step.patches) == pytest.approx(100 - zeros)
    assert sum(bar.get_height() for bar in size.patches) == pytest.approx(100)
    figure = motion_figure(boxes, small_area=400, fast_step=1, relative=True)
    assert [len(axes.lines) for axes in figure.axes] == [1, 0, 1]


def test_boxes_without_motion() -> None:
    nothing = pd.DataFrame({"size": [5.0], "step": [np.nan], "relative_step": [np.nan]})
    _, step, _ = motion_figure(nothing, small_area=400, fast_step=20).axes
    assert next(text.get_text() for text in step.texts) == "none"


def test_places_and_light(light: Any) -> None:
    axes = place_figure(np.full((18, 32), 1 / 576)).axes[0]
    assert axes.images[0].get_array().max() == pytest.approx(100 / 576)
    mean, spread, both = light_figure(light, uneven_light=0.9).axes
    assert sum(bar.get_height() for bar in mean.patches) == pytest.approx(100)
    assert len(both.collections[0].get_offsets()) == 2
    assert spread.get_legend() is not None


def test_co_occurrence_writes_every_number() -> None:
    counts = pd.DataFrame([[3, 1], [1, 2]], index=["FM", "LR"], columns=["FM", "LR"])
    (axes,) = co_occurrence_figure(counts).axes
    assert [text.get_text() for text in axes.texts] == ["3", "1", "1", "2"]


def test_contact_sheets() -> None:
    sheets = contact_sheets([frame(n) for n in range(41)])
    assert len(sheets) == 2
    first, last = (sheet.axes for sheet in sheets)
    assert len(first) == 40
    assert len(last) == 1
    assert not first[0].patches
    (box,) = first[1].patches
    assert box.get_edgecolor()[:3] == (1, 0, 0)
    assert (box.get_x(), box.get_y(), box.get_width(), box.get_height()) == (2.5, 3.5, 8, 9)
    assert len(contact_sheets([frame(n) for n in range(6)])[0].axes) == 6


def test_equal_data_gives_equal_files_with_embedded_fonts(tmp_path: Path) -> None:
    one = save_figure(length_figure(lengths(3)), tmp_path / "a", "lengths")
    two = save_figure(length_figure(lengths(3)), tmp_path / "b", "lengths")
    assert [path.read_bytes() for path in one] == [path.read_bytes() for path in two]
    assert [path.name for path in one] == ["lengths.pdf", "lengths.png"]
    pdf = one[0].read_bytes()
    assert b"/FontFile2" in pdf
    assert b"/Type3" not in pdf
    assert b"CreationDate" not in pdf


def test_style_leaves_the_users_settings_alone() -> None:
    import matplotlib as mpl

    with mpl.rc_context({"font.size": 20}):
        with figure_style():
            assert mpl.rcParams["font.size"] == 8
        assert mpl.rcParams["font.size"] == 20


def test_markdown() -> None:
    spread = dict.fromkeys(("mean", "min", "p5", "p25", "p50", "p75", "p95", "max"), 1.5)
    summary = {
        "sequences": 2,
        "frames": 12345,
        "valid_boxes": 9,
        "absent_frames": 0,
        "frame_sizes": {"64x48": 2},
        "step": spread,
    }
    sequences = pd.DataFrame(
        {"sequence": ["a|b", "c"], "frames": [5, 6], "mean_grey": [np.nan] * 2, "published": ""}
    )
    attributes = pd.DataFrame(
        [("FM", "published", 1), ("FM", "computed", 2)],
        columns=["attribute", "provenance", "sequences"],
    )
    page = statistics_markdown("mine", summary, sequences, attributes, {"FM": "fast motion"})
    assert "| sequences of 64x48 | 2 |" in page
    assert "| step of the centre (pixels) | 1.5 | 1.5" in page
    assert "| FM | published | 1 |  |" in page
    assert "| FM | computed | 2 | fast motion |" in page
    assert "| a\\|b | 5 |\n| c | 6 |" in page
    assert "mean grey" not in page
