"""Labels of a table taken into an index: what is published stays, what a person says goes first."""

import pytest

from nat2024.datasets.labels import read_label_table, with_labels
from nat2024.datasets.schema import (
    AnnotatedDataset,
    AnnotatedSequence,
    AttributeTerm,
    FrameFiles,
)
from nat2024.datasets.schema_checks import check_dataset
from nat2024.errors import AnnotationInvalid


def dataset(**labels):
    frames = FrameFiles(folder="", count=1, pattern="%d.jpg")
    sequences = tuple(
        AnnotatedSequence(name=name, frames=frames, attributes=carried)
        for name, carried in labels.items()
    )
    terms = tuple(AttributeTerm(name=name) for name in ("IV", "FM", "SV"))
    return AnnotatedDataset(name="d", attributes=terms, sequences=sequences)


def table(path, text):
    file = path / "labels.csv"
    file.write_text(text)
    return read_label_table(file)


def test_what_is_published_is_not_replaced(tmp_path):
    before = dataset(a={"IV": "published"}, b={})
    rows = table(
        tmp_path,
        "sequence,provenance,IV,FM,UL\na,computed,0,1,1\nb,computed,1,1,0\n"
        "a,manual,,0,\nb,published,0,,\n",
    )
    after = check_dataset(with_labels(before, rows), "x")
    a, b = after.sequences
    assert a.attributes == {"IV": "published", "UL": "computed"}
    assert b.attributes == {"FM": "computed"}
    assert after.attribute_names == ("IV", "FM", "SV", "UL")
    assert after.attributes[3].title == "uneven light"


def test_newer_labels_replace_older_ones_of_the_same_kind(tmp_path):
    before = dataset(a={"FM": "computed", "SV": "manual"})
    rows = table(tmp_path, "sequence,provenance,FM,SV\na,computed,0,0\n")
    assert with_labels(before, rows).sequences[0].attributes == {"SV": "manual"}
    rows = table(tmp_path, "sequence,provenance,FM,SV\na,manual,1,0\n")
    assert with_labels(before, rows).sequences[0].attributes == {"FM": "manual"}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("name,FM\n", "expected the headings"),
        ("sequence,provenance,FM,FM\n", "expected the headings"),
        ("sequence,provenance,FM\na,manual\n", "line 2: 2 fields, but 3 headings"),
        ("sequence,provenance,FM\na,guessed,1\n", "provenance 'guessed'"),
        ("sequence,provenance,FM\na,manual,yes\n", "label 'yes'"),
        ("sequence,provenance,FM\na,manual,1\na,manual,0\n", "line 3: a second row"),
        ("", "expected the headings"),
    ],
)
def test_broken_tables(tmp_path, text, words):
    with pytest.raises(AnnotationInvalid, match=words):
        table(tmp_path, text)


def test_unknown_sequences(tmp_path):
    rows = table(tmp_path, "sequence,provenance,FM\ncar_11,manual,1\n")
    with pytest.raises(AnnotationInvalid, match="no sequence 'car_11' in d; closest: car_1"):
        with_labels(dataset(car_1={}), rows)
