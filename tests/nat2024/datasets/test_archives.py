"""Datasets in a .zip: read in place, and refused where names or sizes are not safe."""

import io
import pickle
import stat
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nat2024 import archives
from nat2024.archives import list_archived, open_archive, read_bytes, split_path
from nat2024.datasets import describe, load_dataset, read_reduced, validate
from nat2024.errors import BoxFileError, DatasetIncomplete, DatasetNotFound, FrameUnreadable


def pack(folder: Path, archive: Path, inside: str = "", **settings: int) -> Path:
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED, **settings) as file:
        for path in sorted(folder.rglob("*")):
            file.write(path, f"{inside}{path.relative_to(folder).as_posix()}")
    return archive


def one_member(path: Path, name: str, data: bytes = b"x", mode: int = 0, **changes: int) -> Path:
    info = zipfile.ZipInfo(name)
    info.filename = name  # ZipInfo would turn the backslashes of some systems
    info.external_attr = mode << 16
    for key, value in changes.items():
        setattr(info, key, value)
    with zipfile.ZipFile(path, "w") as file:
        file.writestr(info, data)
    return path


@pytest.fixture
def folder(tmp_path: Path, make: Callable[..., object]) -> Path:
    folder = make.apart(tmp_path / "Nächte", {"a": 3, "ö1": 2})
    (folder / "data_seq" / "a" / "00002.jpg").write_bytes(make.encoded(seed=7))
    (folder / "data_seq" / "a" / "Thumbs.db").write_bytes(b"stray")
    return folder


@pytest.mark.parametrize("inside", ["", "wrapped/"])
def test_an_archive_is_what_its_folder_is(folder: Path, tmp_path: Path, inside: str) -> None:
    archive = pack(folder, tmp_path / "nights.zip", inside)
    packed, plain = load_dataset(archive), load_dataset(folder)
    assert packed.name == "nights"
    assert [s.name for s in packed] == ["a", "ö1"]
    for one, other in zip(packed, plain, strict=True):
        assert (one.boxes == other.boxes).all()
        assert one.frame_size == other.frame_size == (16, 12)
        for index in range(len(one)):
            assert (one.image(index) == other.image(index)).all()
            small = read_reduced(one.frames, index, 2)
            assert (small == read_reduced(other.frames, index, 2)).all()
    assert not list(tmp_path.glob("nights*/"))  # nothing was extracted
    assert sorted(p.name for p in tmp_path.iterdir()) == ["Nächte", "nights.zip"]
    report = validate(archive, every_frame=True)
    assert (report.name, report.ok, report.frames) == ("nights", True, 5)
    assert describe(archive).frames == 5


def test_frames_of_an_archive_go_to_other_processes(folder: Path, tmp_path: Path) -> None:
    frames = load_dataset(pack(folder, tmp_path / "n.zip"))["a"].frames
    raw = pickle.dumps(frames)
    assert len(raw) < 1000
    assert (pickle.loads(raw)[1] == frames[1]).all()


def test_one_sequence_and_sequences_with_boxes_inside(
    tmp_path: Path, make: Callable[..., object]
) -> None:
    for name in ("x", "y"):
        make.frames(tmp_path / "each" / name / "img", 2)
        make.rows(tmp_path / "each" / name / "groundtruth_rect.txt", 2)
    assert [s.name for s in load_dataset(pack(tmp_path / "each", tmp_path / "e.zip"))] == ["x", "y"]
    dataset = load_dataset(pack(tmp_path / "each" / "x", tmp_path / "one.zip"))
    assert [(len(s), len(s.boxes)) for s in dataset] == [(2, 2)]


def test_an_archive_can_be_the_root_of_a_registered_dataset(
    tmp_path: Path, make: Callable[..., object], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = make.published(tmp_path / "set", "uavdark135", ["bike1", "bike2"])
    archive = pack(folder, tmp_path / "UAVDark135 copy.zip")
    assert [s.name for s in load_dataset("uavdark135", root=archive)] == ["bike1", "bike2"]
    monkeypatch.setenv("NAT2024_ROOT_UAVDARK135", str(archive))
    assert load_dataset("uavdark135").name == "uavdark135"


def test_faults_inside_name_archive_and_member(folder: Path, tmp_path: Path) -> None:
    (folder / "anno" / "a.txt").write_text("1,2,3,4\n1,2,3\n1,2,3,4\n")
    archive = pack(folder, tmp_path / "n.zip")
    with pytest.raises(BoxFileError, match=r"n\.zip/anno/a\.txt, line 2"):
        load_dataset(archive)
    (folder / "anno" / "a.txt").write_text("1,2,3,4\n" * 3)
    (folder / "data_seq" / "a" / "00003.jpg").write_bytes(b"")
    dataset = load_dataset(pack(folder, archive))
    with pytest.raises(FrameUnreadable, match=r"n\.zip/data_seq/a/00003\.jpg \(frame 2.*empty"):
        dataset["a"].image(2)
    archive.unlink()
    with pytest.raises(FrameUnreadable, match=r"00001\.jpg \(frame 0.*: cannot be read"):
        dataset["a"].image(0)


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("../evil.txt", "leads out of its folder"),
        ("data_seq/../../evil.txt", "leads out of its folder"),
        ("data_seq/a/..", "leads out of its folder"),
        ("/etc/passwd", "begins at a root or drive"),
        ("C:/evil.txt", "begins at a root or drive"),
        ("C:evil.txt", "begins at a root or drive"),
        ("//server/share/evil.txt", "begins at a root or drive"),
        ("data_seq\\..\\evil.txt", "a backslash or NUL"),
        ("a\0.jpg", "a backslash or NUL"),
        ("data_seq//a.jpg", "empty parts"),
        ("./a.jpg", "empty parts"),
    ],
)
def test_names_that_are_not_safe_are_refused(tmp_path: Path, name: str, reason: str) -> None:
    archive = one_member(tmp_path / "bad.zip", "MARKER" + "x" * (len(name.encode()) - 6))
    if len(name) < 7:
        archive = one_member(tmp_path / "bad.zip", "y" * len(name))
    stored = zipfile.ZipFile(archive).infolist()[0].filename.encode()
    archive.write_bytes(archive.read_bytes().replace(stored, name.encode()))
    for act in (load_dataset, validate, open_archive):
        with pytest.raises(DatasetIncomplete, match=rf"bad\.zip: refused, member .*: .*{reason}"):
            act(archive)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"mode": stat.S_IFLNK | 0o777}, "a link or special file"),
        ({"mode": stat.S_IFIFO | 0o777}, "a link or special file"),
        ({"compress_type": zipfile.ZIP_BZIP2}, "packed by another method than deflate"),
    ],
)
def test_members_that_are_no_plain_files_are_refused(
    tmp_path: Path, changes: dict[str, int], reason: str
) -> None:
    archive = one_member(tmp_path / "bad.zip", "data_seq/a/1.jpg", b"/etc/passwd", **changes)
    with pytest.raises(DatasetIncomplete, match=rf"refused, member 'data_seq/a/1.jpg': {reason}"):
        load_dataset(archive)


def test_encrypted_and_doubled_members_are_refused(folder: Path, tmp_path: Path) -> None:
    archive = one_member(tmp_path / "e.zip", "a.txt")
    raw = bytearray(archive.read_bytes())
    raw[raw.index(b"PK\x01\x02") + 8] |= 1
    archive.write_bytes(raw)
    with pytest.raises(DatasetIncomplete, match="encrypted"):
        open_archive(archive)
    with zipfile.ZipFile(tmp_path / "d.zip", "w") as file:
        file.writestr("a.txt", "1")
        with pytest.warns(UserWarning, match="Duplicate name"):
            file.writestr("a.txt", "2")
    with pytest.raises(DatasetIncomplete, match=r"'a\.txt': two members of that name"):
        open_archive(tmp_path / "d.zip")


def test_bombs_are_refused_by_their_table_and_by_their_bytes(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (folder / "data_seq" / "a" / "00001.bmp").write_bytes(bytes(2**24 + 1))
    archive = pack(folder, tmp_path / "bomb.zip")
    with pytest.raises(DatasetIncomplete, match=r"00001\.bmp': \d+ bytes that unpack to 16777217"):
        load_dataset(archive)
    # a table that states less than what comes out: no more than that is unpacked
    raw = bytearray(archive.read_bytes())
    entry = raw.rindex(b"PK\x01\x02", 0, raw.rindex(b"00001.bmp"))
    raw[entry + 24 : entry + 28] = (1000).to_bytes(4, "little")
    archive.write_bytes(raw)
    with pytest.raises(OSError, match="damaged in the archive"):
        read_bytes(archive / "data_seq" / "a" / "00001.bmp")
    monkeypatch.setattr(archives, "MAX_MEMBER_BYTES", 100)
    with pytest.raises(DatasetIncomplete, match="that unpack to"):
        open_archive(pack(folder, tmp_path / "large.zip"))


@pytest.mark.parametrize("content", [b"", b"no archive", b"PK\x05\x06" + bytes(10)])
def test_what_is_no_archive_is_one_line(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "x.zip"
    path.write_bytes(content)
    with pytest.raises(DatasetNotFound, match=r"x\.zip: no zip archive, or a damaged one"):
        load_dataset(path)


def test_other_archives_and_empty_ones(tmp_path: Path, make: Callable[..., object]) -> None:
    (tmp_path / "x.tar.gz").write_bytes(b"x")
    with pytest.raises(DatasetNotFound, match=r"a file, but a dataset is a folder .*, a \.zip"):
        load_dataset(tmp_path / "x.tar.gz")
    zipfile.ZipFile(tmp_path / "empty.zip", "w").close()
    with pytest.raises(DatasetNotFound, match=r"empty\.zip: the folder is empty"):
        load_dataset(tmp_path / "empty.zip")
    make.rows(tmp_path / "v" / "anno" / "a.txt", 2)
    (tmp_path / "v" / "data_seq").mkdir()
    (tmp_path / "v" / "data_seq" / "a.mp4").write_bytes(b"x")
    archive = pack(tmp_path / "v", tmp_path / "v.zip")
    with pytest.raises(DatasetIncomplete, match=r"a\.mp4: videos are not read out of an archive"):
        load_dataset(archive)


def test_damaged_members_are_told(folder: Path, tmp_path: Path) -> None:
    archive = pack(folder, tmp_path / "n.zip")
    at = zipfile.ZipFile(archive).getinfo("data_seq/a/00001.jpg").header_offset
    raw = bytearray(archive.read_bytes())
    raw[at + 80] ^= 0xFF
    archive.write_bytes(raw)
    with pytest.raises(FrameUnreadable, match=r"00001\.jpg \(frame 0.*damaged in the archive"):
        load_dataset(archive)["a"].image(0)


def test_a_changed_archive_is_listed_anew(folder: Path, tmp_path: Path) -> None:
    archive = pack(folder, tmp_path / "n.zip")
    assert len(load_dataset(archive)) == 2
    (folder / "anno" / "ö1.txt").unlink()
    pack(folder, archive)
    assert len(load_dataset(archive)) == 1


def test_paths_through_an_archive(folder: Path, tmp_path: Path) -> None:
    archive = pack(folder, tmp_path / "n.zip")
    assert split_path(archive / "anno" / "a.txt") == (archive, "anno/a.txt")
    assert split_path(archive) == (archive, "")
    assert split_path(folder / "anno") is None
    assert list_archived(archive) == (("anno", "data_seq"), ())
    assert list_archived(archive / "data_seq") == (("a", "ö1"), ())
    assert list_archived(archive / "none") is None
    with pytest.raises(FileNotFoundError):
        read_bytes(archive / "anno" / "b.txt")
    with pytest.raises(FileNotFoundError):
        read_bytes(folder / "anno" / "b.txt")


@given(
    st.dictionaries(
        st.from_regex(r"[a-z]{1,3}(/[a-z]{1,3}){0,3}\.jpg", fullmatch=True),
        st.binary(max_size=2000),
        max_size=8,
    ),
    st.booleans(),
)
def test_any_members_come_back(members: dict[str, bytes], deflate: bool) -> None:
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "x.zip"
        method = zipfile.ZIP_DEFLATED if deflate else zipfile.ZIP_STORED
        with zipfile.ZipFile(path, "w", method) as file:
            for name, data in members.items():
                file.writestr(name, data)
        opened = open_archive(path)
        assert {name: opened.read(name) for name in opened.members} == members
        listed = {
            f"{at}/{n}".lstrip("/") for at, (_, files) in opened.folders.items() for n in files
        }
        assert listed == set(members)


@given(st.binary(max_size=400), st.booleans())
def test_any_bytes_are_an_archive_or_an_error_of_ours(data: bytes, real: bool) -> None:
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "x.zip"
        buffer = io.BytesIO()
        with zipfile.ZipFile(buffer, "w") as file:
            file.writestr("a.txt", "1,2,3,4")
        whole = bytearray(buffer.getvalue())
        if real:
            for number, value in enumerate(data[:20]):
                whole[(number * 37 + value) % len(whole)] = value
        path.write_bytes(whole if real else data)
        try:
            opened = open_archive(path)
            assert all(np.isfinite(m.size) for m in opened.members.values())
            for name in opened.members:
                opened.read(name)
        except (DatasetNotFound, DatasetIncomplete, OSError):
            pass
