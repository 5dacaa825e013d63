"""TensorFlow checkpoints: read as written, and refused where they are damaged."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from nat2024.errors import NatBenchError, WeightsMismatch, WeightsMissing
from nat2024.zoo.tensorflow import crc32c, read_tensorflow

_SPEC = importlib.util.spec_from_file_location(
    "tensorflow_files", Path(__file__).parents[2] / "data" / "tensorflow_files.py"
)
files = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(files)

ARRAYS = {
    "DecomNet/g_conv1/weights": np.arange(54, dtype=np.float32).reshape(3, 3, 2, 3),
    "DecomNet/g_conv1/biases": np.linspace(-1, 1, 3, dtype=np.float64),
    "global_step": np.array(7, dtype=np.int64),
    "flags": np.array([True, False]),
    "empty": np.zeros((0, 4), np.float32),
    **{f"layer_{n}/kernel": np.full((n, 2), n, np.int32) for n in range(20)},
}


@pytest.fixture
def prefix(tmp_path):
    path = tmp_path / "model.ckpt-7"
    files.write_checkpoint(path, ARRAYS)
    return path


@pytest.mark.parametrize("suffix", ["", ".index"])
def test_arrays_come_back_as_they_were_written(prefix, suffix):
    found = read_tensorflow(str(prefix) + suffix)
    assert found.keys() == ARRAYS.keys()
    for name, array in ARRAYS.items():
        assert found[name].dtype == array.dtype
        np.testing.assert_array_equal(found[name], array)


def test_checksum_is_castagnolis():
    assert crc32c(b"123456789") == 0xE3069283  # the check value of its definition
    assert crc32c(b"") == 0
    random = np.random.Generator(np.random.PCG64(0))
    for size in (1, 4096, 65536, 70001):  # the last two are summed in lanes
        data = random.bytes(size)
        assert crc32c(data) == files.crc32c(data)


def test_absent_files_are_named(tmp_path, prefix):
    with pytest.raises(WeightsMissing, match=r"other.index: no such file"):
        read_tensorflow(tmp_path / "other")
    data = prefix.with_name(prefix.name + ".data-00000-of-00001")
    data.unlink()
    with pytest.raises(WeightsMissing, match="it holds the numbers of"):
        read_tensorflow(prefix)


def test_damaged_numbers_are_noticed(prefix):
    data = prefix.with_name(prefix.name + ".data-00000-of-00001")
    raw = bytearray(data.read_bytes())
    raw[20] ^= 1
    data.write_bytes(raw)
    with pytest.raises(WeightsMismatch, match=r"the bytes of a tensor of shape .* are damaged"):
        read_tensorflow(prefix)
    data.write_bytes(raw[:-8])
    with pytest.raises(WeightsMismatch):
        read_tensorflow(prefix)


@pytest.mark.parametrize("content", [b"", b"x" * 47, b"x" * 500, b"PK\x03\x04" + bytes(300)])
def test_other_files_are_refused(tmp_path, content):
    path = tmp_path / "other.index"
    path.write_bytes(content)
    with pytest.raises(WeightsMismatch, match="does not end as such an index does"):
        read_tensorflow(path)


def test_impossible_sizes_are_refused_before_anything_is_read(tmp_path):
    entry = b"\x08\x01\x12\x0a\x12\x08\x08" + files.varint(1 << 45)
    entry = entry[:3] + bytes([len(entry) - 4]) + entry[4:]
    entries = files.block_of([(b"", b"\x08\x01"), (b"huge", entry)])
    table = entries + b"\0" + files.masked(entries + b"\0").to_bytes(4, "little")
    handle = files.block_of([(b"huge", files.varint(0) + files.varint(len(entries)))])
    start = len(table)
    table += handle + b"\0" + files.masked(handle + b"\0").to_bytes(4, "little")
    footer = b"\0\0" + files.varint(start) + files.varint(len(handle))
    table += footer.ljust(40, b"\0") + (0xDB4775248B80FB57).to_bytes(8, "little")
    (tmp_path / "huge.index").write_bytes(table)
    with pytest.raises(WeightsMismatch, match="not a readable TensorFlow checkpoint"):
        read_tensorflow(tmp_path / "huge")


@settings(
    max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(data=st.data())
def test_garbage_is_an_error_of_one_line_or_leaves_the_numbers_alone(prefix, data):
    index = prefix.with_name(prefix.name + ".index")
    kept = index.read_bytes()
    raw = bytearray(kept)
    for _ in range(data.draw(st.integers(1, 4))):
        raw[data.draw(st.integers(0, len(raw) - 1))] = data.draw(st.integers(0, 255))
    raw = raw[: data.draw(st.sampled_from([len(raw), len(raw) // 2, len(raw) - 1, 60]))]
    index.write_bytes(raw)
    message, found = "", {}
    try:
        found = read_tensorflow(prefix)
    except NatBenchError as error:
        message = str(error)
    finally:
        index.write_bytes(kept)
    assert "\n" not in message
    for name, array in found.items():
        np.testing.assert_array_equal(array, ARRAYS[name])
