"""A dataset that is enhanced is a dataset again, in every layout."""

import shutil
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from nat2024.datasets import convert, index_dataset, load_dataset, write_index
from nat2024.enhancing import enhance_images, find_source
from nat2024.types import Dataset


def assert_equal(found: Dataset, source: Dataset) -> None:
    assert [s.name for s in found] == [s.name for s in source]
    assert found.attribute_names == source.attribute_names
    for one in source:
        other = found[one.name]
        assert len(other) == len(one)
        np.testing.assert_array_equal(other.boxes, one.boxes)
        assert other.attributes == one.attributes
        assert (other.visible is None) == (one.visible is None)
        if one.visible is not None:
            np.testing.assert_array_equal(other.visible, one.visible)
        expected = np.round(255 * np.sqrt(one.image(1) / 255)).astype(np.uint8)
        shown = other.image(1)
        if getattr(one.frames, "names", None):
            assert other.frames.names == one.frames.names  # type: ignore[attr-defined]
        assert np.abs(shown.astype(int) - expected).mean() < 4  # videos are lossy


def test_the_layout_of_uavdark135(night_clip: Path, tmp_path: Path) -> None:
    report = enhance_images(night_clip, ["gamma"], tmp_path)
    assert report.kind == "dataset"
    assert report.images == 24
    assert_equal(load_dataset(tmp_path / "gamma"), load_dataset(night_clip))


def test_the_sample_in_its_archive_keeps_its_attributes(tmp_path: Path) -> None:
    enhance_images(find_source("night_mini", sequences=["bike1"]), ["gamma"], tmp_path)
    found = load_dataset(tmp_path / "gamma")
    assert [s.name for s in found] == ["bike1"]
    whole = load_dataset("night_mini")
    assert found["bike1"].attributes == whole["bike1"].attributes != frozenset()


@pytest.mark.parametrize("to", ["got10k", "pysot", "coco-video", "published", "index"])
def test_every_format(night_clip: Path, tmp_path: Path, to: str) -> None:
    convert(night_clip, tmp_path / "source", to)
    enhance_images(tmp_path / "source", ["gamma"], tmp_path / "out")
    source = load_dataset(tmp_path / "source")
    found = load_dataset(tmp_path / "out" / "gamma")
    assert_equal(found, source)


def test_frames_and_boxes_in_one_folder(night_clip: Path, tmp_path: Path) -> None:
    """As OTB and LaSOT, and a single sequence."""
    for name in ("narrow", "wide"):
        shutil.copytree(night_clip / "data_seq" / name, tmp_path / "otb" / name / "img")
        shutil.copy(night_clip / "anno" / f"{name}.txt", tmp_path / "otb" / name)
        (tmp_path / "otb" / name / f"{name}.txt").rename(
            tmp_path / "otb" / name / "groundtruth_rect.txt"
        )
    for number, given in enumerate((tmp_path / "otb", tmp_path / "otb" / "wide")):
        out = tmp_path / f"out{number}"
        enhance_images(given, ["gamma"], out)
        found = load_dataset(out / "gamma")
        assert len(found) == 2 - number
        np.testing.assert_array_equal(
            found.sequences[-1].boxes, load_dataset(given).sequences[-1].boxes
        )


def test_checksums_of_an_index_do_not_stay(night_clip: Path, tmp_path: Path) -> None:
    shutil.copytree(night_clip, tmp_path / "source")
    write_index(index_dataset(tmp_path / "source"), tmp_path / "source" / "nat-bench.json")
    enhance_images(tmp_path / "source", ["gamma"], tmp_path / "out")
    (index,) = (tmp_path / "out" / "gamma").glob("*.json")
    assert "sha256" not in index.read_text()
    assert_equal(load_dataset(tmp_path / "out" / "gamma"), load_dataset(tmp_path / "source"))


def test_videos_with_boxes(tmp_path: Path, video: Callable[..., Path]) -> None:
    video(tmp_path / "source" / "data_seq" / "v.avi")
    (tmp_path / "source" / "anno").mkdir()
    (tmp_path / "source" / "anno" / "v.txt").write_text("1,2,3,4\n" * 7)
    enhance_images(tmp_path / "source", ["gamma"], tmp_path / "a")
    assert (tmp_path / "a" / "gamma" / "data_seq" / "v.webm").is_file()
    assert_equal(load_dataset(tmp_path / "a" / "gamma"), load_dataset(tmp_path / "source"))
    write_index(index_dataset(tmp_path / "source"), tmp_path / "source" / "nat-bench.json")
    for name, frames_only in (("b", False), ("c", True)):
        enhance_images(tmp_path / "source", ["gamma"], tmp_path / name, frames_only=frames_only)
        found = load_dataset(tmp_path / name / "gamma")
        assert_equal(found, load_dataset(tmp_path / "source"))


def test_a_sequence_with_a_broken_frame_gets_no_boxes(night_clip: Path, tmp_path: Path) -> None:
    shutil.copytree(night_clip, tmp_path / "source")
    broken = tmp_path / "source" / "data_seq" / "tall" / "00003.png"
    whole = broken.read_bytes()
    broken.write_bytes(b"")
    report = enhance_images(tmp_path / "source", ["gamma"], tmp_path / "out")
    assert [failure.image for failure in report.failures] == ["data_seq/tall/00003.png"]
    assert [s.name for s in load_dataset(tmp_path / "out" / "gamma")] == ["narrow", "wide"]
    broken.write_bytes(whole)  # mended, the same call completes it
    again = enhance_images(tmp_path / "source", ["gamma"], tmp_path / "out")
    assert again.enhancers[0].written == 1
    assert_equal(load_dataset(tmp_path / "out" / "gamma"), load_dataset(tmp_path / "source"))


def test_pictures_of_the_frames_are_not_grey(night_clip: Path, tmp_path: Path) -> None:
    enhance_images(find_source(night_clip, sequences=["wide"]), ["none"], tmp_path)
    name = Path("data_seq") / "wide" / "00001.png"
    stored = cv2.imread(str(tmp_path / "none" / name))
    np.testing.assert_array_equal(stored, cv2.imread(str(night_clip / name)))
