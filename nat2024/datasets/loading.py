"""Loading datasets: by registered name, or any folder whose layout is recognised."""

import logging
import os
from collections.abc import Iterable
from dataclasses import replace
from typing import Any, Literal, TypeAlias

from nat2024.datasets.frameless import frameless_sequences
from nat2024.datasets.reading import (
    Place,
    ReadSequence,
    attribute_names,
    locate,
    read_sequences,
)
from nat2024.datasets.registered import DatasetFacts, is_registered
from nat2024.errors import BoxFileError, DatasetIncomplete, UsageError
from nat2024.files import expand
from nat2024.types import Dataset, Origin

Rule: TypeAlias = Literal["published", "length", "all"]
"""Which sequences of a folder belong to the dataset; see `load_dataset`."""

_log = logging.getLogger("nat2024")


def load_dataset(
    name_or_path: str | os.PathLike[str],
    root: str | os.PathLike[str] | None = None,
    *,
    unannotated: bool = False,
    frameless: bool = False,
    lenient: bool = False,
    rule: Rule | None = None,
) -> Dataset:
    """Load a registered dataset, or any folder whose layout is recognised.

    Only names and box files are read; frames are decoded when asked for. Sequences without a box
    for every frame are left out and named in one line of log.

    Args:
        name_or_path: a registered name (`list_datasets`), else a folder; a registered name goes
            before a folder of that name, `./NAME` is always the folder.
        root: folder of a registered dataset, or a folder that holds it; None takes the
            environment, then the configuration file (`nat2024.datasets.find_root`).
        unannotated: keep sequences without annotation too, with boxes (0, 4), and those with boxes
            of some frames only, with `keyframes` set.
        frameless: keep sequences of which only boxes are there too, enough to score results; their
            frames raise `FrameUnreadable`. One line of log names them.
        lenient: cut boxes and images to the shorter where they differ in number, with a line of
            log, instead of raising.
        rule: which sequences belong to it: "published" those of the published list, "length" those
            with at least as many rows of boxes as the dataset's official loader asks for, "all"
            whatever is there. None is "published" for NAT2024-1, whose download holds more than
            is reported, else "all".

    Returns:
        The dataset, named by the registered name or by the folder's base name.

    Raises:
        DatasetNotFound: no such name or folder, or the folder is no dataset; a registered one says
            where a person gets it.
        DatasetIncomplete: sequences whose files do not fit together, all named in one message; or
            the folder holds another dataset.
        BoxFileError: box files that cannot be read, where that is all that is wrong.
        UsageError: options that do not fit together, or a wrong configuration file.
    """
    place, asked = locate(name_or_path, root, frameless=frameless), rule
    place, rule = _keep_published(place, rule)
    read = _keep_long(place, read_sequences(place, frameless=frameless), rule)
    kept = [r for r in read if unannotated or r.has_boxes]
    left_out = tuple(r.name for r in read if not (unannotated or r.has_boxes))
    _refuse_faulty(place, read, lenient=lenient)
    _log_remarks(place, kept, left_out)
    return Dataset(
        place.name,
        tuple(r.sequence() for r in kept),
        place.folder,
        place.layout.words,
        left_out,
        attribute_names(kept, place),
        Origin(
            _lasting(name_or_path),
            str(expand(root).resolve()) if root is not None else "",
            lenient,
            asked,
        ),
    )


def _lasting(name_or_path: str | os.PathLike[str]) -> str:
    """A registered name as it is; a path made absolute, so that it can be found from anywhere."""
    if isinstance(name_or_path, str) and is_registered(name_or_path):
        return name_or_path
    return str(expand(name_or_path).resolve())


def load_again(origin: Origin, *, frameless: bool = False) -> Dataset:
    """Load a dataset as it was loaded before, sequences without full annotation included."""
    rule: Any = origin.rule
    return load_dataset(
        origin.source,
        origin.root or None,
        unannotated=True,
        frameless=frameless,
        lenient=origin.lenient,
        rule=rule,
    )


def _keep_published(place: Place, rule: Rule | None) -> tuple[Place, Rule]:
    """Leave out what is not in the published list, if that is the rule."""
    facts = place.facts
    if rule is None:
        rule = "published" if facts and facts.reported_only else "all"
    if rule == "all":
        return place, rule
    if facts is None or not (facts.sequences if rule == "published" else facts.minimum_rows):
        msg = f"rule={rule!r}: {place.name} has no published rule of that kind; use rule='all'"
        raise UsageError(msg)
    if rule == "length":
        return place, rule
    kept = tuple(s for s in place.layout.sequences if s.name in facts.sequences)
    extra = [s.name for s in place.layout.sequences if s.name not in facts.sequences]
    if extra:
        _log.warning(
            "%s: left out, not among the %d that are reported: %s",
            place.name,
            len(facts.sequences),
            some(extra),
        )
    return replace(place, layout=replace(place.layout, sequences=kept)), rule


def _keep_long(place: Place, read: list[ReadSequence], rule: Rule) -> list[ReadSequence]:
    """Leave out what has too few rows, if that is the rule."""
    minimum = place.facts.minimum_rows if place.facts and rule == "length" else 0
    short = [r.name for r in read if r.has_boxes and not r.fault and len(r.boxes) < minimum]
    if short:
        _log.warning("%s: left out, under %d rows: %s", place.name, minimum, some(short))
    return [r for r in read if r.name not in short]


def _refuse_faulty(place: Place, read: Iterable[ReadSequence], *, lenient: bool) -> None:
    faults = [r for r in read if r.fault is not None]
    cut = [r for r in faults if lenient and r.lengths_differ]
    if cut:
        lengths = [f"{r.name} ({len(r.boxes)} boxes, {len(r.found.frames)} images)" for r in cut]
        _log.warning("%s: cut to the shorter: %s", place.name, some(lengths))
    errors = [r.fault for r in faults if r not in cut]
    if not errors:
        return
    kind = BoxFileError if all(isinstance(e, BoxFileError) for e in errors) else DatasetIncomplete
    uncut = any(r.lengths_differ for r in faults if r not in cut)
    advice = "; --lenient (lenient=True) cuts to the shorter" if uncut else ""
    msg = f"dataset {place.name}: {some([str(e) for e in errors], separator='; ')}{advice}"
    raise kind(msg)


def _log_remarks(place: Place, kept: list[ReadSequence], left_out: tuple[str, ...]) -> None:
    absent = frameless_sequences([r.found for r in kept])
    if absent:
        which = "any sequence" if len(absent) == len(kept) else some(absent)
        _log.warning("%s: no frames of %s, scores need none", place.name, which)
    if left_out:
        _log.warning("%s: left out, not every frame has a box: %s", place.name, some(left_out))
    if place.layout.empty:
        _log.warning("%s: folders without images: %s", place.name, some(place.layout.empty))
    if place.layout.without_frames:
        missing = some(place.layout.without_frames)
        _log.warning("%s: boxes but no folder of images: %s", place.name, missing)
    if place.registered and place.facts:
        _log_difference(place, place.facts)
    _log_attributes(place, kept)


def _log_difference(place: Place, facts: DatasetFacts) -> None:
    there = {s.name for s in place.layout.sequences}
    missing = sorted(facts.sequences.keys() - there)
    extra = sorted(there - facts.sequences.keys()) if facts.sequences else []
    parts = (
        [f"{len(missing)} of {len(facts.sequences)} missing: {some(missing)}"] if missing else []
    )
    parts += [f"{len(extra)} not in the published list: {some(extra)}"] if extra else []
    if parts:
        _log.warning("%s: %s", place.name, "; ".join(parts))


def _log_attributes(place: Place, kept: list[ReadSequence]) -> None:
    files = [r for r in kept if r.found.attributes]
    if files and not (place.facts and place.facts.attribute_columns):
        _log.warning(
            "%s: attribute files are not used, the order of their columns is not known: "
            "the folder is not recognised as a registered dataset that publishes it",
            place.name,
        )
    faults = [r.attribute_fault for r in kept if r.attribute_fault]
    if faults:
        _log.warning("%s: attributes not used: %s", place.name, some(faults, separator="; "))


def some(names: Iterable[str], limit: int = 20, separator: str = ", ") -> str:
    """Names in one line, after `limit` of them only their number."""
    names = list(names)
    more = f"{separator}and {len(names) - limit} more" if len(names) > limit else ""
    return separator.join(names[:limit]) + more
