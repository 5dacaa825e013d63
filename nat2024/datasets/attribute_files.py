"""Attribute files of datasets that are not registered, where a person says what is in them."""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

from nat2024.datasets.annotations import read_attributes
from nat2024.datasets.layouts import find_layout
from nat2024.errors import DatasetIncomplete, UsageError
from nat2024.types import Dataset, closest

_ORDERS = {
    "uav123": "SV ARC LR FM FOC POC OV BC IV VC CM SOB",
    "uavdt": "BC CM OM SO IV OB SV LT LO",
    "dtb70": "SV ARV OCC DEF FCM IPR OPR OV BC SOA MB",
    "lasot": "IV POC DEF MB CM ROT BC VC SV FOC FM OV LR ARC",
    "nat2021": "ARC BC CM FM FOC IV LAI OV POC SV SOB VC",
    "uavdark70": "VC FM LR OCC IV",
}

ATTRIBUTE_COLUMNS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {name: tuple(order.split()) for name, order in _ORDERS.items()}
)
"""Columns of attribute files in published order, by dataset."""


def attribute_columns(text: str) -> tuple[str, ...]:
    """Columns by name of a dataset, or as a list of abbreviations such as `SV,ARC,LR`.

    Raises:
        UsageError: neither, or an abbreviation comes twice.
    """
    if text in ATTRIBUTE_COLUMNS:
        return ATTRIBUTE_COLUMNS[text]
    columns = tuple(part.strip() for part in text.split(","))
    if len(columns) < 2 or not all(columns):
        known = ", ".join(ATTRIBUTE_COLUMNS)
        near = closest(text, ATTRIBUTE_COLUMNS)
        msg = f"columns {text!r}: neither names separated by commas nor one of {known}{near}"
        raise UsageError(msg)
    if len(set(columns)) < len(columns):
        msg = f"columns {text!r}: an attribute comes twice"
        raise UsageError(msg)
    return columns


def with_attribute_files(dataset: Dataset, columns: tuple[str, ...]) -> Dataset:
    """The same dataset with the attributes of its files, `att/NAME.txt`, as published ones.

    Args:
        dataset: read from a folder; attributes that it has already stay.
        columns: abbreviations in the order of the columns.

    Raises:
        DatasetIncomplete: there are no attribute files, or a sequence has none.
        BoxFileError: a file has another number of columns, or other values than 0 and 1.
    """
    layout = find_layout(dataset.root) if dataset.root is not None else None
    paths = {s.name: s.attributes for s in layout.sequences} if layout else {}
    missing = [sequence.name for sequence in dataset if paths.get(sequence.name) is None]
    if missing:
        where = dataset.root or dataset.name
        msg = f"{where}: no attribute file (att/NAME.txt) of {', '.join(missing[:5])}"
        raise DatasetIncomplete(msg)
    sequences = tuple(
        replace(sequence, attributes=sequence.attributes | read_attributes(path, columns))
        for sequence in dataset
        if (path := paths[sequence.name]) is not None
    )
    names = tuple(dict.fromkeys((*dataset.attribute_names, *columns)))
    return replace(dataset, sequences=sequences, attribute_names=names)
