"""What people's folders look like on a bad day: each case is one clear line, or harmless."""

import os
import struct
import zlib
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from nat2024.cli import run as nat_bench
from nat2024.datasets import load_dataset, read_reduced, validate
from nat2024.datasets.decoding import MAX_PIXELS, decode_image
from nat2024.datasets.frames import same_number
from nat2024.errors import (
    BoxFileError,
    DatasetIncomplete,
    DatasetNotFound,
    FrameUnreadable,
    UsageError,
)


@pytest.fixture
def root(tmp_path: Path, make: Callable[..., object]) -> Path:
    """Two sequences, `a` of 4 frames and `b` of 2."""
    return make.apart(tmp_path / "set", {"a": 4, "b": 2})


def only_problem(root: Path, **settings: bool) -> str:
    (problem,) = validate(root, **settings).problems
    assert "\n" not in problem.message
    return problem.message


def test_stray_files_and_folders_are_ignored(root: Path) -> None:
    for place in (root, root / "data_seq", root / "data_seq" / "a", root / "anno"):
        (place / "Thumbs.db").write_bytes(b"x")
        (place / "readme.txt").write_text("hello")
        (place / "._00001.jpg").write_bytes(b"x")
    (root / "data_seq" / "a" / "extra").mkdir()
    assert [len(s) for s in load_dataset(root)] == [4, 2]
    assert validate(root, every_frame=True).ok


@pytest.mark.parametrize("name", ["2.jpg", "00002.png", "000002.JPG"])
def test_two_images_of_one_number_are_named(
    root: Path, make: Callable[..., object], name: str
) -> None:
    (root / "data_seq" / "a" / name).write_bytes(make.encoded())
    with pytest.raises(DatasetIncomplete) as caught:
        load_dataset(root)
    for part in ("00002.jpg", name, "have the same number; remove one of them"):
        assert part in str(caught.value)
    assert "lenient" not in str(caught.value)
    assert name in only_problem(root)


@pytest.mark.parametrize(
    ("names", "twice"),
    [
        ((), None),
        (("a.jpg",), None),
        (("1.jpg", "2.jpg", "10.jpg"), None),
        (("img1_1.jpg", "img1_10.jpg"), None),
        (("f1.png", "f01.png"), ("f1.png", "f01.png")),
        (("cover.jpg", "cover.png"), ("cover.jpg", "cover.png")),
    ],
)
def test_names_of_one_number(names: tuple[str, ...], twice: tuple[str, str] | None) -> None:
    assert same_number(names) == twice


def test_frames_of_several_sizes(root: Path, make: Callable[..., object]) -> None:
    for number in (2, 4):
        image = cv2.imencode(".jpg", make.image(size=(20, 10)))[1].tobytes()
        (root / "data_seq" / "a" / f"{number:05d}.jpg").write_bytes(image)
    assert only_problem(root) == (
        "a: frames of several sizes: 00002.jpg is 20x10, the first frame 16x12; "
        "2 of 4 differ from it"
    )
    assert load_dataset(root)["a"].image(1).shape == (10, 20, 3)  # trackers get what is there


def test_boxes_outside_the_image_nan_and_no_size_are_noted(
    root: Path, make: Callable[..., object]
) -> None:
    make.rows(root / "anno" / "a.txt", [(1, 2, 3, 4), (16, 0, 3, 4), (-9, 0, 9, 4), (-1, 0, 3, 3)])
    (root / "anno" / "b.txt").write_text("1,2,0,4\nNaN,NaN,NaN,NaN\n")
    report = validate(root)
    assert report.ok
    assert report.notes == (
        "a: 2 frames with a box wholly outside the image: 1-2 (counted from 0)",
        "b: 1 frames without a finite box, the target counts as absent: 1 (counted from 0)",
        "b: 1 frames with a box of width or height 0 or below: 0 (counted from 0)",
    )
    assert len(load_dataset(root)) == 2


def test_many_remarkable_rows_are_one_line(tmp_path: Path, make: Callable[..., object]) -> None:
    make.apart(tmp_path / "set", {"a": 40})
    rows = [(0, 0, number % 2, 5) for number in range(40)]
    make.rows(tmp_path / "set" / "anno" / "a.txt", rows)
    (note,) = validate(tmp_path / "set").notes
    assert note.endswith(": 0, 2, 4, 6, 8, 10, 12, 14 and 12 more (counted from 0)")


@pytest.mark.parametrize(
    ("text", "error", "message"),
    [
        ("1,2,3,4\n" * 5, DatasetIncomplete, "a: 5 boxes in .*a.txt but 4 images"),
        ("1,2,3,4\n1,2,x,4\n", BoxFileError, r"a\.txt, line 2"),
        ("", BoxFileError, r"a\.txt: no boxes in it"),
    ],
)
def test_wrong_counts_and_rows(root: Path, text: str, error: type[Exception], message: str) -> None:
    (root / "anno" / "a.txt").write_text(text)
    with pytest.raises(error, match=message):
        load_dataset(root)


def test_names_in_any_script(tmp_path: Path, make: Callable[..., object]) -> None:
    root = make.apart(tmp_path / "Наборы 夜", {"ночь": 2, "夜间行人": 2, "café": 1})
    dataset = load_dataset(root)
    assert sorted(s.name for s in dataset) == sorted(["ночь", "夜间行人", "café"])
    assert dataset["夜间行人"].image(1).shape == (12, 16, 3)
    assert validate(root, every_frame=True).ok


def link(path: Path, target: Path) -> None:
    path.unlink(missing_ok=True)
    path.symlink_to(target)


def test_a_frame_that_is_a_link_out_is_refused(root: Path, tmp_path: Path) -> None:
    outside = tmp_path / "outside.jpg"
    outside.write_bytes((root / "data_seq" / "a" / "00001.jpg").read_bytes())
    link(root / "data_seq" / "a" / "00003.jpg", outside)
    with pytest.raises(DatasetIncomplete) as caught:
        load_dataset(root)
    expected = f"00003.jpg is a link out of the dataset folder, to {outside}; put the file itself"
    assert expected in str(caught.value)
    assert expected in only_problem(root)
    link(root / "data_seq" / "a" / "00003.jpg", Path("../b/00001.jpg"))
    assert len(load_dataset(root)["a"]) == 4  # within the dataset


@pytest.mark.parametrize("name", ["anno/a.txt", "data_seq/a/absence.label"])
def test_an_annotation_that_is_a_link_out_is_refused(root: Path, tmp_path: Path, name: str) -> None:
    (tmp_path / "secret").write_text("1,2,3,4\n" * 4)
    link(root / name, tmp_path / "secret")
    with pytest.raises(DatasetIncomplete, match="is a link out of the dataset folder"):
        load_dataset(root)


def test_a_pipe_is_no_frame(root: Path) -> None:
    os.mkfifo(root / "data_seq" / "a" / "00005.jpg")  # to read it would wait for ever
    with pytest.raises(DatasetIncomplete, match=r"00005\.jpg is no file but a device or pipe"):
        load_dataset(root)


def test_a_link_to_nothing_is_a_frame_that_cannot_be_read(root: Path) -> None:
    link(root / "data_seq" / "a" / "00002.jpg", Path("gone.jpg"))
    with pytest.raises(FrameUnreadable, match=r"00002\.jpg \(frame 1.*: cannot be read"):
        load_dataset(root)["a"].image(1)


def test_folders_may_be_links(root: Path, tmp_path: Path) -> None:
    (root / "data_seq").rename(tmp_path / "disk")
    (root / "data_seq").symlink_to(tmp_path / "disk")
    (tmp_path / "disk" / "a").rename(tmp_path / "a of another disk")
    (tmp_path / "disk" / "a").symlink_to(tmp_path / "a of another disk")
    link(tmp_path / "a of another disk" / "00002.jpg", Path("00001.jpg"))
    (tmp_path / "here").symlink_to(root)
    dataset = load_dataset(tmp_path / "here")
    assert [len(s) for s in dataset] == [4, 2]
    assert dataset["a"].image(1).shape == (12, 16, 3)


def test_links_in_circles_are_no_folders(root: Path) -> None:
    (root / "data_seq" / "loop").symlink_to("loop")
    assert [s.name for s in load_dataset(root)] == ["a", "b"]


def _png(width: int, height: int) -> bytes:
    def chunk(kind: bytes, body: bytes) -> bytes:
        crc = zlib.crc32(kind + body)
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", crc)

    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    parts = chunk(b"IHDR", head), chunk(b"IDAT", zlib.compress(bytes(99))), chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + b"".join(parts)


def _bmp(width: int, height: int, *, old: bool = False) -> bytes:
    header = struct.pack("<IHHHH", 12, width & 0xFFFF, height & 0xFFFF, 1, 24)
    if not old:
        header = struct.pack("<IiiHHIIiiII", 40, width, height, 1, 24, 0, 0, 0, 0, 0, 0)
    body = header + bytes(100)
    return b"BM" + struct.pack("<IHHI", 14 + len(body), 0, 0, 14 + len(header)) + body


def _jpeg(data: bytes, width: int, height: int) -> bytes:
    at = data.index(b"\xff\xc0")
    return data[: at + 5] + struct.pack(">HH", height, width) + data[at + 9 :]


@pytest.mark.parametrize("kind", ["png", "bmp", "bmp upside down", "old bmp", "jpeg"])
def test_an_image_of_vast_claims_is_refused_before_it_is_decoded(
    root: Path, make: Callable[..., object], monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    size = (65500, 65500) if kind in ("jpeg", "old bmp") else (100_000, 100_000)
    data = {
        "png": _png(*size),
        "bmp": _bmp(*size),
        "bmp upside down": _bmp(size[0], -size[1]),
        "old bmp": _bmp(*size, old=True),
        "jpeg": _jpeg(make.encoded(), 65500, 65500),
    }[kind]
    (root / "data_seq" / "a" / "00001.jpg").write_bytes(data)
    claim = f"claims {size[0]} x {size[1]} pixels, more than the {MAX_PIXELS} that are decoded"

    def decode(*_: object) -> None:
        pytest.fail("it was decoded")

    monkeypatch.setattr(cv2, "imdecode", decode)
    sequence = load_dataset(root)["a"]
    for act in (
        lambda: sequence.image(0),
        lambda: sequence.frame_size,
        lambda: read_reduced(sequence.frames, 0, 8),
    ):
        with pytest.raises(FrameUnreadable, match=claim):
            act()
    monkeypatch.undo()
    assert claim in only_problem(root)


def test_files_in_formats_without_a_known_limit_are_refused(make: Callable[..., object]) -> None:
    tiff = cv2.imencode(".tiff", make.image())[1].tobytes()
    with pytest.raises(FrameUnreadable, match="no JPEG, PNG or BMP image"):
        decode_image(tiff, "x.jpg")


@pytest.mark.parametrize("extension", [".jpg", ".png", ".bmp"])
@pytest.mark.parametrize("reduction", [1, 2, 4, 8])
def test_reduced_decoding(tmp_path: Path, extension: str, reduction: int) -> None:
    wide = cv2.GaussianBlur(
        np.random.default_rng(0).integers(0, 256, (45, 70, 3), dtype=np.uint8), (0, 0), 6
    )
    (tmp_path / "1").mkdir()
    (tmp_path / "1" / f"1{extension}").write_bytes(cv2.imencode(extension, wide)[1].tobytes())
    sequence = load_dataset(tmp_path, unannotated=True)["1"]
    small = read_reduced(sequence.frames, 0, reduction)
    assert small.dtype == np.uint8
    assert small.shape == (-(-45 // reduction), -(-70 // reduction), 3)
    plain = read_reduced([sequence.image(0)], 0, reduction)  # no source of its own way
    assert plain.shape == small.shape
    assert np.abs(plain.astype(int) - small).mean() < 4
    assert reduction > 1 or (small == sequence.image(0)).all()


@pytest.mark.parametrize("reduction", [0, 3, 16, -2])
def test_other_reductions(root: Path, reduction: int) -> None:
    frames = load_dataset(root)["a"].frames
    for source in (frames, [frames[0]]):
        with pytest.raises(UsageError, match=f"reduction {reduction} is none of 1, 2, 4, 8"):
            read_reduced(source, 0, reduction)


def test_the_command_line_says_each_in_one_line(
    root: Path, make: Callable[..., object], capsys: pytest.CaptureFixture[str]
) -> None:
    (root / "data_seq" / "a" / "2.jpg").write_bytes(make.encoded())
    (root / "data_seq" / "b" / "00001.jpg").write_bytes(_png(100_000, 100_000))
    assert nat_bench(["dataset", "validate", str(root)]) == 1
    printed = capsys.readouterr()
    assert "images 00002.jpg and 2.jpg in" in printed.out
    assert "claims 100000 x 100000 pixels" in printed.out
    assert nat_bench(["run", "--tracker", "mil", "--dataset", str(root)]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_a_folder_without_permission(root: Path, tmp_path: Path) -> None:
    if os.geteuid() == 0:
        pytest.skip("root may read everything")
    (root / "data_seq" / "a").chmod(0)
    try:
        with pytest.raises(DatasetNotFound, match="cannot be listed"):
            load_dataset(root)
    finally:
        (root / "data_seq" / "a").chmod(0o755)
