"""How figures look, and how they are written: the same bytes for the same data.

Colours are those of Okabe and Ito without yellow, which is lost on white, with the wine and indigo
of Paul Tol; people with any colour vision can tell them apart. Fonts are embedded as TrueType, as
publishers ask for; in SVG letters are outlines.
"""

import contextlib
import io
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BLUE, ORANGE, GREEN, VERMILION = "#0072B2", "#E69F00", "#009E73", "#D55E00"
PINK, SKY, WINE, INDIGO, BLACK = "#CC79A7", "#56B4E9", "#882255", "#332288", "#000000"
GREY = "#666666"

COLOURS = (BLUE, VERMILION, GREEN, PINK, ORANGE, SKY, WINE, INDIGO)
"""Colours of lines in the order in which they are given out; none is hard to see on white."""

COLUMN, PAGE = 3.5, 7.16
"""Widths in inches of one column and of the text of an IEEE page."""

_SETTINGS: Any = {
    "figure.dpi": 100,
    "savefig.dpi": 200,
    "font.family": "DejaVu Sans",
    "font.size": 8,
    "axes.titlesize": 8,
    "axes.labelsize": 8,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "legend.fontsize": 7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "axes.grid": False,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.6,
    "legend.frameon": False,
    "pdf.fonttype": 42,
    "ps.fonttype": 42,
    "svg.fonttype": "path",
    "svg.hashsalt": "nat-bench",
    "hatch.linewidth": 0.6,
    "image.cmap": "viridis",
    "figure.constrained_layout.use": True,
}


ENDINGS = (".png", ".jpg", ".jpeg", ".pdf", ".svg")
"""Kinds of files that `figure_bytes` writes."""

_UNDATED: dict[str, dict[str, Any]] = {
    "pdf": {"metadata": {"CreationDate": None, "Creator": None, "Producer": None}},
    "svg": {"metadata": {"Date": None, "Creator": None}},
    "png": {"metadata": {"Software": None}},
    "jpg": {"pil_kwargs": {"quality": 92}},
}


@contextlib.contextmanager
def figure_style() -> Iterator[None]:
    """Within it, figures are made in this style, whatever the user's own settings are."""
    import matplotlib as mpl

    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(_SETTINGS)
        yield


def new_figure(width: float, height: float) -> "Figure":
    """An empty figure of `width` x `height` inches that no window and no pyplot knows of."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def figure_bytes(figure: "Figure", ending: str) -> bytes:
    """A figure as the content of a file, without date and program: equal data gives equal bytes.

    Args:
        figure: any; its layout is settled here, once for all files that are made of it.
        ending: one of `ENDINGS`.
    """
    from matplotlib.layout_engine import PlaceHolderLayoutEngine

    kind = {".jpeg": "jpg"}.get(ending.lower(), ending.lower().lstrip("."))
    buffer = io.BytesIO()
    engine = figure.get_layout_engine()
    with figure_style():
        if not (engine is None or isinstance(engine, PlaceHolderLayoutEngine)):
            figure.draw_without_rendering()
            figure.set_layout_engine("none")
        figure.savefig(buffer, format=kind, **_UNDATED[kind])
    return buffer.getvalue()


def save_figure(
    figure: "Figure", folder: Path, name: str, endings: Sequence[str] = (".pdf", ".png")
) -> tuple[Path, ...]:
    """Write `NAME.ENDING` for each of `endings`.

    Returns:
        The paths, in the order of `endings`.
    """
    folder.mkdir(parents=True, exist_ok=True)
    paths = tuple(folder / f"{name}{ending}" for ending in endings)
    for path, ending in zip(paths, endings, strict=True):
        path.write_bytes(figure_bytes(figure, ending))
    return paths


def plain_text(name: str) -> str:
    """A name in which matplotlib sees no formula, with `?` for what its font does not have."""
    from matplotlib.font_manager import findfont, get_font

    known = get_font(findfont("DejaVu Sans")).get_charmap()
    shown = "".join(letter if ord(letter) in known else "?" for letter in name)
    return shown.replace("$", r"\$")


def shortened(name: str, length: int = 36) -> str:
    """A name of at most `length` letters, its middle left out where it is longer.

    >>> shortened("a_tracker_with_a_long_label", 15)
    'a_track…g_label'
    """
    if len(name) <= length:
        return name
    end = (length - 1) // 2
    return f"{name[: length - 1 - end]}…{name[-end:]}"
