"""One run as another toolkit stored it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from nat2024.boxes import parse_rows
from nat2024.errors import BoxFileError
from nat2024.importing.names import split_name
from nat2024.importing.tree import parse_text, read_file
from nat2024.types import Boxes, Floats

_COLUMNS = tuple(range(1, 65))  # one a repeat


@dataclass(frozen=True, slots=True)
class ForeignRun:
    """What one tracker wrote, read where it lies; nothing is copied or unpacked.

    Attributes:
        name: the run's name, unique among those beside it.
        path: its folder or archive; may lead through an archive.
        layout: name of the layout it was recognised by.
        files: by sequence the files of its repeats, at least one.
        times: by sequence the file of its seconds a frame, where there is one.
        load: gives the bytes of one of `files`.
        parse: gives the boxes of such bytes; the path is named in errors.
        restarts: whether the tracker was started anew after failures (VOT short-term), so that
            this is no one-pass result.
        named: tracker and enhancer, where the layout itself tells them apart.
        dataset: name of the dataset, where the layout has it deeper than the run.
    """

    name: str
    path: Path
    layout: str
    files: Mapping[str, tuple[Path, ...]]
    times: Mapping[str, Path] = field(default_factory=dict)
    load: Callable[[Path], bytes] = read_file
    parse: Callable[[bytes, Path], Boxes] = parse_text
    restarts: bool = False
    named: tuple[str, str] | None = None
    dataset: str = ""

    @property
    def tracker(self) -> str:
        """Name of the tracker, nat-bench's own where it has it."""
        return (self.named or split_name(self.name))[0]

    @property
    def enhancer(self) -> str:
        """Name of the enhancer, "none" where the folder's name tells of none."""
        return (self.named or split_name(self.name))[1]

    def finished(self) -> list[str]:
        """Names of all sequences that have a result, sorted."""
        return sorted(self.files)

    def has(self, sequence: str) -> bool:
        """Whether the sequence has a result."""
        return sequence in self.files

    def box_file(self, sequence: str) -> Path:
        """Where the boxes of a sequence (of its first repeat) come from."""
        return self.files[sequence][0]

    def boxes(self, sequence: str) -> Boxes:
        """Boxes of a sequence, of its first repeat, float64 (n, 4).

        Raises:
            BoxFileError: they cannot be read, or are those of a run with restarts.
        """
        path = self.box_file(sequence)
        return self.parse(self._load(path), path)

    def repeats(self, sequence: str) -> list[Boxes]:
        """Boxes of all repeats of a sequence, float64 (n, 4) each."""
        return [self.parse(raw, path) for path, raw in self.contents(sequence)]

    def contents(self, sequence: str) -> list[tuple[Path, bytes]]:
        """Files of all repeats of a sequence and their bytes; `parse` makes boxes of them.

        Raises:
            BoxFileError: they cannot be read, or are those of a run with restarts.
        """
        return [(path, self._load(path)) for path in self.files[sequence]]

    def _load(self, path: Path) -> bytes:
        if self.restarts:
            msg = (
                f"{path}: a VOT short-term result, started anew after each failure, is no one-pass "
                "result; `nat-bench export --accept-restarts` makes one, with those rows as NaN"
            )
            raise BoxFileError(msg)
        return self.load(path)

    def one_pass(self) -> "ForeignRun":
        """The same run, taken for a one-pass result: rows that hold no box become NaN."""
        from dataclasses import replace

        return replace(self, restarts=False)

    def frame_seconds(self, sequence: str) -> Floats | None:
        """Seconds of each frame (n,), the mean over repeats; None where none can be read."""
        path = self.times.get(sequence)
        if path is None:
            return None
        try:
            rows = parse_rows(read_file(path), str(path), _COLUMNS)
        except BoxFileError:  # what only tells of speed must not cost a result
            return None
        # GOT-10k has one column a repeat, and zeros where one was not run
        counted = np.where(rows > 0, rows, np.nan)
        found = np.isfinite(counted)
        total = np.where(found, counted, 0).sum(axis=1)
        return np.asarray(total / np.maximum(1, found.sum(axis=1)), dtype=np.float64)

    def manifest(self) -> None:
        """Nothing: only nat-bench writes one."""
        return
