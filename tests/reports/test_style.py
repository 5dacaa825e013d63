from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest

from nat2024_reports.style import figure_bytes, figure_style, new_figure, save_figure


def figure():
    with figure_style():
        made = new_figure(3.5, 2)
        axes = made.add_subplot()
        axes.plot([0, 1], [0, 1], marker="o", label="ä line")
        axes.bar([0.5], [0.5], hatch="////")
        axes.imshow(np.eye(3))
        axes.legend()
    return made


@pytest.mark.parametrize("ending", [".pdf", ".svg", ".png"])
def test_the_same_figure_gives_the_same_bytes(ending: str) -> None:
    made = figure()
    first = figure_bytes(made, ending)
    assert first == figure_bytes(made, ending)
    assert first == figure_bytes(figure(), ending)


def test_the_users_settings_change_nothing() -> None:
    plain = {ending: figure_bytes(figure(), ending) for ending in (".svg", ".png")}
    own = {"font.size": 20, "svg.hashsalt": None, "savefig.bbox": "tight", "axes.grid": True}
    with mpl.rc_context(own):
        assert {ending: figure_bytes(figure(), ending) for ending in plain} == plain


def test_fonts_are_in_the_file_and_dates_are_not() -> None:
    pdf, svg = (figure_bytes(figure(), ending) for ending in (".pdf", ".svg"))
    assert b"/FontFile2" in pdf
    assert b"/Type3" not in pdf
    assert b"CreationDate" not in pdf
    assert b"<text" not in svg  # letters are outlines
    assert b"<dc:date>" not in svg


def test_figures_are_saved_under_the_endings_asked_for(tmp_path: Path) -> None:
    paths = save_figure(figure(), tmp_path / "new", "name", (".svg", ".jpeg"))
    assert [path.name for path in paths] == ["name.svg", "name.jpeg"]
    assert all(path.stat().st_size for path in paths)
