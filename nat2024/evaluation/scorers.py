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
import struct
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from importlib import metadata
from pathlib import Path
from typing import Any, Final

import msgspec
import numpy as np

from nat2024.errors import BoxFileError, LengthMismatch
from nat2024.keeping import Keeper, cache_folder, digest, trim
from nat2024.metrics import SCORE_NAMES, FrameValues, Protocol, SequenceScores, evaluate_boxes
from nat2024.metrics.scores import CURVE_LENGTHS
from nat2024.store import Run
from nat2024.types import Box, Boxes, Floats, Sequence

FOLDER = "scores"
MOST_BYTES = 2**28
"""Of all kept scores; beyond it go those that were not used for longest."""

_MOST_UNUSED = 1000  # entries a file, of results that have changed or were not asked for
_COUNTS: Final = (
    "frames",
    "rows",
    "length_predicted",
    "length_truth",
    "invalid_truth",
    "bad_results",
)
_HEAD: Final = len(_COUNTS) + len(SCORE_NAMES) + 4
_ENDS: Final = [_HEAD, *(_HEAD + int(end) for end in np.cumsum(list(CURVE_LENGTHS.values())))]

_SUCCESS: Final = struct.Struct("=d")
_SUCCESS_AT: Final = 8 * (len(_COUNTS) + SCORE_NAMES.index("success_auc"))

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
        truths: digest of the ground truth by sequence, filled on the way; scorers of one dataset
            may share it.
        has_new: whether something was computed that is now kept.
    """

    protocol: Protocol
    on_length: str | None
    cache: bool = True
    truths: dict[str, str] = field(default_factory=dict)
    has_new: bool = False
    _settings: dict[str, _Setting] = field(default_factory=dict)
    _rules: str = field(init=False)

    def __post_init__(self) -> None:
        """Digest the rules once: with most protocols they are those of all sequences."""
        self._rules = self._digest(self.protocol)

    def open(self, run: Run) -> "RunScorer":
        """What scores one run."""
        if not self.cache:
            return RunScorer(self, Keeper(None, most_unused=0))
        place = str(run.path.absolute())
        name = digest(place, run.name, run.layout, _options(self.protocol), self.on_length)
        path = cache_folder() / FOLDER / f"{name}.msgpack"
        return RunScorer(self, Keeper(path, most_unused=_MOST_UNUSED))

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
        truth = self.truths.get(sequence.name)
        if truth is None:
            truth = self.truths[sequence.name] = _truth(sequence)
        rules = self._rules if protocol is self.protocol else self._digest(protocol)
        return _Setting(protocol, f"{rules} {truth} ".encode())

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


@dataclass(frozen=True, slots=True)
class RunScorer:
    """Scores the results of one run; `save` keeps what came new."""

    scorer: Scorer
    keeper: Keeper

    def score(self, result: StoredResult, sequence: Sequence) -> tuple[SequenceScores, Box]:
        """Scores of a result, and its first box.

        Raises:
            BoxFileError: the file holds no boxes.
            LengthMismatch: lengths differ and may not.
        """
        setting, on_length = self.scorer.setting(sequence), self.scorer.on_length
        again = _Again(result.run, result.number, result.digest, sequence, setting, on_length)
        return _unpack(self._packed(result, sequence), str(result.path), setting.protocol, again)

    def success(self, result: StoredResult, sequence: Sequence) -> float:
        """The success AUC alone; see `score`."""
        return float(_SUCCESS.unpack_from(self._packed(result, sequence), _SUCCESS_AT)[0])

    def _packed(self, result: StoredResult, sequence: Sequence) -> bytes:
        setting, key = self.scorer.setting(sequence), None
        if self.scorer.cache:
            identity = setting.identity + result.run.layout.encode() + result.digest
            key = hashlib.sha256(identity).hexdigest()
            kept = self.keeper.get(key, bytes)
            if kept is not None and len(kept) == 8 * _ENDS[-1]:
                return kept
        scores = _score(result, sequence, setting.protocol, self.scorer.on_length)
        raw = _pack(scores, result.boxes[0])
        self.keeper.put(key, raw)
        self.scorer.has_new |= key is not None
        return raw

    def save(self) -> None:
        """Keep what came new, where that can be."""
        error = self.keeper.save()
        if error is not None:
            _log.debug("scores are not kept: %s", error)


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
    predicted, truth, visible = result.boxes, sequence.boxes, sequence.visible
    if sequence.keyframes is not None:
        rows = sequence.keyframes
        if len(predicted) != len(sequence):
            msg = (
                f"{result.path}: {len(predicted)} rows, but the sequence has {len(sequence)} "
                "frames, and boxes on some of them only"
            )
            raise LengthMismatch(msg)
        predicted, truth = predicted[rows], truth[rows]
        visible = None if visible is None else visible[rows]
    return evaluate_boxes(
        predicted,
        truth,
        visible=visible,
        protocol=protocol,
        on_length=on_length,
        name=str(result.path),
    )


def _pack(scores: SequenceScores, first: Box) -> bytes:
    """All numbers but those of the frames, bit for bit."""
    head = [getattr(scores, name) for name in (*_COUNTS, *SCORE_NAMES)]
    curves = [getattr(scores, name) for name in CURVE_LENGTHS]
    return np.concatenate([np.array([*head, *first.tolist()]), *curves]).tobytes()


def _unpack(raw: bytes, name: str, protocol: Protocol, again: _Again) -> tuple[SequenceScores, Box]:
    values = np.frombuffer(raw, dtype=np.float64)
    head = iter(values[: _HEAD - 4].tolist())
    counts: dict[str, Any] = {one: int(next(head)) for one in _COUNTS}
    scalars: dict[str, Any] = dict(zip(SCORE_NAMES, head, strict=True))
    curves: dict[str, Any] = dict(zip(CURVE_LENGTHS, _parts(values), strict=True))
    scores = SequenceScores(
        name=name, protocol=protocol, by_frame=again, **counts, **scalars, **curves
    )
    return scores, values[_HEAD - 4 : _HEAD]


def _parts(values: Floats) -> Iterator[Floats]:
    return (values[start:end] for start, end in itertools.pairwise(_ENDS))
