"""What fuzzing found in files of results, archives and checkpoints, one test a fault."""

import contextlib
import io
import json
import pickle
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest
import torch

from benchmarks.fuzz import seeds
from nat2024 import archives, keeping
from nat2024.datasets.decoding import decode_image
from nat2024.datasets.file_names import is_plain_name
from nat2024.datasets.roots import read_configuration
from nat2024.errors import (
    AnnotationInvalid,
    BoxFileError,
    DatasetIncomplete,
    DatasetNotFound,
    FrameUnreadable,
    NatBenchError,
    ResultConflict,
    UsageError,
    WeightsMismatch,
)
from nat2024.importing.bundles import find as find_bundle
from nat2024.importing.matlab_elements import plain_elements
from nat2024.importing.tree import open_folder
from nat2024.store import RunFolder
from nat2024.zoo.checkpoints import read_checkpoint
from nat2024.zoo.registered import read_record

BAD_JSON = [seeds.deep_json("options"), b'{"dataset":{"name":"\xff"}}', b"\xff"]


def write(path: Path, data: bytes) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)
    return path


@pytest.mark.parametrize("raw", BAD_JSON, ids=["deep", "no UTF-8", "bytes"])
def test_json_of_strangers_is_one_line(raw: bytes, tmp_path: Path) -> None:
    write(tmp_path / "run" / "run.json", raw)
    with pytest.raises(ResultConflict, match="not a manifest"):
        RunFolder(tmp_path / "run").manifest()
    (tmp_path / "bundle" / "boxes").mkdir(parents=True)
    write(tmp_path / "bundle" / "manifest.json", raw)
    with pytest.raises(BoxFileError, match="no manifest of a bundle"):
        find_bundle(open_folder(tmp_path / "bundle"))
    with pytest.raises(WeightsMismatch, match="not a record"):
        read_record(write(tmp_path / "gamma" / "default.json", raw))


@pytest.mark.parametrize("raw", [b"root = " + b"[" * 20_000, b"root = \xff", b"a = " + b"9" * 5000])
def test_configuration_is_one_line(
    raw: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NAT2024_CONFIG", str(write(tmp_path / "config.toml", raw)))
    with pytest.raises(UsageError, match="config"):
        read_configuration()


@pytest.mark.parametrize(
    "raw", [seeds.deep_json("format"), b'{"format":"\xff"}'], ids=["deep", "no UTF-8"]
)
def test_side_files_are_one_line(raw: bytes, tmp_path: Path) -> None:
    import nat2024

    frame = seeds.png(3, 3)
    write(tmp_path / "car1" / "1.png", frame)
    write(tmp_path / "nat-bench-extra.json", raw)
    with pytest.raises(AnnotationInvalid, match="no valid JSON"):
        nat2024.load_dataset(str(tmp_path))


def test_kept_values_of_endless_nesting_are_as_none(tmp_path: Path) -> None:
    import hashlib

    raw = b"\x81\xa1k" + b"\x91" * 20_000 + b"\xc0"
    path = write(tmp_path / "a.msgpack", hashlib.sha256(raw).digest()[:16] + raw)
    assert keeping.Keeper(path, most_unused=1).get("k", list) is None


def test_times_that_are_no_text_and_skipped_frames_that_are_not_there(tmp_path: Path) -> None:
    run = RunFolder(tmp_path)
    write(tmp_path / "a.txt", b"1,2,3,4\n")
    write(tmp_path / "time" / "a.csv", b"read,enhance,track\n1,2,3\n4,5,6\n")
    write(tmp_path / "skipped" / "a.csv", b"99\n-1\n")
    found = run.stage_times()
    assert found is not None
    assert found.frames == 2
    write(tmp_path / "skipped" / "a.csv", b"0\n1\n")  # all of them
    assert run.stage_times() is None
    write(tmp_path / "time" / "a.csv", b"\xff\n1,\xfe,3\n")
    with pytest.raises(BoxFileError, match="UTF-8"):
        run.stage_times()


def changed(raw: bytes, mark: bytes, place: int, value: int) -> bytes:
    """A number of four bytes behind the last `mark` set to something else."""
    begin = raw.rfind(mark) + place
    return raw[:begin] + struct.pack("<I", value) + raw[begin + 4 :]


@pytest.mark.parametrize("place", [20, 42], ids=["packed size", "offset"])
def test_archives_that_lie_about_places_and_sizes(place: int, tmp_path: Path) -> None:
    raw = changed(seeds.archive({"T/a.txt": b"1,2,3,4\n"}), b"PK\1\2", place, 0x7FFFFFF0)
    path = write(tmp_path / "lie.zip", raw)
    with pytest.raises(OSError, match="damaged in the archive"):  # and no room made for 2 GiB
        archives.read_bytes(path / "T" / "a.txt")


def test_archives_whose_first_member_lies_before_the_file(tmp_path: Path) -> None:
    raw = changed(seeds.archive({"a.txt": b"1\n"}), b"PK\5\6", 16, 0xFF)
    with pytest.raises(DatasetIncomplete, match="before the beginning"):
        archives.open_archive(write(tmp_path / "lie.zip", raw))


def test_vast_tables_of_contents(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(archives, "MAX_CONTENTS_BYTES", 2**10)
    raw = seeds.archive({f"T/{number}.txt": b"" for number in range(100)})
    with pytest.raises(DatasetNotFound, match="table of contents"):
        archives.open_archive(write(tmp_path / "vast.zip", raw))


@pytest.mark.parametrize("name", ["a/C:x.txt", "C:/x.txt", "a/../x.txt", "/x.txt", "a\\x.txt"])
def test_names_in_archives_lead_nowhere(name: str, tmp_path: Path) -> None:
    with pytest.raises(DatasetIncomplete, match="refused"):
        archives.open_archive(write(tmp_path / "names.zip", seeds.archive({name: b"1"})))


@pytest.mark.parametrize("name", ["../x", "C:x", "a\\b", ""])
def test_exports_never_leave_their_folder(name: str, tmp_path: Path) -> None:
    from nat2024.exporting import export_results

    write(tmp_path / "in" / "T" / "a.txt", b"1,2,3,4\n")
    manifest = {"dataset": {"name": name}, "tracker": {"name": "t"}}
    write(tmp_path / "in" / "T" / "run.json", json.dumps(manifest).encode())
    with pytest.raises(ResultConflict, match="no name of a folder"):
        export_results(tmp_path / "in", "nat-bench", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_names_of_endless_folders(tmp_path: Path) -> None:
    raw = seeds.archive({"a/" * 20_000 + "x.txt": b""})  # would be 400 MB of folder names
    with pytest.raises(DatasetIncomplete, match="32 folders deep") as caught:
        archives.open_archive(write(tmp_path / "deep.zip", raw))
    assert len(str(caught.value)) < 300


@pytest.mark.parametrize("place", range(0, 272, 4))
def test_numbers_of_matlab_files_that_lie(place: int) -> None:
    """scipy crashes the process on some of them; what passes here must still be well-formed."""
    plain = seeds.matlab_result()
    for value in (0, 9, 255, 2**31 - 1):
        raw = plain[:place] + struct.pack("<I", value) + plain[place + 4 :]
        try:
            checked = plain_elements(seeds.matlab_file(raw), Path("a.mat"))
        except BoxFileError as error:
            assert "a damaged one" in str(error)  # noqa: PT017 - some are harmless
        else:
            read_matlab(checked)


def read_matlab(raw: bytes) -> object:
    from scipy.io import loadmat

    with contextlib.suppress(Exception):
        return loadmat(io.BytesIO(raw), squeeze_me=True, struct_as_record=False)
    return None


def test_matlab_results_pass_unpacked() -> None:
    plain = seeds.matlab_file(seeds.matlab_result())
    packed = seeds.matlab_file(seeds.matlab_result(), packed=True)
    assert plain_elements(plain, Path("a.mat")) == plain
    assert plain_elements(packed, Path("a.mat")) == plain


def _nested(depth: int) -> bytes:
    inner = seeds.matlab_array(6, (1, 1), b"", seeds.matlab_element(9, bytes(8)))
    for left in range(depth, 0, -1):
        inner = seeds.matlab_array(1, (1, 1), b"results" if left == 1 else b"", inner)
    return inner


@pytest.mark.parametrize(
    ("element", "words"),
    [
        (seeds.matlab_array(1, (2**16, 2**14), b"results", b""), "65536x16384"),
        (seeds.matlab_array(1, (-(2**16), -(2**14)), b"results", b""), "-65536x-16384"),
        (seeds.matlab_array(6, (2**20, 4), b"r", seeds.matlab_element(9, bytes(2**25))), "unpacks"),
        (_nested(1100), "arrays"),
    ],
    ids=["claimed", "negative", "bomb", "nested"],
)
def test_matlab_files_that_would_take_all_memory(element: bytes, words: str) -> None:
    raw = seeds.matlab_file(element, packed=True)
    assert len(raw) < 100_000
    with pytest.raises(BoxFileError, match=words):
        plain_elements(raw, Path("a.mat"))


def test_packed_checkpoints_are_refused(tmp_path: Path) -> None:
    plain = zipfile.ZipFile(io.BytesIO(seeds.pytorch()))
    with zipfile.ZipFile(tmp_path / "bomb.pth", "w", zipfile.ZIP_DEFLATED) as packed:
        for name in plain.namelist():
            packed.writestr(name, plain.read(name))
    with pytest.raises(WeightsMismatch, match="is packed"):
        read_checkpoint(tmp_path / "bomb.pth")


class _Runs:
    """A pickle of this calls whatever it is given."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[object, ...]:
        return Path.touch, (self.path,)


@pytest.mark.parametrize("old", [False, True])
def test_pickles_never_execute(old: bool, tmp_path: Path) -> None:
    content = {"state_dict": {"a": torch.ones(1)}, "note": _Runs(tmp_path / "hit")}
    path = tmp_path / "evil.pth"
    torch.save(content, path, _use_new_zipfile_serialization=not old)
    with pytest.raises(WeightsMismatch, match="more than tensors"):
        read_checkpoint(path)
    assert not (tmp_path / "hit").exists()


def test_numbers_of_numpy_are_read_without_numpy(tmp_path: Path) -> None:
    """Official files keep such in their optimizer state; a forged descriptor crashes numpy."""
    path = tmp_path / "official.pth"
    numbers = [np.float64(0.5), np.float32(2), np.int64(7), np.bool_(True)]
    torch.save({"state_dict": {"a": torch.ones(1)}, "numbers": numbers}, path)
    assert list(read_checkpoint(path)) == ["a"]


def test_forged_descriptors_of_numpy_do_nothing(tmp_path: Path) -> None:
    class Forged:
        def __reduce__(self) -> tuple[object, ...]:
            objects = np.dtype("f8"), (4,)  # numpy would read beyond the number's end
            return np.dtype, (">f8",), (3, ">", objects, None, None, -1, -1, 0)

    class Number:
        def __reduce__(self) -> tuple[object, ...]:
            from numpy._core.multiarray import scalar

            return scalar, (Forged(), b"A" * 8)

    path = tmp_path / "forged.pth"
    torch.save({"state_dict": {"a": torch.ones(1)}, "numbers": Number()}, path)
    with pytest.raises(WeightsMismatch):
        read_checkpoint(path)


def test_headers_of_safetensors_that_lie(tmp_path: Path) -> None:
    for raw in (
        struct.pack("<Q", 2**62) + b"{}",
        seeds.safetensors().replace(b"[0, 8]", b"[0,9]"),
        seeds.safetensors().replace(b"[2]", b"[9]"),
        seeds.safetensors()[:-1],
    ):
        with pytest.raises(WeightsMismatch, match="safetensors"):
            read_checkpoint(write(tmp_path / "a.safetensors", raw))


@pytest.mark.parametrize("size", [(50_000, 50_000), (2**31 - 1, 1), (2**32 - 1, 2**32 - 1)])
def test_images_that_claim_to_be_vast(size: tuple[int, int]) -> None:
    with pytest.raises(FrameUnreadable, match="claims"):
        decode_image(seeds.png(*size), "frame")


@pytest.mark.parametrize(
    "name", ["", ".", "..", "../a", "a/b", "a\\b", "/a", "C:a", "a\0", "a\x1b[2J", "\u202ea", ".a"]
)
def test_names_never_lead_anywhere(name: str) -> None:
    assert not is_plain_name(name)


@pytest.mark.parametrize("name", ["con", "NUL", "aux.txt", "Com1", "lpt9.a.b", "prn .x", "a" * 300])
def test_names_never_are_devices_or_endless(name: str) -> None:
    assert not is_plain_name(name)


@pytest.mark.parametrize("name", ["console", "person_9", "null1", "com10", "Auxiliary", "夜"])
def test_other_names_stay(name: str) -> None:
    assert is_plain_name(name)


def test_an_index_cannot_name_a_sequence_out_of_its_folder(tmp_path: Path) -> None:
    import nat2024

    text = seeds.seeds_of("index")[0]
    for name in (b"../../x", b"/tmp/x", b"nul", b"a\\\\..\\\\b"):
        write(
            tmp_path / "nat-bench.json", text.replace(b'"car1", "frames"', b'"%s", "frames"' % name)
        )
        with pytest.raises(AnnotationInvalid, match="cannot be the name of a sequence"):
            nat2024.load_dataset(str(tmp_path))


def test_pickled_results_are_not_opened(tmp_path: Path) -> None:
    from nat2024.store import dataset_folder

    write(tmp_path / "a.pkl", pickle.dumps(_Runs(tmp_path / "hit")))
    with pytest.raises(NatBenchError, match="never opened"):
        dataset_folder(tmp_path, "night")
    assert not (tmp_path / "hit").exists()
