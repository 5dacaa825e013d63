import json
import math
import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from nat2024.boxes import (
    _parse_lines,
    _parse_plain,
    _parse_regular,
    format_boxes,
    parse_boxes,
    read_boxes,
    write_boxes,
)
from nat2024.errors import ArrayContract, BoxFileError

LENGTHS = (4, 5, 8)
TWO_ROWS = [[1, 2, 3, 4], [5, 6, 7, 8]]

any_float = st.one_of(
    st.floats(width=64),
    st.integers(0, 2**64 - 1).map(lambda bits: struct.unpack("d", struct.pack("Q", bits))[0]),
    st.integers(-(10**18), 10**18).map(float),
    st.sampled_from([-0.0, 5e-324, 1e15, 1e16, 1e22, 1e23, 2.0**53 + 2, -1e300]),
)
written_number = st.one_of(
    any_float.map(repr),
    st.integers(-(10**20), 10**20).map(str),
    st.floats(-1e5, 1e5).map(lambda value: f"{value:.3f}"),
    st.floats(-1e5, 1e5).map(lambda value: f"{value:.18e}"),
    st.floats(-1e5, 1e5).map(lambda value: f"{value:.40f}"),
    st.sampled_from(["NaN", "nan", "NAN", "inf", "-inf", "+1", "01", "-00", "-0", "1.", ".5"]),
    st.sampled_from(["1_0", "null", "1-2", "--1", "-", "1e400", "true", "", "0x1", "N", "u", "٣"]),
)


def same_bits(a: np.ndarray, b: np.ndarray) -> bool:
    """Equal values, equal signs of zeros, NaN at the same places."""
    signs = np.signbit(a) == np.signbit(b)
    return a.shape == b.shape and bool(
        np.array_equal(a, b, equal_nan=True) and (signs | np.isnan(a)).all()
    )


# the accepted language -------------------------------------------------------------------------


@pytest.mark.parametrize(
    "text",
    [
        "1,2,3,4\n5,6,7,8\n",
        "1\t2\t3\t4\n5\t6\t7\t8\n",
        "1 2 3 4\n5 6 7 8\n",
        "1;2;3;4\n5;6;7;8\n",
        "1, 2, 3, 4\n5, 6, 7, 8\n",
        "1,\t2,\t3,\t4\n5,\t6,\t7,\t8\n",
        "1  2  3  4\n5  6  7  8\n",
        "1,2,3,4\n5\t6\t7\t8\n",
        "1,2,3,4\r\n5,6,7,8\r\n",
        "1,2,3,4\r5,6,7,8\r",
        "1,2,3,4\n5,6,7,8",
        "1,2,3,4\n5,6,7,8\n\n \n",
        " 1,2,3,4\n 5,6,7,8\n",
        "1,2,3,4,\n5,6,7,8,\n",
        "1,2,3,4 \n5,6,7,8 \n",
        "\ufeff1,2,3,4\n5,6,7,8\n",
        "# x,y,w,h\n1,2,3,4\n# again\n5,6,7,8\n",
        "1e0,2.0,+3,4\n5.0E0,06,7.,.8e1\n",
        "1,2,3,4,0.9\n5,6,7,8,0.8\n",
        "1,2,4,2,4,6,1,6\n5,6,12,6,12,14,5,14\n",
    ],
)
@pytest.mark.parametrize("as_bytes", [False, True])
def test_every_variant_gives_the_same_rows(text: str, as_bytes: bool) -> None:
    boxes = parse_boxes(text.encode() if as_bytes else text)
    np.testing.assert_array_equal(boxes, TWO_ROWS)
    assert boxes.dtype == np.float64
    assert boxes.flags.c_contiguous


@pytest.mark.parametrize("absent", ["NaN,NaN,NaN,NaN", "nan nan nan nan", "NAN,nan,NaN,+nan"])
def test_nan_marks_an_absent_target(absent: str) -> None:
    boxes = parse_boxes(f"1,2,3,4\n{absent}\n")
    np.testing.assert_array_equal(boxes, [[1, 2, 3, 4], [np.nan] * 4])


def test_infinite_values_are_kept() -> None:
    np.testing.assert_array_equal(parse_boxes("1,inf,-Infinity,4"), [[1, np.inf, -np.inf, 4]])


def test_polygons_become_bounding_boxes() -> None:
    np.testing.assert_array_equal(parse_boxes("5,0,10,5,5,10,0,5\n"), [[0, 0, 10, 10]])


@pytest.mark.shared
def test_every_text_of_the_parity_kit(shared: Path) -> None:
    text = (shared / "parity" / "metrics" / "parsing.json").read_text()
    cases = json.loads(text)["cases"]
    special = {
        "five_fields_score": TWO_ROWS,
        "polygon": [[0, 0, 10, 5]],
        "inf": [[1, 2, np.inf, 4]],
    }
    assert len(cases) == 27
    for name, case in cases.items():
        wanted = special.get(name, case["wanted"])
        if isinstance(wanted, str):
            assert wanted.startswith("clear error"), name
            with pytest.raises(BoxFileError, match=f"^{name}.txt"):
                parse_boxes(case["text"], f"{name}.txt")
        else:
            np.testing.assert_array_equal(
                parse_boxes(case["text"]), np.array(wanted, dtype=object).astype(float), name
            )


# errors ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("1,2,3\n", 1, "3 fields in '1,2,3', expected 4 or 5 or 8"),
        ("1,2,3,4\n5,6,7\n", 2, "3 fields"),
        ("1,2,3,4\n5,6,7,8,9\n", 2, "5 fields, but the first row has 4"),
        ("1,2,3,4\n1,2,3,4,5,6,7,8\n", 2, "8 fields, but the first row has 4"),
        ("x,y,w,h\n1,2,3,4\n", 1, "'x,y,w,h' is not a row of numbers"),
        ("1,2,3,4\n\n5,6,7,8\n", 2, "blank line between rows; write NaN"),
        ("1,2,3,4\n1,2,3,4_0\n", 2, "not a row of numbers"),
        ("1,2,3,٤\n", 1, "not a row of numbers"),
        ("1,2,3,\uff14\n", 1, "not a row of numbers"),
        ("1,2,3,null\n", 1, "not a row of numbers"),
        ("1,2,3,1-2\n", 1, "not a row of numbers"),
        ("1,2,3,--2\n", 1, "not a row of numbers"),
        ("1,2,3,-\n", 1, "not a row of numbers"),
        ("1,2,3,1.2.3\n", 1, "not a row of numbers"),
        ("1,2,3,0x10\n", 1, "not a row of numbers"),
        ("1,2,3,4\n" * 700 + "1,2,3\n", 701, "3 fields"),
        ("1,2,3,4,5\n1,,2,3,4\n", 2, "not a row of numbers"),  # an empty field shifts nothing
    ],
)
@pytest.mark.parametrize("as_bytes", [False, True])
def test_errors_name_file_and_line(text: str, line: int, words: str, as_bytes: bool) -> None:
    with pytest.raises(BoxFileError) as info:
        parse_boxes(text.encode() if as_bytes else text, "bike1.txt")
    assert str(info.value).startswith(f"bike1.txt, line {line}: ")
    assert words in str(info.value)


@pytest.mark.parametrize("text", ["", "\n\n", " \t\n", "# only a comment\n", "\ufeff"])
def test_a_text_without_boxes_is_refused(text: str) -> None:
    with pytest.raises(BoxFileError, match=r"bike1\.txt: no boxes in it"):
        parse_boxes(text, "bike1.txt")
    with pytest.raises(BoxFileError, match="no boxes in it"):
        parse_boxes(text.encode())


def test_long_lines_are_shortened_in_messages() -> None:
    with pytest.raises(BoxFileError) as info:
        parse_boxes("a" * 500)
    assert len(str(info.value)) < 120


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(BoxFileError, match="no such file of boxes"):
        read_boxes(tmp_path / "absent.txt")
    with pytest.raises(BoxFileError, match="cannot be read"):
        read_boxes(tmp_path)
    path = tmp_path / "image.txt"
    path.write_bytes(b"1,2,3,4\n\xff\xd8")
    with pytest.raises(BoxFileError, match=r"image\.txt: not a text file of boxes \(byte 8"):
        read_boxes(path)


# the fast path ---------------------------------------------------------------------------------


@pytest.mark.parametrize("separator", [",", "\t", " ", ";", ", "])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
@pytest.mark.parametrize(
    "row", ["1 -2 30 4", "1.5 -2.25 3e2 4", "NaN NaN NaN NaN", "1 2 3 4 0.5", "-0.0 0 1 1"]
)
def test_regular_text_takes_the_fast_path(separator: str, end: str, row: str) -> None:
    text = end.join([row.replace(" ", separator)] * 3) + end
    fast = _parse_regular(text.encode(), LENGTHS)
    assert fast is not None
    assert same_bits(fast, _parse_lines(text, "text", LENGTHS))


@given(
    rows=st.lists(st.lists(written_number, min_size=4, max_size=5), min_size=1, max_size=4),
    separator=st.sampled_from([",", "\t", " ", ";", ", ", ",\t", "  "]),
    end=st.sampled_from(["\n", "\r\n", "\r"]),
    tail=st.sampled_from(["", "\n", "\r\n\r\n", ",", " "]),
)
@example(rows=[["-0", "1", "2", "3"]], separator=",", end="\n", tail="")
@example(rows=[["1", "2", "3", "-0"]], separator=",", end="\n", tail="")
@example(rows=[["1.5", "2", "-0", "3"]], separator=",", end="\n", tail="")
@example(rows=[["1", "2", "3", "9223372036854775808"]], separator="\t", end="\n", tail="")
@example(rows=[["1-2", "3", "4", "-"]], separator=" ", end="\n", tail="")
def test_the_fast_path_reads_only_what_the_slow_one_does(rows, separator, end, tail) -> None:
    text = end.join(map(separator.join, rows)) + tail
    fast = _parse_regular(text.encode(), LENGTHS)
    if fast is not None:
        assert same_bits(fast, _parse_lines(text, "text", LENGTHS))


short_number = st.one_of(
    st.integers(-12000, 12000).map(str),
    st.floats(-2000, 2000).map(lambda value: f"{value:.3f}"),
    st.floats(-2000, 2000).map(repr),
    st.sampled_from(
        ["-0", "00", "007", "-0099", "9999", "10000", "-", "--1", "1-2", "1/2", ":", ""]
    ),
)


@given(
    rows=st.lists(st.lists(short_number, min_size=4, max_size=5), min_size=1, max_size=5),
    separators=st.lists(st.sampled_from([",", "\t", " ", ";", "+", "#"]), min_size=5, max_size=5),
    tail=st.sampled_from(["", "\n", "\n\n", ",", "0"]),
)
@example(rows=[["1", "2", "3", "4"]] * 3, separators=[",", "\t", " ", ",", ","], tail="\n")
@example(rows=[["-1", "22", "-333", "4444"]] * 2, separators=[","] * 5, tail="")
@example(rows=[["1", "2", "3", "4"], ["5", "6", "7"]], separators=[","] * 5, tail="")
def test_plain_numbers_are_read_as_float_reads_them(rows, separators, tail) -> None:
    lines = ["".join(a + b for a, b in zip(row, separators, strict=False))[:-1] for row in rows]
    text = "\n".join(lines) + tail
    fast = _parse_plain(b"\n" + text.encode() + b"\n", LENGTHS)
    if fast is not None:
        assert same_bits(fast, _parse_lines(text, "text", LENGTHS))


@pytest.mark.parametrize("separator", [",", "\t", " "])
def test_boxes_of_most_trackers_are_read_at_once(separator: str) -> None:
    rows = [[742, 7, 26, 73], [-5, -1234, 9999, 0], [0, 10, 100, 1000]]
    text = "\n".join(separator.join(map(str, row)) for row in rows)
    found = _parse_plain(f"\n{text}\n".encode(), LENGTHS)
    assert same_bits(found, np.array(rows, dtype=np.float64))


@given(st.lists(st.tuples(*[any_float.filter(math.isfinite)] * 4), min_size=1, max_size=5))
def test_numbers_are_read_as_float_reads_them(rows) -> None:
    for form in (repr, "{:.17g}".format, "{:.30e}".format):
        texts = [[form(value) for value in row] for row in rows]
        boxes = parse_boxes("\n".join(map(",".join, texts)))
        assert same_bits(boxes, np.array([[float(text) for text in row] for row in texts]))


# the writer ------------------------------------------------------------------------------------


@given(arrays(np.float64, st.tuples(st.integers(1, 5), st.just(4)), elements=any_float))
def test_what_is_written_reads_back_equal(boxes: np.ndarray) -> None:
    boxes.setflags(write=False)
    assert same_bits(parse_boxes(format_boxes(boxes)), boxes)


@given(any_float.filter(math.isfinite))
def test_no_shorter_text_reads_back_equal(value: float) -> None:
    text = format_boxes(np.full((1, 4), value)).strip().split(",")[0]
    digits = 1
    while float(f"{value:.{digits}g}") != value:
        digits += 1
    shortest = f"{value:.{digits}g}" if value else repr(value)
    # 0 to 16 whole digits are not put in powers of ten: 100, not 1e+02
    assert len(text) <= max(len(shortest), len(f"{value:.0f}") if abs(value) < 1e16 else 0)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (1.0, "1"),
        (-3.0, "-3"),
        (0.5, "0.5"),
        (0.1 + 0.2, "0.30000000000000004"),
        (0.0, "0"),
        (-0.0, "-0.0"),
        (np.nan, "NaN"),
        (np.inf, "inf"),
        (-np.inf, "-inf"),
        (1e300, "1e+300"),
        (1e15, "1000000000000000"),
        (2.1749482695970172e16, "21749482695970172"),
        (1e22, "1e+22"),
    ],
)
def test_forms_of_numbers(value: float, text: str) -> None:
    assert format_boxes(np.array([[value, 1, 2, 3]])) == f"{text},1,2,3\n"


def test_files_are_written_and_read(tmp_path: Path) -> None:
    path = tmp_path / "deep" / "bike1.txt"
    boxes = np.array([[1.5, 2, 3, 4], [np.nan] * 4])
    write_boxes(path, boxes)
    assert path.read_text() == "1.5,2,3,4\nNaN,NaN,NaN,NaN\n"
    np.testing.assert_array_equal(read_boxes(path), boxes)


@pytest.mark.parametrize("wrong", [np.zeros(4), np.zeros((2, 5)), np.zeros((1, 2, 4))])
def test_only_boxes_are_written(tmp_path: Path, wrong: np.ndarray) -> None:
    with pytest.raises(ArrayContract, match=r"shape \(n, 4\)"):
        write_boxes(tmp_path / "bike1.txt", wrong)
    assert not list(tmp_path.iterdir())
