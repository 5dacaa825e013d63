"""Options of `nat-bench enhance` that measure, and how what they find is printed."""

import csv
import functools
import io
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from nat2024.cli.output import print_table
from nat2024.errors import UsageError

if TYPE_CHECKING:
    from nat2024.enhancing.measuring import EnhancementMeasuring

_Function = TypeVar("_Function", bound=Callable[..., Any])

_COLUMNS = 6  # more enhancers than this do not fit beside each other into 100 characters


@dataclass(frozen=True)
class MeasuringOptions:
    """What was asked for.

    Attributes:
        measure: whether anything is to be measured.
        reference: folder of references.
        fit_curve: file for the fitted tone curve.
        csv_file: file for the rows of all images.
        quality: names of metrics of pyiqa.
    """

    measure: bool
    reference: Path | None
    fit_curve: Path | None
    csv_file: Path | None
    quality: tuple[str, ...]

    def start(self, titles: list[str], images: int, device: str) -> "EnhancementMeasuring | None":
        """What `enhance_images` takes as `observer`; None where nothing was asked for.

        Args:
            titles: `NAME[@LABEL]` of the enhancers.
            images: how many images each of them is given.
            device: where metrics run.

        Raises:
            UsageError: options that do not fit together.
            DatasetNotFound: there is no folder of references.
        """
        if not self.measure:
            return None
        if self.fit_curve is not None:
            _check_curve_file(self.fit_curve, titles)
        from nat2024.enhancing.measuring import (
            EnhancementMeasuring,
            load_quality_metrics,
            references_in,
        )

        reference = references_in(self.reference) if self.reference is not None else None
        metrics = load_quality_metrics(self.quality, device)
        return EnhancementMeasuring(images, reference, metrics)

    def finish(self, measuring: "EnhancementMeasuring | None") -> dict[str, Any]:
        """Write the files asked for, and give what is to be printed.

        Returns:
            `measures` (a row for each image and enhancer), `means` (a row for each enhancer) and
            `adaptivity` (likewise); an empty dictionary where nothing was asked for.

        Raises:
            UsageError: there is nothing to fit a curve to.
            Unwritable: a file cannot be written.
        """
        if measuring is None:
            return {}
        adaptivity = measuring.adaptivity
        if self.fit_curve is not None:
            from nat2024.zoo.curve_files import write_tone_curve

            if not adaptivity:
                msg = f"{self.fit_curve}: no curve to write, no image of 5x5 pixels was enhanced"
                raise UsageError(msg)
            (found,) = adaptivity.values()
            write_tone_curve(found.curve, self.fit_curve)
        if self.csv_file is not None:
            _write_csv(measuring.rows, self.csv_file)
        rows = [{"enhancer": title, **found.as_row()} for title, found in adaptivity.items()]
        return {"measures": measuring.rows, "means": measuring.means, "adaptivity": rows}


def measuring_options(function: _Function) -> _Function:
    """Add the options; the command gets them as one `MeasuringOptions` called `measuring`."""

    @click.option("--measure", is_flag=True, help="Measure what is done, and whether it adapts.")
    @click.option(
        "--reference",
        type=click.Path(path_type=Path),
        metavar="DIR",
        help="With --measure: images of the same names to compare with, for PSNR and SSIM.",
    )
    @click.option(
        "--measure-csv",
        "csv_file",
        type=click.Path(path_type=Path, dir_okay=False),
        metavar="FILE",
        help="With --measure: write the rows of all images.",
    )
    @click.option(
        "--quality-metric",
        "quality_metrics",
        multiple=True,
        metavar="NAME",
        help="With --measure: a metric of pyiqa (extra iqa), such as niqe; repeatable.",
    )
    @click.option(
        "--fit-curve",
        type=click.Path(path_type=Path, dir_okay=False),
        metavar="FILE.safetensors",
        help="Write the best tone curve of the one enhancer, as weights of tone_curve.",
    )
    @functools.wraps(function)
    def wrapped(
        *args: Any,
        measure: bool,
        reference: Path | None,
        csv_file: Path | None,
        quality_metrics: tuple[str, ...],
        fit_curve: Path | None,
        **kwargs: Any,
    ) -> Any:
        if not measure and (reference or csv_file or quality_metrics):
            msg = "--reference, --measure-csv and --quality-metric belong to --measure; add it"
            raise UsageError(msg)
        asked = MeasuringOptions(
            measure or fit_curve is not None, reference, fit_curve, csv_file, quality_metrics
        )
        return function(*args, measuring=asked, **kwargs)

    return wrapped  # type: ignore[return-value]


def print_measures(found: dict[str, Any]) -> None:
    """Print means over images and adaptivity, a column for each enhancer; nothing where empty."""
    means, adaptivity = found.get("means", []), found.get("adaptivity", [])
    verdicts = {row["enhancer"]: row["verdict"] for row in adaptivity}
    merged = {row["enhancer"]: dict(row) for row in means}
    for row in adaptivity:
        more = {f"adaptivity: {key}": value for key, value in row.items()}
        merged[row["enhancer"]].update(more)
    titles = list(merged)
    for first in range(0, len(titles), _COLUMNS):
        shown = titles[first : first + _COLUMNS]
        print_table(["Measure", *shown], _lines([merged[title] for title in shown]))
    for title, verdict in verdicts.items():
        click.echo(f"{title}: {verdict}")


_WORDS = ("enhancer", "adaptivity: enhancer", "adaptivity: verdict", "adaptivity: images")


def _lines(columns: list[dict[str, Any]]) -> Iterable[list[str]]:
    names = dict.fromkeys(name for column in columns for name in column if name not in _WORDS)
    for name in names:
        values = [column.get(name, float("nan")) for column in columns]
        if any(value == value for value in values):  # a measure that is NaN for all says nothing
            is_share = "explained" in name
            yield [name.replace("_", " "), *(_text(v, is_share=is_share) for v in values)]


def _text(value: Any, *, is_share: bool) -> str:
    if isinstance(value, int):
        return str(value)
    if value != value:
        return "-"
    near_one = is_share and value > 0.99  # where the verdicts part
    return f"{value:.6f}" if near_one else f"{value:.4g}"


def _check_curve_file(path: Path, titles: list[str]) -> None:
    if len(titles) != 1:
        msg = f"--fit-curve fits the curve of one enhancer, but {len(titles)} are named"
        raise UsageError(msg)
    if path.suffix != ".safetensors":
        msg = f"--fit-curve {path}: the file must end in .safetensors"
        raise UsageError(msg)


def _write_csv(rows: list[dict[str, Any]], path: Path) -> None:
    from nat2024.files import write_atomic

    names = list(dict.fromkeys(name for row in rows for name in row))
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, names, lineterminator="\n", restval="nan")
    writer.writeheader()
    writer.writerows(rows)
    write_atomic(path, text.getvalue())
