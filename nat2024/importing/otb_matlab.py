"""`[TRACKER/]SEQ_TRACKER.mat`: the MATLAB benchmarks of OTB, UAV123, UAVDT and DTB70.

`results` is a struct, or a cell of one, with `res` (n x 4), `type` and `len`. Only the type `rect`
is a box; the others are warps of a template (`ivtAff`, `L1Aff`, `LK_Aff`, `affine`, `SIMILARITY`)
or corners, whose way to a box differs between the benchmarks. Origins differ too: AutoTrack's
results lie half a pixel beside the annotation.
"""

import io
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np

from nat2024.errors import BoxFileError
from nat2024.importing.matlab_elements import plain_elements
from nat2024.importing.runs import ForeignRun
from nat2024.importing.tree import Folder
from nat2024.types import Boxes

NAME = "otb-matlab"
WORDS = "[TRACKER/]SEQUENCE_TRACKER.mat (MATLAB benchmarks of OTB, UAV123, UAVDT, DTB70)"

_SUFFIX = ".mat"
_RECTANGLE = "rect"


def find(folder: Folder) -> list[ForeignRun]:
    """The runs in a folder of MATLAB files, one a tracker."""
    stems = [name[: -len(_SUFFIX)] for name in folder.files if name.lower().endswith(_SUFFIX)]
    by_tracker: dict[str, dict[str, tuple[Path, ...]]] = defaultdict(dict)
    for stem in stems:
        own = f"_{folder.name}"
        sequence, _, tracker = stem.rpartition("_")
        if stem.lower().endswith(own.lower()):
            sequence, tracker = stem[: -len(own)], folder.name
        if sequence and tracker:
            by_tracker[tracker][sequence] = (folder.path / f"{stem}{_SUFFIX}",)
    return [
        ForeignRun(tracker, folder.path, NAME, files, parse=parse_rows)
        for tracker, files in sorted(by_tracker.items())
    ]


def parse_rows(raw: bytes, path: Path) -> Boxes:
    """Boxes of a MATLAB result, as they are stored.

    Raises:
        BoxFileError: no MATLAB file before version 7.3, no result in it, or one of another type
            than `rect`, which is named; or scipy is not installed.
    """
    results = _load(raw, path).get("results")
    while isinstance(results, np.ndarray) and results.dtype == object and results.size == 1:
        results = results.item()  # a cell of one
    if isinstance(results, np.ndarray) and results.dtype == object:
        msg = f"{path}: {results.size} results in one file; only one-pass results are read"
        raise BoxFileError(msg)
    kind, rows = getattr(results, "type", None), getattr(results, "res", None)
    if kind is None or rows is None:
        msg = f"{path}: no struct `results` with `type` and `res` in it"
        raise BoxFileError(msg)
    if str(kind) != _RECTANGLE:
        msg = f"{path}: results of the type {kind}, which are no boxes; only rect is read"
        raise BoxFileError(msg)
    return _checked(path, rows, getattr(results, "len", None))


def _load(raw: bytes, path: Path) -> dict[str, Any]:
    try:
        from scipy.io import loadmat  # type: ignore[import-untyped]
        from scipy.io.matlab import MatReadError  # type: ignore[import-untyped]
    except ImportError:
        msg = f'{path}: MATLAB files need scipy: pip install "nat-bench[matlab]"'
        raise BoxFileError(msg) from None
    try:
        found: dict[str, Any] = loadmat(
            io.BytesIO(plain_elements(raw, path)),
            squeeze_me=True,
            struct_as_record=False,
            variable_names=["results"],
        )
    except NotImplementedError:
        msg = f"{path}: a MATLAB file of version 7.3; save it again with -v7"
        raise BoxFileError(msg) from None
    except (
        MatReadError,
        ValueError,
        TypeError,
        OSError,
        EOFError,
        MemoryError,
        IndexError,
    ) as error:
        msg = f"{path}: no MATLAB file, or a damaged one ({error})"
        raise BoxFileError(msg) from None
    return found


def _checked(path: Path, rows: Any, length: Any) -> Boxes:
    try:
        boxes = np.atleast_2d(np.asarray(rows, dtype=np.float64))
    except (TypeError, ValueError):
        boxes = np.empty((0, 0))
    if boxes.ndim != 2 or boxes.shape[1] != 4 or not len(boxes):
        msg = f"{path}: `res` is not n x 4"
        raise BoxFileError(msg)
    if isinstance(length, int | float) and int(length) != len(boxes):
        msg = f"{path}: `len` is {int(length)}, but `res` has {len(boxes)} rows"
        raise BoxFileError(msg)
    return np.ascontiguousarray(boxes)
