"""What FFmpeg does not get to see: tables of videos that claim what is not there."""

import struct
from pathlib import Path

import pytest

from nat2024.datasets import video_containers
from nat2024.datasets.video_containers import MOST_SAMPLES, check_container
from nat2024.errors import FrameUnreadable


def box(kind: bytes, *content: bytes, size: int | None = None) -> bytes:
    data = b"".join(content)
    return struct.pack(">I4s", len(data) + 8 if size is None else size, kind) + data


def long_box(kind: bytes, *content: bytes) -> bytes:
    data = b"".join(content)
    return struct.pack(">I4sQ", 1, kind, len(data) + 16) + data


def stsz(count: int, *, each: int = 1) -> bytes:
    return box(b"stsz", struct.pack(">III", 0, each, count))


def trun(count: int) -> bytes:
    return box(b"trun", struct.pack(">II", 0, count))


def movie(*tables: bytes) -> bytes:
    tracks = (box(b"trak", box(b"mdia", box(b"minf", box(b"stbl", t)))) for t in tables)
    return box(b"ftyp", b"isom") + box(b"moov", *tracks)


@pytest.mark.parametrize(
    ("data", "fault"),
    [
        (movie(stsz(MOST_SAMPLES + 1)), "claims 16777217 samples in 72 bytes"),
        (movie(stsz(2**32 - 1, each=0)), "claims 4294967295 samples"),
        (movie(stsz(2**23), stsz(2**23), stsz(1)), "claims 16777217 samples"),
        (movie() + 3 * box(b"moof", box(b"traf", trun(2**23))), "claims 25165824 samples"),
        (movie() + long_box(b"moof", long_box(b"traf", trun(2**31))), "claims 2147483648"),
        (movie() + box(b"moof", box(b"traf", trun(2**31)), size=0), "claims 2147483648"),
        (box(b"free") + box(b"moov", box(b"cmov", b"x")), "its header is compressed"),
    ],
    ids=["one", "sizes", "sum", "fragments", "long", "to the end", "compressed"],
)
def test_tables_that_claim_too_much_are_refused(tmp_path: Path, data: bytes, fault: str) -> None:
    path = tmp_path / "a.mp4"
    path.write_bytes(data)
    with pytest.raises(FrameUnreadable, match=rf"a\.mp4: {fault}.*; get this file again$"):
        check_container(path)


@pytest.mark.parametrize(
    "data",
    [
        movie(stsz(MOST_SAMPLES)),
        movie(stsz(100), stsz(5_000_000)),
        movie() + box(b"mdat", stsz(2**31)),  # what is in the data is no table
        movie() + box(b"moof", b"\0\0\0\3trun"),  # a size that no box can have
        movie() + b"\0\0",
        box(b"moov", b"stsz"),
        b"RIFF\0\0\0\0AVI ",
        b"\x1aE\xdf\xa3",
    ],
    ids=["most", "few", "data", "short box", "cut", "text", "avi", "matroska"],
)
def test_other_files_are_left_to_the_decoder(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "a.mp4"
    path.write_bytes(data)
    check_container(path)


def test_a_large_file_may_have_as_many_samples_as_bytes(tmp_path: Path) -> None:
    path = tmp_path / "a.mp4"
    path.write_bytes(movie(stsz(MOST_SAMPLES + 50)))
    with path.open("r+b") as file:
        file.truncate(MOST_SAMPLES + 100)  # sparse
    check_container(path)


def test_endless_boxes_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(video_containers, "_MOST_BOXES", 10)
    path = tmp_path / "a.mp4"
    path.write_bytes(10 * box(b"free"))
    check_container(path)
    path.write_bytes(11 * box(b"free"))
    with pytest.raises(FrameUnreadable, match="has more than 10 boxes"):
        check_container(path)
    path.write_bytes(2000 * box(b"moov", size=0))  # each within the one before
    with pytest.raises(FrameUnreadable, match="has more than 10 boxes"):
        check_container(path)
