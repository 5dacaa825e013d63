"""Numbers of a training over its steps: always as CSV, in TensorBoard where that is installed."""

import csv
import io
import logging
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from nat2024.errors import ResultConflict, Unwritable, UsageError
from nat2024.files import write_atomic

_log = logging.getLogger(__name__)

_NO_BOARD = "TensorBoard's curves cannot be written (%s); curves are written as CSV only"


class CurveFile:
    """A CSV file with a row for a step; a row is whole or absent."""

    def __init__(self, path: Path, step: int) -> None:
        """Go on after `step`: rows of later steps, which a kill has left, are dropped.

        Raises:
            ResultConflict: the file is no curve.
            Unwritable: the file system refuses.
        """
        self.path = path
        self.rows = [row for row in read_curve(path) if _step_of(row, path) <= step]
        self.columns = list(self.rows[0]) if self.rows else []
        if path.exists():
            self._write_all()

    def add(self, step: int, numbers: Mapping[str, float]) -> None:
        """Write one row, at once.

        Raises:
            Unwritable: the file system refuses.
        """
        row = {"step": str(step)} | {key: f"{value:.9g}" for key, value in numbers.items()}
        self.rows.append(row)
        if not self.path.exists() or any(key not in self.columns for key in row):
            self.columns = list(dict.fromkeys([*self.columns, *row]))
            self._write_all()
            return
        try:
            with self.path.open("a", newline="", encoding="utf-8") as file:
                file.write(self._text([row]))
        except OSError as error:
            msg = f"{self.path}: cannot be written ({error.strerror or error})"
            raise Unwritable(msg) from None

    def _write_all(self) -> None:
        head = ",".join(self.columns) + "\n" if self.columns else ""
        write_atomic(self.path, head + self._text(self.rows))

    def _text(self, rows: list[dict[str, str]]) -> str:
        stream = io.StringIO()
        writer = csv.DictWriter(stream, self.columns, restval="", lineterminator="\n")
        writer.writerows(rows)
        return stream.getvalue()


def _step_of(row: Mapping[str, str], path: Path) -> int:
    text = row.get("step") or ""
    if not text.isdecimal() or None in row:  # None: more values than columns
        msg = f"{path}: not a curve of a training, or damaged (step {text!r}); remove it to go on"
        raise ResultConflict(msg)
    return int(text)


def read_curve(path: Path) -> list[dict[str, str]]:
    """Rows of a curve file as texts; a last row that was cut off by a kill is left out."""
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except FileNotFoundError:
        return []
    whole = text[: text.rfind("\n") + 1]
    return list(csv.DictReader(io.StringIO(whole)))


class Board:
    """Curves in TensorBoard's form; where they cannot be written that is said, and no more are."""

    def __init__(self, writer: Any) -> None:
        """Write with a `SummaryWriter`."""
        self._writer = writer

    def add(self, group: str, step: int, numbers: Mapping[str, float]) -> None:
        """Add a point to every curve `group/NAME`."""
        self._do(
            lambda writer: [
                writer.add_scalar(f"{group}/{name}", value, step) for name, value in numbers.items()
            ]
        )

    def close(self) -> None:
        """Write what is left."""
        self._do(lambda writer: writer.close())

    def _do(self, what: Callable[[Any], object]) -> None:
        if self._writer is None:
            return
        try:
            what(self._writer)
        except OSError as error:
            self._writer = None
            _log.warning(_NO_BOARD, error.strerror or error)


def open_tensorboard(folder: Path, step: int, *, required: bool = False) -> Board | None:
    """TensorBoard's curves, or None where it is not installed or its folder cannot be made.

    Which of these it is, is said once; the CSV files have the same numbers.

    Args:
        folder: of its event files.
        step: events after it, which a kill has left, are dropped.
        required: whether its absence is an error.

    Raises:
        UsageError: it is required and not installed.
    """
    try:
        from torch.utils.tensorboard import SummaryWriter
    except ImportError:
        msg = "TensorBoard is not installed (pip install 'nat-bench[train]')"
        if required:
            raise UsageError(msg) from None
        _log.info("%s; curves are written as CSV only", msg)
        return None
    try:
        return Board(SummaryWriter(str(folder), purge_step=step + 1 if step else None))
    except OSError as error:
        _log.warning(_NO_BOARD, error.strerror or error)
        return None
