import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from nat2024.enhancing import ImageItem, VideoItem, find_source
from nat2024.errors import DatasetNotFound, NatBenchError, UnknownSequence, UsageError


def targets(given: Path, **options: object) -> list[str]:
    return [str(item.target) for item in find_source(given, **options).items]  # type: ignore[arg-type]


def test_a_folder_of_images_keeps_its_sub_folders(folder: Path) -> None:
    source = find_source(folder)
    assert source.kind == "images"
    assert targets(folder) == ["a.JPG", "b.png", "sub/c.bmp"]
    assert targets(folder, every=2) == ["a.JPG", "sub/c.bmp"]
    assert targets(folder, limit=1) == ["a.JPG"]


def test_a_link_back_is_entered_once(folder: Path) -> None:
    (folder / "sub" / "back").symlink_to(folder)
    assert targets(folder) == ["a.JPG", "b.png", "sub/c.bmp"]


def test_a_zip_of_images_is_read_like_the_folder(folder: Path, tmp_path: Path) -> None:
    archive = tmp_path / "n.zip"
    with zipfile.ZipFile(archive, "w") as packed:
        packed.write(folder / "b.png", "x/b.png")
    (item,) = find_source(archive).items
    assert str(item.target) == "x/b.png"
    assert item.read(0).image.shape == (60, 90, 3)


def test_one_image_and_one_video(folder: Path, tmp_path: Path, video: Callable[..., Path]) -> None:
    source = find_source(folder / "b.png")
    assert source.kind == "image"
    assert isinstance(source.items[0], ImageItem)
    (item,) = find_source(video(tmp_path / "v.avi"), every=3, limit=2).items
    assert isinstance(item, VideoItem)
    assert list(item.numbers) == [0, 3]
    assert item.rate == pytest.approx(10 / 3)
    assert item.title(1) == "v.avi frame 3"
    assert item.read(1).image.mean() == pytest.approx(40, abs=2)


def test_boxes_make_a_dataset(night_clip: Path) -> None:
    source = find_source(night_clip, sequences=["tall"])
    assert source.kind == "dataset"
    assert source.selected
    assert len(source.items) == 8
    assert source.items[0].target.as_posix() == "data_seq/tall/00001.png"
    images = find_source(night_clip, as_images=True)
    assert images.kind == "images"
    assert len(images.items) == 24


@pytest.mark.parametrize(
    ("options", "error", "told"),
    [
        ({"every": 2}, UsageError, "--sequences"),
        ({"limit": 2}, UsageError, "--images"),
        ({"sequences": ["tal"]}, UnknownSequence, "closest: tall"),
        ({"as_images": True, "sequences": ["tall"]}, UsageError, "read as images"),
        ({"every": 0}, UsageError, "at least 1"),
    ],
)
def test_options_that_do_not_fit_a_dataset(
    night_clip: Path, options: dict[str, object], error: type[NatBenchError], told: str
) -> None:
    with pytest.raises(error, match=told):
        find_source(night_clip, **options)  # type: ignore[arg-type]


def test_what_is_nothing_is_told(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "a.txt").write_text("x")
    with pytest.raises(DatasetNotFound, match="no images in it"):
        find_source(tmp_path / "empty")
    with pytest.raises(UsageError, match="neither an image nor a video"):
        find_source(tmp_path / "a.txt")
    with pytest.raises(DatasetNotFound, match="closest: night_mini"):
        find_source("night_min")
    with pytest.raises(DatasetNotFound, match="no such image"):
        find_source(tmp_path / "a.png")
