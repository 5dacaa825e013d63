"""Well-formed files of every kind to begin from; small, made here, equal in every run."""

import functools
import importlib.util
import io
import json
import struct
import tempfile
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

_MANIFEST = {
    "dataset": {"name": "night"},
    "tracker": {"name": "t", "options": {"a": [1, "x", None, {"b": 2.5}]}},
    "starts": {"a": "0"},
    "skipped_frames": {"a": [1]},
    "failures": {"b": "why"},
}
_INDEX = {
    "schema": "nat-bench/1",
    "name": "night",
    "sequences": [
        {
            "name": "car1",
            "frames": {"folder": "car1", "count": 2, "pattern": "%08d.jpg"},
            "boxes": [[1, 2, 3, 4], [5, 6.5, 7, None]],
            "fps": 30.0,
        }
    ],
}
_NAMES = ["car1/00000001.jpg", "car1/00000002.jpg"]
_PYSOT = {"car1": {"img_names": _NAMES, "gt_rect": [[1, 2, 3, 4], [5, 6, 7, 8]], "attr": ["FM"]}}
_COCO = {
    "info": {},
    "videos": [{"id": 1, "name": "car1"}],
    "images": [
        {"id": n, "file_name": name, "video_id": 1, "frame_id": n, "width": 8, "height": 8}
        for n, name in enumerate(_NAMES)
    ],
    "annotations": [
        {"id": 1, "image_id": 1, "video_id": 1, "category_id": 1, "bbox": [1, 2, 3, 4]}
    ],
    "categories": [{"id": 1, "name": "car"}],
}
_RECORD = {
    "plugin": "gamma",
    "options": {},
    "source": "a.pth",
    "source_sha256": "0",
    "file": "default-000000000000.safetensors",
    "form": "copy",
    "sha256": "0",
    "bytes": 1,
}
_TEXT = b"1,2,3,4\n5.5\t6 7;8\n"
_DEEP = 20_000
MUCH = 2**28
"""Samples that greedy videos claim: 6 GB of FFmpeg's memory."""


def _json(value: object) -> bytes:
    return json.dumps(value).encode()


def deep_json(key: str = "tracker") -> bytes:
    """Nesting that no recursive reader can follow."""
    return b'{"%s":' % key.encode() + b"[" * _DEEP + b"]" * _DEEP + b"}"


def matlab_element(kind: int, data: bytes) -> bytes:
    """One element of a MATLAB 5 file."""
    return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)


def matlab_array(kind: int, shape: tuple[int, int], name: bytes, content: bytes) -> bytes:
    """One array of a MATLAB 5 file: 1 is a cell, 2 a struct, 4 text, 6 float64."""
    head = matlab_element(6, struct.pack("<II", kind, 0))
    head += matlab_element(5, struct.pack("<ii", *shape)) + matlab_element(1, name)
    return matlab_element(14, head + content)


def matlab_file(*elements: bytes, packed: bool = False) -> bytes:
    """A MATLAB 5 file."""
    if packed:
        squeezed = [zlib.compress(element) for element in elements]
        elements = tuple(struct.pack("<II", 15, len(data)) + data for data in squeezed)
    head = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<HH", 0x0100, 0x4D49)
    return head + b"".join(elements)


def matlab_result() -> bytes:
    """A struct `results` with two boxes, as the MATLAB benchmarks write it."""
    rows = matlab_element(9, struct.pack("<8d", 1, 5, 2, 6, 3, 7, 4, 8))
    fields = matlab_element(5, struct.pack("<i", 8)) + matlab_element(
        1, b"res\0\0\0\0\0type\0\0\0\0"
    )
    fields += matlab_array(6, (2, 4), b"", rows)
    fields += matlab_array(4, (1, 4), b"", matlab_element(16, b"rect"))
    return matlab_array(2, (1, 1), b"results", fields)


def archive(members: dict[str, bytes]) -> bytes:
    """A .zip archive."""
    raw = io.BytesIO()
    with zipfile.ZipFile(raw, "w", zipfile.ZIP_DEFLATED) as written:
        for name, data in members.items():
            written.writestr(zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0)), data)
    return raw.getvalue()


def png(width: int, height: int, data: bytes = bytes(30)) -> bytes:
    """A PNG file whose header may claim anything."""

    def chunk(kind: bytes, body: bytes) -> bytes:
        return (
            struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
        )

    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    body = chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(data)) + chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + body


def bitmap() -> bytes:
    """A BMP file of 2 x 2 pixels."""
    return (
        b"BM" + struct.pack("<IHHI", 70, 0, 0, 54)
        + struct.pack("<IiiHHIIiiII", 40, 2, 2, 1, 24, 0, 16, 0, 0, 0, 0) + bytes(16)
    )  # fmt: skip


def encoded(ending: str, *options: int) -> bytes:
    """An image file of 9 x 8 pixels that OpenCV writes: a ramp, so that its data is not trivial."""
    import cv2
    import numpy as np

    ramp = np.arange(9 * 8 * 3, dtype=np.uint8).reshape(8, 9, 3)
    return bytes(cv2.imencode(ending, ramp, options)[1])


def images() -> tuple[bytes, ...]:
    """Image files of each kind that is decoded, two that claim too much, one that is cut."""
    import cv2

    return (
        png(3, 3),
        png(50_000, 50_000),
        bitmap(),
        encoded(".jpg"),
        encoded(".jpg", cv2.IMWRITE_JPEG_PROGRESSIVE, 1, cv2.IMWRITE_JPEG_RST_INTERVAL, 1),
        encoded(".png"),
        encoded(".webp"),
        encoded(".webp", cv2.IMWRITE_WEBP_QUALITY, 101),
        b"RIFF\x10\0\0\0WEBPVP8 ",
    )


@functools.cache
def videos() -> tuple[bytes, ...]:
    """Videos of 4 frames of 32 x 32 pixels: VP8, Motion JPEG, MPEG-4, FFV1, and H.264 if there."""
    from nat2024.datasets.mp4_writing import Mp4File
    from nat2024.datasets.video_writing import VideoFile

    found = [_video(".webm", VideoFile)]
    for codec, ending in (("MJPG", ".avi"), ("mp4v", ".mp4"), ("FFV1", ".mkv")):
        found.append(_video(ending, functools.partial(_OpenCVFile, codec)))
    if importlib.util.find_spec("imageio_ffmpeg"):
        found.append(_video(".mp4", Mp4File))
    return tuple(found)


def greedy_videos() -> tuple[bytes, ...]:
    """MP4 files whose tables claim `MUCH` samples of one byte, all in the first chunk."""
    found = []
    for video in videos():
        if b"stsz" in video:
            data = bytearray(video)
            struct.pack_into(">II", data, data.index(b"stsz") + 8, 1, MUCH)
            struct.pack_into(">I", data, data.index(b"stsc") + 16, MUCH)
            found.append(bytes(data))
    return tuple(found)


def _video(ending: str, kind: Callable[[Path, tuple[int, int], float], Any]) -> bytes:
    import numpy as np

    ramp = np.add.outer(np.arange(32), np.arange(32))[..., None] + np.array([0, 60, 120])
    with tempfile.TemporaryDirectory(prefix="nat-bench-fuzz-") as folder:
        path = Path(folder) / f"night{ending}"
        with kind(path, (32, 32), 30.0) as file:
            for number in range(4):
                file.write((ramp + 20 * number).astype(np.uint8))
        return path.read_bytes()


class _OpenCVFile:
    """A video in a codec that nat-bench reads and does not write."""

    def __init__(self, codec: str, path: Path, size: tuple[int, int], rate: float) -> None:
        import cv2

        code = cv2.VideoWriter.fourcc(*codec)
        self._writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, code, rate, size)
        self.write = self._writer.write

    def __enter__(self) -> "_OpenCVFile":
        return self

    def __exit__(self, *_: object) -> None:
        self._writer.release()


def pytorch(*, old: bool = False) -> bytes:
    """A PyTorch checkpoint of one entry."""
    import torch

    stream = io.BytesIO()
    state = {"state_dict": {"a": torch.ones(2)}, "step": 1}
    torch.save(state, stream, _use_new_zipfile_serialization=not old)
    return stream.getvalue()


def safetensors() -> bytes:
    """A safetensors file of one entry."""
    head = _json({"a": {"dtype": "F32", "shape": [2], "data_offsets": [0, 8]}})
    return struct.pack("<Q", len(head)) + head + bytes(8)


def seeds_of(target: str) -> tuple[bytes, ...]:
    """The files that a target begins from."""
    text = (_TEXT, b"1,2,3,4,5,6,7,8\n", b"\xef\xbb\xbfNaN,NaN,NaN,NaN\r\n", b"# c\n1e400,2,3,4\n")
    frames = {"data_seq/a/1.png": png(3, 3), "anno/a.txt": b"1,2,3,4\n"}
    plain = {
        "manifest": (_json(_MANIFEST), deep_json("options"), b'{"dataset":{"name":"\xff"}}'),
        "times": (b"read,enhance,track\n1,2,3\n4,5,6\n", b"\xff\n1,2,3\n"),
        "skipped": (b"1\n0\n", b"-99\n99999\n", b"9" * 5000),
        "matlab": (matlab_file(matlab_result()), matlab_file(matlab_result(), packed=True)),
        "results_archive": (archive({"T/a.txt": _TEXT, "T/a_time.txt": b"1\n2\n"}),),
        "dataset_archive": (archive(frames),),
        "index": (_json(_INDEX), deep_json("schema")),
        "foreign_index": (_json(_PYSOT), _json(_COCO), deep_json("img_names")),
        "kept": (_json({**_INDEX, "format": "got10k"}), deep_json("format"), b'{"format":"\xff"}'),
        "meta": (b"[METAINFO]\nobject_class: car\nanno_fps: 10Hz\nresolution: (8, 8)\n",),
        "absence": (b"0\n1\n",),
        "labels": (b"sequence,provenance,FM\na,published,1\n",),
        "image": images(),
        "video": (*videos(), *greedy_videos()),
        "configuration": (b'root = "/data"\n[roots]\nuavdark135 = "x"', b"root = " + b"[" * _DEEP),
        "pytorch": (pytorch(), pytorch(old=True)),
        "training_checkpoint": (pytorch(),),
        "safetensors": (safetensors(), struct.pack("<Q", 2**63) + b"{}"),
        "tensorflow_index": (bytes(40) + struct.pack("<Q", 0xDB4775248B80FB57),),
        "weights_record": (_json(_RECORD), deep_json("options")),
        "evidence": (b"\x81\xa3key\x80", b"\x81\xa3key" + b"\x91" * _DEEP),
        "bundle": (_bundle(), deep_json("format")),
        "options": (b"gamma=0.5", b"x=y", b"640x360"),
        "tables": (b"=cmd|' /C calc'!A0", b"\\input{/etc/passwd}", b"[a](javascript:b) | `c`"),
    }  # fmt: skip
    return plain.get(target, text)


def _bundle() -> bytes:
    run = {"run": "r", "tracker": "t", "enhancer": "none", "folder": "run"}
    runs = [{**run, "sha256": {"a": "0"}, "sha256_all": "0"}]
    return _json({"format": "nat-bench results 1", "dataset": "d", "protocol": "p", "runs": runs})
