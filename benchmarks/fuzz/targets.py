"""What reads files of strangers: each target takes the bytes of one file, as anybody may send it.

A target passes where it returns or raises a `NatBenchError`. Any other error is a fault, and so is
a crash of the process or a flood of memory.
"""

import contextlib
import logging
import os
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING
from unittest import mock

if TYPE_CHECKING:
    from nat2024.types import Image

Target = Callable[[bytes], object]
_BOXES = "1,2,3,4\n5,6,7,8\n"


@contextlib.contextmanager
def _folder() -> Iterator[Path]:
    with tempfile.TemporaryDirectory(prefix="nat-bench-fuzz-") as name:
        yield Path(name)


def boxes(data: bytes) -> object:
    """A text file of boxes."""
    from nat2024.boxes import parse_boxes

    return parse_boxes(data)


def _score(folder: Path) -> None:
    """All that evaluation and export ask of the runs in a folder."""
    from nat2024.errors import NatBenchError
    from nat2024.store import list_runs

    for run in list_runs(folder):
        asked: list[Callable[[], object]] = [
            run.manifest,
            lambda one=run: (one.tracker, one.enhancer),
        ]
        for sequence in run.finished():
            asked += [
                lambda one=run, name=sequence: one.repeats(name),
                lambda one=run, name=sequence: one.frame_seconds(name),
            ]
        if hasattr(run, "stage_times"):
            asked.append(run.stage_times)
        for question in asked:
            with contextlib.suppress(NatBenchError):
                question()


def _result_file(name: str) -> Target:
    def target(data: bytes) -> object:
        with _folder() as folder:
            run = folder / "tracker"
            for path, text in {
                "run.json": "",
                "a.txt": _BOXES,
                "time/a.csv": "read\n1,2,3\n",
            }.items():
                file = run / path
                file.parent.mkdir(parents=True, exist_ok=True)
                if text:
                    file.write_text(text)
            (run / name).parent.mkdir(parents=True, exist_ok=True)
            (run / name).write_bytes(data)
            return _score(folder)

    return target


def matlab(data: bytes) -> object:
    """A MATLAB result."""
    with _folder() as folder:
        (folder / "a_T.mat").write_bytes(data)
        return _score(folder)


def bundle(data: bytes) -> object:
    """The manifest of a bundle."""
    with _folder() as folder:
        boxes_of = folder / "boxes" / "run"
        boxes_of.mkdir(parents=True)
        (boxes_of / "a.csv").write_text(f"x,y,w,h\n{_BOXES}")
        (folder / "manifest.json").write_bytes(data)
        return _score(folder)


def results_archive(data: bytes) -> object:
    """A .zip archive of results."""
    with _folder() as folder:
        (folder / "results.zip").write_bytes(data)
        return _score(folder / "results.zip")


def dataset_archive(data: bytes) -> object:
    """A .zip archive of a dataset."""
    import nat2024

    with _folder() as folder:
        path = folder / "night.zip"
        path.write_bytes(data)
        for sequence in nat2024.load_dataset(str(path), unannotated=True):
            sequence.image(0)
    return None


def _dataset_file(name: str) -> Target:
    def target(data: bytes) -> object:
        import nat2024

        with _folder() as folder:
            frames = folder / "car1"
            frames.mkdir()
            for number in (1, 2):
                (frames / f"{number:08d}.jpg").write_bytes(b"\xff\xd8\xff\xd9")
            if name not in ("nat-bench.json", "night.json"):
                (frames / "groundtruth.txt").write_text(_BOXES)
            (folder / name).write_bytes(data)
            return nat2024.load_dataset(str(folder), unannotated=True)

    return target


def image(data: bytes) -> object:
    """A frame, whole and reduced; what it gives is an image of the size in its header."""
    from nat2024.datasets.decoding import decode_image, image_size

    whole, quarter = decode_image(data, "frame"), decode_image(data, "frame", 4)
    _check_pixels(whole)
    _check_pixels(quarter)
    stated = image_size(data)
    assert stated in (None, whole.shape[1::-1]), stated
    return whole


def video(data: bytes) -> object:
    """A video: as a sequence, whose frames are read in any order, and as a source of `track`."""
    from nat2024.datasets.video import VideoFrames
    from nat2024.live import open_source

    with _folder() as folder:
        path = folder / "night.mp4"
        path.write_bytes(data)
        with open_source(str(path)) as source:
            while (frame := source.read()) is not None:
                _check_pixels(frame)
        frames = VideoFrames(path)
        try:
            for number in (0, len(frames) - 1, len(frames) // 2):
                _check_pixels(frames[number])
                assert frames[number].shape[1::-1] == frames.frame_size
        finally:
            frames.close()
    return None


def _check_pixels(frame: "Image") -> None:
    """What every reader of frames promises."""
    assert frame.dtype == "uint8", frame.dtype
    assert frame.ndim == 3, frame.shape
    assert frame.shape[2] == 3, frame.shape
    assert frame.size > 0, frame.shape


def configuration(data: bytes) -> object:
    """The configuration file."""
    from nat2024.datasets.roots import configured_roots

    with _folder() as folder:
        path = folder / "config.toml"
        path.write_bytes(data)
        with mock.patch.dict(os.environ, {"NAT2024_CONFIG": str(path)}):
            return configured_roots()


def _checkpoint(name: str) -> Target:
    def target(data: bytes) -> object:
        from nat2024.zoo.checkpoints import read_checkpoint

        with _folder() as folder:
            path = folder / name
            path.write_bytes(data)
            return read_checkpoint(path)

    return target


def tensorflow_index(data: bytes) -> object:
    """The index of a TensorFlow checkpoint."""
    from nat2024.zoo.tensorflow import read_tensorflow

    with _folder() as folder:
        (folder / "model.index").write_bytes(data)
        (folder / "model.data-00000-of-00001").write_bytes(bytes(64))
        return read_tensorflow(folder / "model")


def weights_record(data: bytes) -> object:
    """The record beside registered weights."""
    from nat2024.zoo.registered import read_record

    with _folder() as folder:
        path = folder / "gamma" / "default.json"
        path.parent.mkdir()
        path.write_bytes(data)
        return read_record(path)


def training_checkpoint(data: bytes) -> object:
    """A checkpoint that a training goes on with."""
    from nat2024.training.checkpoints import read_checkpoint

    with _folder() as folder:
        path = folder / "step-00000001.pt"
        path.write_bytes(data)
        return read_checkpoint(path)


def evidence(data: bytes) -> object:
    """What reports keep beside results."""
    import hashlib

    from nat2024.evidence.keeping import FOLDER, open_keeper

    with _folder() as folder:
        (folder / FOLDER).mkdir()
        checked = hashlib.sha256(data).digest()[:16] + data  # as whoever wrote it would
        (folder / FOLDER / "a.msgpack").write_bytes(checked)
        return open_keeper(folder, "a").get("key", dict)


def labels(data: bytes) -> object:
    """A table of labels."""
    from nat2024.datasets.labels import read_label_table

    with _folder() as folder:
        path = folder / "labels.csv"
        path.write_bytes(data)
        return read_label_table(path)


def options(data: bytes) -> object:
    """Words of the command line: options of plugins, pairs and sizes."""
    from nat2024.cli.options import read_plugin_options, read_size
    from nat2024.errors import NatBenchError
    from nat2024.registry import load_plugin, resolve_options

    text = data.decode("utf-8", "replace")
    with contextlib.suppress(NatBenchError):
        read_size(text)
    for plugin, given in read_plugin_options([f"gamma.{text}"]).items():
        resolve_options(load_plugin(plugin.partition("@")[0], "enhancer"), given)
    return None


def tables(data: bytes) -> object:
    """Names in tables of every format."""
    from nat2024_reports.formats import FORMATS, render
    from nat2024_reports.tables import Cell, Column, Table

    text = data.decode("utf-8", "replace")
    table = Table(text, (Column(text, is_words=True),), (((Cell(text),),),), (text,))
    return [render([table], form) for form in FORMATS]


TARGETS: dict[str, Target] = {
    "boxes": boxes,
    "manifest": _result_file("run.json"),
    "times": _result_file("time/a.csv"),
    "skipped": _result_file("skipped/a.csv"),
    "result": _result_file("a.txt"),
    "matlab": matlab,
    "bundle": bundle,
    "results_archive": results_archive,
    "dataset_archive": dataset_archive,
    "index": _dataset_file("nat-bench.json"),
    "foreign_index": _dataset_file("night.json"),
    "kept": _dataset_file("nat-bench-extra.json"),
    "meta": _dataset_file("car1/meta_info.ini"),
    "absence": _dataset_file("car1/absence.label"),
    "annotation": _dataset_file("car1/groundtruth.txt"),
    "labels": labels,
    "image": image,
    "video": video,
    "configuration": configuration,
    "pytorch": _checkpoint("model.pth"),
    "safetensors": _checkpoint("model.safetensors"),
    "tensorflow_index": tensorflow_index,
    "weights_record": weights_record,
    "training_checkpoint": training_checkpoint,
    "evidence": evidence,
    "options": options,
    "tables": tables,
}
"""Targets by name."""


def quiet() -> None:
    """Keep the library's log out of the way."""
    logging.getLogger("nat2024").setLevel(logging.CRITICAL)
