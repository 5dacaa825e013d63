"""Scores of stored results, kept from one evaluation to the next.

What is kept lies in the user's cache folder, one file a run and protocol, so that results may lie
anywhere: in archives, or where nobody may write. An entry is found by a digest of all that its
numbers depend on: the bytes of the result, the ground truth, the protocol with its options, and
the code that computes them.
"""

import contextlib
import functools
import hashlib
import itertools
import logging
import platform
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from importlib import metadata
from pathlib import Path
from typing import Any, Final

import msgspec
import numpy as np

from nat2024.errors import ArrayContract, BoxFileError, LengthMismatch
from nat2024.keeping import Keeper, cache_folder, digest, trim
from nat2024.metrics import FrameValues, Protocol, SequenceScores, evaluate_boxes
from nat2024.metrics.batches import Aligned, aligned, measure_rows, pair_of, strict_success
from nat2024.metrics.protocols import LengthRule, check_length_rule
from nat2024.metrics.scores import ROW_LENGTH
from nat2024.store import Run
from nat2024.types import Box, Boxes, Flags, Floats, Sequence

FOLDER = "scores"
MOST_BYTES = 2**28
"""Of all kept scores; beyond it go those that were not used for longest."""

_COMPARED_WITH_STRICT: Final = "pysot"
_MOST_UNUSED = 1000  # entries a file, of results that have changed or were not asked for
_MOST_ROWS = 2**13  # scored at once: fewer take more steps, more leave the processor's cache

_FIRST_BOX: Final = slice(0, 4)
_SCORES: Final = slice(4, 4 + ROW_LENGTH)
_STRICT: Final = 4 + ROW_LENGTH
_ENTRY_LENGTH: Final = _STRICT + 1

_log = logging.getLogger("nat2024")


class StoredResult:
    """One result file: its bytes, and its boxes once somebody asks for them."""

    def __init__(self, run: Run, number: int, path: Path, raw: bytes) -> None:
        """Take what `Run.contents` gave at `number`."""
        self.run = run
        self.number = number
        self.path = path
        self.raw = raw
        self.digest = hashlib.sha256(raw).digest()
        self._boxes: Boxes | None = None

    @property
    def boxes(self) -> Boxes:
        """Float64 (n, 4).

        Raises:
            BoxFileError: the bytes hold no boxes.
        """
        if self._boxes is None:
            self._boxes = self.run.parse(self.raw, self.path)
        return self._boxes


def results_of(run: Run, sequence: str) -> list[StoredResult]:
    """All repeats of a sequence, at least one.

    Raises:
        BoxFileError: one cannot be read.
    """
    found = run.contents(sequence)
    return [StoredResult(run, number, *one) for number, one in enumerate(found)]


@dataclass(frozen=True, slots=True)
class _Setting:
    """How one sequence is scored, and what tells it from all other ways."""

    protocol: Protocol
    identity: bytes


@dataclass(slots=True)
class Scorer:
    """Scores stored results of one dataset under one protocol.

    Attributes:
        protocol: with its options.
        on_length: as in `evaluate`.
        cache: whether scores are kept, and taken from what was kept.
        has_new: whether something was computed that is now kept.
    """

    protocol: Protocol
    on_length: str | None
    cache: bool = True
    has_new: bool = False
    rule: LengthRule | None = field(init=False)
    _settings: dict[str, _Setting] = field(init=False, default_factory=dict)
    _rules: str = field(init=False)

    def __post_init__(self) -> None:
        """Digest the rules once: with most protocols they are those of all sequences."""
        self.rule = check_length_rule(self.on_length)
        self._rules = self._digest(self.protocol)

    @property
    def is_compared(self) -> bool:
        """Whether the success under the protocol `strict` is told too."""
        return self.protocol.name == _COMPARED_WITH_STRICT

    def open(self, run: Run) -> "RunScorer":
        """What scores one run."""
        if not self.cache:
            return RunScorer(self, run, Keeper(None, most_unused=0))
        place = str(run.path.absolute())
        name = digest(place, run.name, run.layout, _options(self.protocol), self.on_length)
        path = cache_folder() / FOLDER / f"{name}.msgpack"
        return RunScorer(self, run, Keeper(path, most_unused=_MOST_UNUSED))

    def setting(self, sequence: Sequence) -> _Setting:
        """How a sequence is scored."""
        found = self._settings.get(sequence.name)
        if found is None:
            found = self._settings[sequence.name] = self._new_setting(sequence)
        return found

    def _new_setting(self, sequence: Sequence) -> _Setting:
        # GOT-10k clips boxes to the image; no other protocol needs to look at one.
        size = sequence.frame_size if self.protocol.name == "got10k-ao" else None
        protocol = self.protocol.for_sequence(size)
        if not self.cache:
            return _Setting(protocol, b"")
        rules = self._rules if protocol is self.protocol else self._digest(protocol)
        return _Setting(protocol, f"{rules} {_truth(sequence)} ".encode())

    def _digest(self, protocol: Protocol) -> str:
        return digest(computation(), _options(protocol), self.on_length)


def _truth(sequence: Sequence) -> str:
    """Tells all that a result is compared with."""
    length = None if sequence.keyframes is None else len(sequence)
    return digest(sequence.boxes, sequence.visible, sequence.keyframes, length)


def _options(protocol: Protocol) -> dict[str, Any]:
    return {one.name: getattr(protocol, one.name) for one in fields(protocol)}


@functools.cache
def computation() -> str:
    """Tells the code that makes scores of bytes from any other version of it."""
    room = Path(__file__).parents[1]
    sources = [*room.glob("metrics/*.py"), *room.glob("importing/*.py"), room / "boxes.py"]
    texts = [path.read_bytes() for path in sorted([*sources, Path(__file__)]) if path.is_file()]
    versions = [np.__version__, msgspec.__version__]
    with contextlib.suppress(metadata.PackageNotFoundError):  # a checkout that is not installed
        versions.append(metadata.version("nat-bench"))
    return digest(*versions, platform.machine(), sys.byteorder, *texts)


@dataclass(slots=True)
class _Entry:
    """One result: its numbers as bytes, or what they are yet to be computed of."""

    sequence: Sequence
    number: int
    digest: bytes
    path: Path
    key: str | None
    packed: bytes = b""
    first: Box | None = None
    waiting: Aligned | None = None


@dataclass(frozen=True, slots=True)
class Scored:
    """What is told of one stored result.

    Attributes:
        scores: of it.
        first: its first box.
        strict: its `success_auc` under the protocol `strict`, NaN where that is not asked.
    """

    scores: SequenceScores
    first: Box
    strict: float


class RunScorer:
    """Scores the results of one run: `take` each, then `finish`.

    Results that are not kept wait until there are some to be scored at once.
    """

    def __init__(self, scorer: Scorer, run: Run, keeper: Keeper) -> None:
        """Begin a run."""
        self._scorer = scorer
        self._run = run
        self._keeper = keeper
        self._entries: list[_Entry] = []
        self._waiting: list[_Entry] = []
        self._rows = 0

    def take(self, results: list[StoredResult], sequence: Sequence) -> None:
        """Take all repeats of a sequence.

        Raises:
            BoxFileError: a file holds no boxes.
            LengthMismatch: lengths differ and may not.
            ArrayContract: rows of a result taken before that the protocol's toolkit refuses.
        """
        setting = self._scorer.setting(sequence)
        found = [self._entry(result, sequence, setting) for result in results]
        self._entries += found
        for entry in found:
            if entry.waiting is not None:
                self._waiting.append(entry)
                self._rows += len(entry.waiting.truth)
        if self._rows >= _MOST_ROWS:
            self._score_waiting()

    def _entry(self, result: StoredResult, sequence: Sequence, setting: _Setting) -> _Entry:
        key = None
        if self._scorer.cache:
            identity = setting.identity + result.run.layout.encode() + result.digest
            key = hashlib.sha256(identity).hexdigest()
        entry = _Entry(sequence, result.number, result.digest, result.path, key)
        kept = self._keeper.get(key, bytes)
        if kept is not None and len(kept) == 8 * _ENTRY_LENGTH:
            entry.packed = kept
        else:
            entry.waiting = _aligned(result, sequence, setting.protocol, self._scorer.rule)
            entry.first = result.boxes[0]
        return entry

    def _score_waiting(self) -> None:
        """Score those that wait, all of one protocol at once."""
        for _, group in itertools.groupby(self._waiting, self._alike):
            entries = list(group)
            protocol = self._scorer.setting(entries[0].sequence).protocol
            for entry, row in zip(entries, self._measured(entries, protocol), strict=True):
                entry.packed = row.tobytes()
                entry.first = entry.waiting = None
                self._keeper.put(entry.key, entry.packed)
                self._scorer.has_new |= entry.key is not None
        self._waiting, self._rows = [], 0

    def _alike(self, entry: _Entry) -> tuple[Protocol, bool]:
        assert entry.waiting is not None
        return self._scorer.setting(entry.sequence).protocol, entry.waiting.visible is None

    def _measured(self, entries: list[_Entry], protocol: Protocol) -> Floats:
        """The numbers of each entry, float64 (s, `_ENTRY_LENGTH`)."""
        given = [entry.waiting for entry in entries if entry.waiting is not None]
        found = np.full((len(given), _ENTRY_LENGTH), np.nan)
        found[:, _FIRST_BOX] = [entry.first for entry in entries]
        try:
            with np.errstate(all="ignore"):
                pair = pair_of(given, protocol)
                if self._scorer.is_compared:
                    found[:, _STRICT] = strict_success(pair)
                found[:, _SCORES], _ = measure_rows(given, pair)
        except ArrayContract as error:
            for entry in entries if len(entries) > 1 else ():
                self._measured([entry], protocol)  # the first that is refused is named
            msg = f"{entries[0].path}: {error}"
            raise ArrayContract(msg) from None
        return found

    def finish(self) -> Iterator[tuple[str, list[Scored]]]:
        """Name of each sequence and its repeats, in the order in which they were taken.

        What came new is kept, where that can be.
        """
        self._score_waiting()
        error = self._keeper.save()
        if error is not None:
            _log.debug("scores are not kept: %s", error)
        if not self._entries:
            return
        # one table of a run needs less memory than its rows
        table = np.frombuffer(b"".join(entry.packed for entry in self._entries))
        pairs = zip(self._entries, table.reshape(-1, _ENTRY_LENGTH), strict=True)
        for name, group in itertools.groupby(pairs, lambda pair: pair[0].sequence.name):
            yield name, [self._scored(entry, row) for entry, row in group]

    def _scored(self, entry: _Entry, row: Floats) -> Scored:
        setting, rule = self._scorer.setting(entry.sequence), self._scorer.on_length
        again = _Again(self._run, entry.number, entry.digest, entry.sequence, setting, rule)
        scores = SequenceScores(
            name=str(entry.path), protocol=setting.protocol, by_frame=again, row=row[_SCORES]
        )
        return Scored(scores, row[_FIRST_BOX], float(row[_STRICT]))


def trim_kept() -> None:
    """Delete what was not used for longest, where too much is kept."""
    trim(cache_folder() / FOLDER, MOST_BYTES)


@dataclass(frozen=True, slots=True)
class _Again:
    """Computes the values of the frames of a stored result again."""

    run: Run
    number: int
    digest: bytes
    sequence: Sequence
    setting: _Setting
    on_length: str | None

    def __call__(self) -> FrameValues:
        found = results_of(self.run, self.sequence.name)[self.number :]
        if not found or found[0].digest != self.digest:
            msg = f"{self.run.box_file(self.sequence.name)}: has changed since it was evaluated"
            raise BoxFileError(msg)
        scores = _score(found[0], self.sequence, self.setting.protocol, self.on_length)
        return scores.frame_values()


def _score(
    result: StoredResult, sequence: Sequence, protocol: Protocol, on_length: str | None
) -> SequenceScores:
    """Score a result on the frames that have ground truth."""
    predicted, truth, visible = _on_keyframes(result, sequence)
    return evaluate_boxes(
        predicted,
        truth,
        visible=visible,
        protocol=protocol,
        on_length=on_length,
        name=str(result.path),
    )


def _aligned(
    result: StoredResult, sequence: Sequence, protocol: Protocol, rule: LengthRule | None
) -> Aligned:
    predicted, truth, visible = _on_keyframes(result, sequence)
    try:
        return aligned(predicted, truth, visible, protocol, rule)
    except (ArrayContract, LengthMismatch) as error:
        msg = f"{result.path}: {error}"
        raise type(error)(msg) from None


def _on_keyframes(result: StoredResult, sequence: Sequence) -> tuple[Boxes, Boxes, Flags | None]:
    """Result, ground truth and flags on the frames that have ground truth."""
    predicted, truth, visible = result.boxes, sequence.boxes, sequence.visible
    if sequence.keyframes is None:
        return predicted, truth, visible
    rows = sequence.keyframes
    if len(predicted) != len(sequence):
        msg = (
            f"{result.path}: {len(predicted)} rows, but the sequence has {len(sequence)} "
            "frames, and boxes on some of them only"
        )
        raise LengthMismatch(msg)
    return predicted[rows], truth[rows], None if visible is None else visible[rows]
