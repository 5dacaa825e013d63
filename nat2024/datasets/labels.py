"""Attribute labels in a table, made by eye or by `nat-bench dataset attributes --out FILE.csv`.

The headings are `sequence, provenance` and the attributes; a row has 1, 0 or nothing for each. A
sequence may have a row of each provenance: what is published decides, then what a person says, then
what was computed.
"""

import csv
import io
from collections.abc import Mapping
from pathlib import Path
from typing import TypeAlias, get_args

import msgspec

from nat2024.datasets.records import replace_fields
from nat2024.datasets.schema import (
    AnnotatedDataset,
    AnnotatedSequence,
    Provenance,
    read_bytes,
)
from nat2024.datasets.terms import attribute_term
from nat2024.errors import AnnotationInvalid
from nat2024.types import closest

LabelTable: TypeAlias = dict[str, dict[str, dict[str, bool]]]
"""Labels by sequence, provenance and attribute."""

_KEYS = ["sequence", "provenance"]
_DECIDE: tuple[Provenance, ...] = ("published", "manual", "computed")
_LABELS = {"1": True, "0": False}


def read_label_table(path: Path) -> LabelTable:
    """Read a table of labels.

    Raises:
        AnnotationInvalid: other headings, rows of another length, unknown provenance or labels, or
            a row comes twice; names file and line.
    """
    try:
        text = read_bytes(path).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        msg = f"{path}: no text file (byte {error.start} is no UTF-8)"
        raise AnnotationInvalid(msg) from None
    reader = csv.reader(io.StringIO(text, newline=""))
    headings = next(reader, [])
    names = headings[2:]
    if headings[:2] != _KEYS or not all(names) or len(set(names)) < len(names):
        msg = f"{path}: expected the headings sequence, provenance and attributes that differ"
        raise AnnotationInvalid(msg)
    table: LabelTable = {}
    for row in reader:
        if row:
            _add_row(table, row, names, f"{path}, line {reader.line_num}")
    return table


def _add_row(table: LabelTable, row: list[str], names: list[str], where: str) -> None:
    if len(row) != len(names) + 2:
        msg = f"{where}: {len(row)} fields, but {len(names) + 2} headings"
        raise AnnotationInvalid(msg)
    sequence, provenance, *labels = (field.strip() for field in row)
    if provenance not in get_args(Provenance):
        msg = f"{where}: provenance {provenance!r} is none of {', '.join(_DECIDE)}"
        raise AnnotationInvalid(msg)
    strange = [label for label in labels if label not in ("", *_LABELS)]
    if strange:
        msg = f"{where}: label {strange[0]!r}: expected 1, 0 or nothing"
        raise AnnotationInvalid(msg)
    if provenance in table.setdefault(sequence, {}):
        msg = f"{where}: a second row of {sequence!r} with provenance {provenance}"
        raise AnnotationInvalid(msg)
    told = {name: _LABELS[label] for name, label in zip(names, labels, strict=True) if label}
    table[sequence][provenance] = told


def with_labels(document: AnnotatedDataset, table: LabelTable) -> AnnotatedDataset:
    """The same dataset with the labels of a table; none that is published is replaced.

    Args:
        document: the dataset. An attribute that a sequence of it carries as published is taken as
            published for all.
        table: see `read_label_table`.

    Raises:
        AnnotationInvalid: the table names a sequence that the dataset does not have.
    """
    known = {sequence.name for sequence in document.sequences}
    unknown = sorted(table.keys() - known)
    if unknown:
        msg = f"no sequence {unknown[0]!r} in {document.name}{closest(unknown[0], known)}"
        raise AnnotationInvalid(msg)
    fixed = {
        name
        for sequence in document.sequences
        for name, provenance in sequence.attributes.items()
        if provenance == "published"
    }
    labelled = tuple(_labelled(s, table.get(s.name, {}), fixed) for s in document.sequences)
    # An attribute that no sequence carries is listed only where its publisher says so: else it
    # would be taken for one that is published as absent everywhere.
    published = [name for rows in table.values() for name in rows.get("published", {})]
    carried = [name for sequence in labelled for name in sequence.attributes]
    names = dict.fromkeys((*document.attribute_names, *published, *carried))
    terms = {term.name: term for term in document.attributes}
    return msgspec.structs.replace(
        document,
        attributes=tuple(terms.get(name) or attribute_term(name) for name in names),
        sequences=labelled,
    )


def _outranked(label: Provenance | None, provenance: Provenance) -> bool:
    """Whether a label that is there decides against one of another provenance."""
    return label is not None and _DECIDE.index(label) < _DECIDE.index(provenance)


def _labelled(
    sequence: AnnotatedSequence, rows: Mapping[str, Mapping[str, bool]], fixed: set[str]
) -> AnnotatedSequence:
    labels = dict(sequence.attributes)
    decided = set(fixed)
    for provenance in _DECIDE:
        for name, carried in rows.get(provenance, {}).items():
            if name not in decided and not _outranked(labels.get(name), provenance):
                labels.pop(name, None)
                labels |= {name: provenance} if carried else {}
            decided.add(name)
    return replace_fields(sequence, {"attributes": labels})
