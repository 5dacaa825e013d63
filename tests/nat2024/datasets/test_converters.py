"""Every format gives back what was written, to the last bit (property tests)."""

import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from nat2024.datasets.conversion import convert
from nat2024.datasets.converters import CONVERTERS
from nat2024.datasets.converters.common import iterate_once
from nat2024.datasets.file_names import is_plain_name
from nat2024.datasets.records import annotated_rows, frame_files
from nat2024.datasets.schema import (
    AnnotatedDataset,
    AnnotatedSequence,
    AttributeTerm,
    decode_dataset,
    encode_dataset,
)
from nat2024.datasets.schema_checks import check_dataset
from nat2024.types import Boxes

FORMATS = sorted(CONVERTERS)
WORDS = st.text(st.characters(exclude_categories=["Cs"]), max_size=12)
NAMES = st.text(st.sampled_from("abcXYZ019 _-.()äßéЖ夜λ%#"), min_size=1, max_size=8).filter(
    is_plain_name
)
NUMBERS = st.one_of(
    st.floats(),
    st.floats(-2000, 2000, width=32),
    st.integers(-50, 4000).map(float),
    st.sampled_from([0.0, -0.0, float("nan")]),
)
ROWS = st.one_of(
    st.just((float("nan"),) * 4),
    st.tuples(NUMBERS, NUMBERS, NUMBERS, NUMBERS),
)


@st.composite
def frames(draw: st.DrawFn, count: int):
    folder = "/".join(draw(st.lists(NAMES, max_size=2)))
    if draw(st.booleans()):
        first = draw(st.integers(0, 1200))
        digits = draw(st.integers(1, 6))
        names = tuple(f"{i:0{digits}d}.jpg" for i in range(first, first + count))
    else:
        stems = draw(st.lists(NAMES, min_size=count, max_size=count, unique=True))
        names = tuple(f"{stem}.{draw(st.sampled_from(['jpg', 'PNG']))}" for stem in stems)
    return frame_files(folder, names)


def per_frame(count: int, highest: int = 1):
    values = st.lists(st.integers(0, highest), min_size=count, max_size=count).map(tuple)
    return st.none() | values


@st.composite
def sequences(draw: st.DrawFn, attributes: tuple[str, ...]):
    count = draw(st.integers(1, 5))
    fields = {}
    if draw(st.integers(0, 5)):
        boxes: Boxes = np.array(draw(st.lists(ROWS, min_size=count, max_size=count)))
        indices = st.lists(st.integers(0, count - 1), min_size=1, unique=True).map(sorted)
        keyframes = draw(st.none() | indices)
        fields = annotated_rows(boxes, None if keyframes is None else np.array(keyframes))
    carried = draw(st.sets(st.sampled_from(attributes))) if attributes else set()
    provenance = st.sampled_from(["published", "computed", "manual"])
    return AnnotatedSequence(
        name=draw(NAMES),
        frames=draw(frames(count)),
        **fields,
        visible=draw(per_frame(count)),
        absent=draw(per_frame(count)),
        cover=draw(per_frame(count, 8)),
        cut_by_image=draw(per_frame(count)),
        category=draw(WORDS),
        activity=draw(WORDS),
        attributes={name: draw(provenance) for name in sorted(carried)},
        resolution=draw(st.none() | st.tuples(st.integers(1, 9999), st.integers(1, 9999))),
        fps=draw(st.none() | st.floats(0.001, 1000)),
        extra=draw(
            st.dictionaries(
                st.sampled_from(["got10k.url", "pysot.video_dir", "pysot.note", "note"]), WORDS
            )
        ),
    )


@st.composite
def datasets(draw: st.DrawFn):
    attributes = tuple(draw(st.lists(st.sampled_from(["FM", "UL", "Ö", "x y"]), unique=True)))
    found = st.lists(
        sequences(attributes), min_size=1, max_size=3, unique_by=lambda s: s.name.lower()
    )
    document = AnnotatedDataset(
        name=draw(NAMES),
        title=draw(WORDS),
        version=draw(WORDS),
        licence=draw(WORDS),
        citation=draw(WORDS),
        fps=draw(st.none() | st.floats(0.001, 1000)),
        resolution=draw(st.none() | st.just((1920, 1080))),
        attributes=tuple(AttributeTerm(name=n, title=draw(WORDS)) for n in attributes),
        sequences=tuple(draw(found)),
    )
    return check_dataset(document, "generated")


def write(document: AnnotatedDataset, name: str, folder: Path) -> None:
    for path, data in iterate_once(CONVERTERS[name].files(document)):
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_bytes(data)


@pytest.mark.parametrize("name", FORMATS)
@given(document=datasets())
@settings(max_examples=80, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_what_is_written_is_read_back(name: str, document: AnnotatedDataset) -> None:
    converter = CONVERTERS[name]
    with tempfile.TemporaryDirectory() as folder:
        write(document, name, Path(folder))
        path = converter.find(Path(folder))
        assert path is not None
        found = converter.read(path, Path(folder))
        places = converter.frame_paths(document)
        assert {
            s: tuple(str(f.path(i).relative_to(folder)) for i in range(len(f)))
            for s, f in found.frames.items()
        } == places
    # as bytes: -0.0 and 0.0 are equal numbers, but not equal files
    assert encode_dataset(found.document) == encode_dataset(document)


@given(document=datasets(), order=st.permutations(FORMATS))
@settings(max_examples=12, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_through_all_formats_and_back(document: AnnotatedDataset, order: list[str]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        here = Path(folder) / "start"
        here.mkdir()
        write(document, "index", here)
        for number, name in enumerate([*order, "index"]):
            out = Path(folder) / f"{number}"
            convert(here, out, name, frames="none")
            here = out
        assert (here / "nat-bench.json").read_bytes() == encode_dataset(document)


@given(document=datasets())
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_json_of_the_schema(document: AnnotatedDataset) -> None:
    again = decode_dataset(encode_dataset(document), "x")
    assert encode_dataset(again) == encode_dataset(document)
