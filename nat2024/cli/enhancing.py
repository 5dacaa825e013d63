"""Pictures of what `nat-bench enhance` did: their options, and computing, drawing, storing them."""

import contextlib
import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from nat2024.errors import FrameUnreadable, NatBenchError, UsageError

if TYPE_CHECKING:
    from nat2024.enhancing import Source
    from nat2024.enhancing.showing import Chosen, Inset
    from nat2024.interfaces import Enhancer
    from nat2024.types import Image

_Function = TypeVar("_Function", bound=Callable[..., Any])

SHOWN = 8
"""Images that pictures show, unless told otherwise."""

_THUMBNAIL = 400, 600  # pixels, at least what a column of a sheet is drawn with
_log = logging.getLogger("nat2024")


@dataclass(frozen=True, slots=True)
class Pictures:
    """Which pictures are wanted; see the options.

    Attributes:
        sheet: file of the contact sheet.
        strip: file of the comparison strip.
        strip_image: name of its image, None takes the first that is shown.
        insets: what it enlarges, empty chooses.
        maps: whether the maps of networks are drawn.
        show: how many images a sheet, and the maps, show at most; 0 for all.
    """

    sheet: Path | None = None
    strip: Path | None = None
    strip_image: str | None = None
    insets: tuple["Inset", ...] = ()
    maps: bool = False
    show: int = SHOWN


def picture_options(function: _Function) -> _Function:
    """Add the options that `read_picture_options` reads."""
    file = click.Path(path_type=Path, dir_okay=False)
    for option in reversed(
        (
            click.option("--sheet", type=file, help="Contact sheet, a .png, .jpg or .pdf file."),
            click.option("--strip", type=file, help="One image with enlarged insets, likewise."),
            click.option("--strip-image", metavar="NAME", help="Image of the strip; the first."),
            click.option(
                "--inset",
                "insets",
                multiple=True,
                metavar="X,Y,W,H",
                help="Part that the strip enlarges, in pixels; repeatable. Left out, the brightest "
                "lamp and a dark part with much detail.",
            ),
            click.option("--maps", is_flag=True, help="Draw the maps of networks to OUT/maps/."),
            click.option(
                "--show",
                type=click.IntRange(0),
                default=SHOWN,
                show_default=True,
                metavar="N",
                help="Images in the sheet and of the maps, evenly chosen; 0 takes all.",
            ),
        )
    ):
        function = option(function)
    return function


def read_picture_options(
    sheet: Path | None,
    strip: Path | None,
    strip_image: str | None,
    insets: Sequence[str],
    maps: bool,
    show: int,
) -> Pictures:
    """Check the options before anything is enhanced.

    Raises:
        UsageError: a file of another kind, no numbers, or options that need another.
    """
    from nat2024_reports.style import ENDINGS

    for option, path in (("--sheet", sheet), ("--strip", strip)):
        if path is not None and path.suffix.lower() not in ENDINGS:
            msg = f"{option} {path}: expected a file that ends in {', '.join(ENDINGS)}"
            raise UsageError(msg)
    if strip is None and (insets or strip_image is not None):
        msg = "--inset and --strip-image belong to --strip FILE"
        raise UsageError(msg)
    return Pictures(sheet, strip, strip_image, tuple(map(_read_inset, insets)), maps, show)


def _read_inset(text: str) -> "Inset":
    try:
        x, y, w, h = (int(part) for part in text.split(","))
    except ValueError:
        msg = f"--inset {text!r}: expected four whole numbers X,Y,W,H in pixels"
        raise UsageError(msg) from None
    return x, y, w, h


def numbers_file(picture: Path) -> Path:
    """Where the numbers of a sheet or strip lie: beside it."""
    return picture.with_suffix(".csv")


def check_files(wanted: Pictures, further: Sequence[Path | None]) -> None:
    """See that all files can be written, and none over another, before anything is enhanced.

    Args:
        wanted: pictures, each with its numbers beside it.
        further: files of other options.

    Raises:
        UsageError: two options name the same file.
        Unwritable: the file system refuses.
    """
    from nat2024.files import check_writable

    named: dict[Path, Path] = {}
    pictures = [path for path in (wanted.sheet, wanted.strip) if path is not None]
    for path in (*pictures, *map(numbers_file, pictures), *filter(None, further)):
        if (first := named.setdefault(path.resolve(), path)) is not path:
            msg = f"{first} would be written twice, a picture has its numbers beside it as .csv; "
            raise UsageError(msg + "choose other names")
        check_writable(path)


def choose_strip(wanted: Pictures, source: "Source") -> "Chosen | None":
    """The image of the strip, None where no strip is wanted or there is nothing to show.

    Raises:
        UsageError: the input has no such image, or an inset does not lie in it.
    """
    from nat2024.enhancing.showing import check_inset, choose_images, find_image

    if wanted.strip is None:
        return None
    if wanted.strip_image is not None:
        item, index = find_image(source, wanted.strip_image)
    else:
        chosen = choose_images(source, wanted.show)
        if not chosen:
            return None
        item, index = chosen[0]
    if wanted.insets:
        with contextlib.suppress(FrameUnreadable):  # the run will tell of it
            image = item.read(index).image
            for inset in wanted.insets:
                check_inset(inset, image)
    return item, index


def write_pictures(
    wanted: Pictures,
    source: "Source",
    strip: "Chosen | None",
    out: Path,
    titles: Sequence[str],
) -> list[Path]:
    """Draw the sheet and the strip from what lies in `out`, with their numbers beside.

    Args:
        wanted: which.
        source: the input.
        strip: from `choose_strip`.
        out: where the enhanced images lie.
        titles: of the enhancers.

    Returns:
        The files.
    """
    from nat2024.enhancing import count_images
    from nat2024.enhancing.showing import choose_images

    columns = [title for title in titles if title != "none"]  # the input stands there already
    written: list[Path] = []
    if wanted.sheet is not None and (chosen := choose_images(source, wanted.show)):
        if (every := count_images(source)) > len(chosen):
            _log.info("%s: %d of %d images, --show N takes more", wanted.sheet, len(chosen), every)
        written += _write_sheet(wanted.sheet, chosen, out, columns)
    if wanted.strip is not None and strip is not None:
        written += _write_strip(wanted.strip, strip, wanted.insets, out, columns)
    return written


def _read_all(
    chosen: "Chosen", out: Path, columns: Sequence[str]
) -> "list[tuple[str, Image | None]]":
    """The input and what each enhancer stored, by heading."""
    from nat2024.enhancing.showing import read_stored

    item, index = chosen
    try:
        before = item.read(index).image
    except NatBenchError:  # the run has told of it
        return [("input", None), *((column, None) for column in columns)]
    return [("input", before), *((column, read_stored(out / column, chosen)) for column in columns)]


def _write_sheet(
    path: Path, chosen: "Sequence[Chosen]", out: Path, columns: Sequence[str]
) -> list[Path]:
    from nat2024.enhancing.showing import light_numbers, thumbnail
    from nat2024_reports.figures.enhancement import SheetRow, contact_sheet

    rows, numbers = [], []
    for one in chosen:
        item, index = one
        name = item.title(index)
        images: list[Any] = []
        for heading, image in _read_all(one, out, columns):
            if image is None:
                images.append(None)
                continue
            images.append(_rgb(thumbnail(image, *_THUMBNAIL)))
            numbers.append({"image": name, "column": heading, **light_numbers(image)})
        rows.append(SheetRow(name, images))
    return _write(path, contact_sheet(["input", *columns], rows), numbers)


def _write_strip(
    path: Path, chosen: "Chosen", insets: "Sequence[Inset]", out: Path, columns: Sequence[str]
) -> list[Path]:
    from nat2024.enhancing.showing import choose_insets, light_numbers
    from nat2024_reports.figures.enhancement import comparison_strip

    item, index = chosen
    there = [(h, image) for h, image in _read_all(chosen, out, columns) if image is not None]
    if not there or there[0][0] != "input":
        _log.error("no strip: %s cannot be read", item.title(index))
        return []
    before = there[0][1]
    shown = insets or choose_insets(before)
    numbers = [
        {
            "image": item.title(index),
            "column": heading,
            **dict(zip("xywh", (x, y, w, h), strict=True)),
            **light_numbers(image[y : y + h, x : x + w]),
        }
        for heading, image in there
        for x, y, w, h in shown
    ]
    headings = [heading for heading, _ in there]
    figure = comparison_strip(headings, [_rgb(image) for _, image in there], shown)
    return _write(path, figure, numbers)


def write_maps(
    wanted: Pictures, source: "Source", out: Path, enhancers: "dict[str, Enhancer]", feed: Any
) -> tuple[list[Path], int]:
    """Draw the maps of the images that are shown: `OUT/maps/ENHANCER/IMAGE/MAP.png`.

    An image that fails is named, and the others go on. An enhancer without maps is named too.

    Returns:
        The files, and how many images failed.
    """
    from nat2024.enhancing.feeding import compute_maps
    from nat2024.enhancing.running import MAPS_FOLDER
    from nat2024.enhancing.showing import choose_images

    written: list[Path] = []
    failed = 0
    for title, enhancer in enhancers.items():
        for item, index in choose_images(source, wanted.show):
            name = item.title(index)
            try:
                maps, order = compute_maps(enhancer, item.read(index).image, feed)
            except (Exception, SystemExit) as error:  # a plugin may fail in any way
                kind = "" if isinstance(error, NatBenchError) else f"{type(error).__name__}: "
                _log.error("%s, maps of %s: %s%s", title, name, kind, error)
                failed += 1
                continue
            if not maps:
                _log.info("%s has no maps", title)
                break
            written += _write_maps(out / MAPS_FOLDER / title / name, maps, order)
    return written, failed


def _write_maps(folder: Path, maps: dict[str, Any], order: str) -> list[Path]:
    from nat2024.files import write_atomic
    from nat2024_reports.figures.enhancement import channel_labels, maps_figure
    from nat2024_reports.style import figure_bytes

    written, numbers = [], []
    for name, values in maps.items():
        if values.shape[1:] != (1, 1):  # numbers of the whole image make no picture
            path = folder / f"{name}.png"
            write_atomic(path, figure_bytes(maps_figure(name, values, order), path.suffix))
            written.append(path)
        for label, channel in zip(channel_labels(len(values), order), values, strict=True):
            numbers.append(
                {
                    "map": name,
                    "channel": label,
                    "min": float(channel.min()),
                    "mean": float(channel.mean(dtype="float64")),
                    "max": float(channel.max()),
                    "deviation": float(channel.std(dtype="float64")),
                }
            )
    write_atomic(folder / "maps.csv", _csv(numbers))
    return [*written, folder / "maps.csv"]


def _write(path: Path, figure: Any, numbers: list[dict[str, Any]]) -> list[Path]:
    from nat2024.files import write_atomic
    from nat2024_reports.style import figure_bytes

    beside = numbers_file(path)
    write_atomic(path, figure_bytes(figure, path.suffix))
    write_atomic(beside, _csv(numbers))
    return [path, beside]


def _csv(rows: list[dict[str, Any]]) -> str:
    import csv
    import io

    text = io.StringIO()
    writer = csv.DictWriter(text, list(rows[0]) if rows else [], lineterminator="\n")
    writer.writeheader()
    for row in rows:
        numbers = {k: f"{v:.6g}" if isinstance(v, float) else v for k, v in row.items()}
        writer.writerow(numbers)
    return text.getvalue()


def _rgb(image: "Image") -> "Image":
    import numpy as np

    return np.ascontiguousarray(image[..., ::-1])
