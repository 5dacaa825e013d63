"""The annotation schema: exact numbers, one clear line for what does not fit."""

import json

import msgspec
import numpy as np
import pytest

from nat2024.datasets.file_names import find_pattern, is_inner_path
from nat2024.datasets.records import all_boxes, boxes_of, frame_files, rows_of
from nat2024.datasets.schema import (
    AnnotatedDataset,
    AnnotatedSequence,
    AttributeTerm,
    FrameFiles,
    decode_dataset,
    encode_dataset,
    json_schema,
)
from nat2024.datasets.schema_checks import check_dataset, read_dataset
from nat2024.errors import AnnotationInvalid


def dataset(**more):
    frames = FrameFiles(folder="data_seq/car", count=2, pattern="%06d.jpg")
    given = {"name": "car", "frames": frames, "boxes": ((1, 2, 3, 4), (None,) * 4), **more}
    terms = (AttributeTerm(name="FM"),)
    return AnnotatedDataset(name="night", attributes=terms, sequences=(AnnotatedSequence(**given),))


def test_numbers_are_kept_to_the_last_bit():
    boxes = np.array(
        [
            [0.1, -0.0, 1e300, 5e-324],
            [np.nan, 1 / 3, -7.25, 2.0**53 + 2],
            [np.inf, -np.inf, 0.0, np.pi],
        ]
    )
    frames = FrameFiles(folder="", count=3, pattern="%d.png")
    document = dataset(frames=frames, boxes=rows_of(boxes))
    again = decode_dataset(encode_dataset(document), "x")
    assert boxes_of(again.sequences[0].boxes).tobytes() == boxes.tobytes()
    assert b"NaN" not in encode_dataset(document)
    json.loads(encode_dataset(document))  # strict JSON


def test_one_line_a_sequence_and_no_defaults():
    lines = encode_dataset(dataset()).decode().splitlines()
    assert sum('"frames"' in line for line in lines) == 1
    assert '"keyframes"' not in "".join(lines)
    assert '"schema": "nat-bench/1"' in lines[1]


def test_rows_of_keyframes_stand_at_their_frames():
    sequence = dataset(keyframes=(1,), boxes=((5, 6, 7, 8),)).sequences[0]
    assert np.isnan(all_boxes(sequence)[0]).all()
    assert all_boxes(sequence)[1].tolist() == [5, 6, 7, 8]


@pytest.mark.parametrize(
    ("names", "pattern"),
    [
        (("00001.jpg", "00002.jpg"), ("%05d.jpg", 1)),
        (("9.png", "10.png"), ("%d.png", 9)),
        (("img000027.jpg", "img000028.jpg"), ("img%06d.jpg", 27)),
        (("7.jpg",), ("%d.jpg", 7)),
        (("0007.jpg", "0009.jpg"), None),
        (("a.jpg", "b.jpg"), None),
        (("100%1.jpg", "100%2.jpg"), None),
        (("099.jpg", "0100.jpg"), None),
        (("9.jpg", "010.jpg"), None),
    ],
)
def test_patterns(names, pattern):
    assert find_pattern(names) == pattern
    assert frame_files("x", names).files() == names


@pytest.mark.parametrize("path", ["../x", "/etc", "a/../b", "a\\b", "C:/x", "a//b", "./a", "a/."])
def test_paths_that_leave_the_folder_are_refused(path):
    assert not is_inner_path(path)
    with pytest.raises(AnnotationInvalid, match="leads out"):
        check_dataset(dataset(frames=FrameFiles(folder=path, count=2, pattern="%d.jpg")), "x")


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"boxes": ((1, 2, 3, 4),)}, "sequence car: 1 boxes, but 2 frames"),
        ({"visible": (1,)}, "1 values of visible, but 2 frames"),
        ({"cover": (9, 0)}, "cover: expected whole numbers from 0 to 8"),
        ({"keyframes": (0, 2)}, "rising indices from 0 to 1"),
        ({"keyframes": (1, 0)}, "rising indices"),
        ({"keyframes": ()}, "rising indices"),
        ({"keyframes": (0,), "boxes": None}, "keyframes without boxes"),
        ({"attributes": {"XY": "manual"}}, "'XY' is not among the dataset's attributes"),
        ({"fps": -1.0}, "fps -1.0"),
        ({"resolution": (0, 5)}, "resolution 0x5"),
        ({"name": "../car"}, "'../car' cannot be the name of a sequence"),
        ({"frames": FrameFiles(folder="", count=2, names=("../a.jpg", "b.jpg"))}, "'../a.jpg'"),
        ({"frames": FrameFiles(folder="", count=2, names=("a.jpg", "a.jpg"))}, "comes 2 times"),
        ({"frames": FrameFiles(folder="", count=3, names=("a.jpg", "b.jpg"))}, "2 names, but 3"),
        ({"frames": FrameFiles(folder="", count=2)}, "one of names, pattern and video"),
        ({"frames": FrameFiles(folder="", count=0, pattern="%d.jpg")}, "count 0"),
        ({"frames": FrameFiles(folder="", count=10**12, pattern="%d.jpg")}, "count 10000"),
        ({"frames": FrameFiles(folder="", count=2, pattern="%s.jpg")}, "expected one %d"),
        ({"frames": FrameFiles(folder="", count=2, pattern="%d.jpg", sizes=(1,))}, "1 sizes"),
        ({"frames": FrameFiles(folder="", count=2, pattern="%d.jpg", sha256=("", "a"))}, "64 hex"),
    ],
)
def test_what_does_not_fit_is_named_in_one_line(more, words):
    with pytest.raises(AnnotationInvalid) as caught:
        check_dataset(dataset(**more), "here")
    assert words in str(caught.value)
    assert str(caught.value).startswith("here: ")
    assert "\n" not in str(caught.value)


def test_duplicated_names():
    one = dataset()
    twice = msgspec.structs.replace(one, sequences=one.sequences * 2)
    with pytest.raises(AnnotationInvalid, match="sequences: 'car' comes 2 times"):
        check_dataset(twice, "x")


def test_sequences_are_sorted():
    (car,) = dataset().sequences
    bus = msgspec.structs.replace(car, name="bus")
    both = msgspec.structs.replace(dataset(), sequences=(car, bus))
    assert [s.name for s in check_dataset(both, "x").sequences] == ["bus", "car"]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"schema": "nat-bench/2"}, "schema 'nat-bench/2', but this version of nat-bench reads"),
        ({"schema": ""}, "names no schema"),
        ({"schema": 1}, r"\$.schema"),
        ({"licens": "x"}, "unknown field `licens`"),
        ({"name": 3}, r"\$.name"),
        ({"sequences": [{"name": "a", "frames": {"folder": "", "cuont": 1}}]}, "cuont"),
        ({"sequences": [{"name": "a"}]}, r"`frames` - at `\$.sequences\[0\]`"),
    ],
)
def test_other_versions_and_unknown_fields(change, words):
    plain = {"schema": "nat-bench/1", "name": "x", "sequences": [], **change}
    with pytest.raises(AnnotationInvalid, match=words):
        decode_dataset(json.dumps(plain).encode(), "index.json")


@pytest.mark.parametrize("raw", [b"", b"{", b"\xff\xfe", b'{"name": NaN}', b"[" * 100_000])
def test_no_json(raw, tmp_path):
    path = tmp_path / "x.json"
    path.write_bytes(raw)
    with pytest.raises(AnnotationInvalid, match=r"x\.json"):
        read_dataset(path)


def test_json_schema_names_every_field():
    schema = json_schema()
    for struct in (AnnotatedDataset, AnnotatedSequence, FrameFiles, AttributeTerm):
        found = schema["$defs"][struct.__name__]
        assert set(found["properties"]) == {f.name for f in msgspec.structs.fields(struct)}
        assert found["additionalProperties"] is False
        assert all(part["description"] for part in found["properties"].values())
    assert schema["$defs"]["AnnotatedDataset"]["properties"]["schema"]["enum"] == ["nat-bench/1"]
    json.dumps(schema, allow_nan=False)
