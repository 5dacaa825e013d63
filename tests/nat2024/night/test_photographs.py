"""Photographs at night, and the folder of training images made of them."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from nat2024.errors import ArrayContract, FrameUnreadable, UsageError
from nat2024.measures import night_statistics
from nat2024.night.photographs import SIDE, VIEW, night_photograph, night_views
from nat2024.night.sample import SEEDS
from nat2024.night.training_images import TrainingImages, make_training_images

RANGES = Path(__file__).parents[2] / "data" / "night_ranges.json"
FEW = TrainingImages(rounds=1, rendered=1, held_out=2)


def photograph(seed, size=(200, 300)):
    """A day-like picture: rectangles of all albedos under a bright sky."""
    rng = np.random.default_rng(seed)
    image = np.full((*size, 3), rng.integers(60, 160, 3), dtype=np.uint8)
    image[: size[0] // 4] = (235, 210, 190)
    for _ in range(120):
        x, y, w, h = rng.integers(0, size[1]), rng.integers(size[0] // 4, size[0]), 30, 20
        image[y : y + h, x : x + w] = rng.integers(10, 230, 3)
    return image


def test_the_same_photograph_and_seed_give_the_same_night():
    one = night_photograph(photograph(1), 7)
    assert one.shape == (SIDE, SIDE, 3)
    assert one.dtype == np.uint8
    assert np.array_equal(one, night_photograph(photograph(1), 7))
    assert not np.array_equal(one, night_photograph(photograph(1), 8))
    assert not np.array_equal(one, night_photograph(photograph(2), 7))


def test_a_photograph_is_left_as_it_is():
    image = photograph(1)
    before = image.copy()
    night_photograph(image, 3)
    assert np.array_equal(image, before)


def test_nights_measure_as_real_ones_do():
    ranges = json.loads(RANGES.read_text(encoding="utf-8"))["first_frames"]
    scenes = [night_photograph(photograph(seed), seed) for seed in range(12)]
    found = [night_statistics(night_views(scene, 1)[0]) for scene in scenes]
    for key in ("mean", "p50", "p99", "noise_sigma"):
        low, high = ranges[key]
        assert 0.9 * low <= np.median([one[key] for one in found]) <= high, key
    assert np.median([one["dark_share"] for one in found]) > 0.77
    assert np.median([one["p99_9"] for one in found]) > 0.5
    assert np.median([one["saturated_share"] for one in found]) < 0.003
    assert 0.4 < np.median([one["unevenness"] for one in found]) < 1.1


def test_views_are_the_whole_and_a_part():
    scene = night_photograph(photograph(3), 4)
    whole, part = night_views(scene, 5)
    assert whole.shape == part.shape == (VIEW, VIEW, 3)
    assert np.array_equal(whole, cv2.resize(scene, (VIEW, VIEW), interpolation=cv2.INTER_AREA))
    assert not np.array_equal(whole, part)


def test_black_views_are_left_out():
    assert night_views(np.zeros((64, 64, 3), dtype=np.uint8), 1) == []


@pytest.mark.parametrize("wrong", [np.zeros((64, 64), np.uint8), np.zeros((64, 64, 3), float)])
def test_what_is_no_photograph_is_refused(wrong):
    with pytest.raises(ArrayContract, match="photograph must be"):
        night_photograph(wrong, 0)


@pytest.fixture
def photographs(tmp_path):
    folder = tmp_path / "photographs"
    folder.mkdir()
    for seed in range(3):
        cv2.imwrite(str(folder / f"p{seed}.png"), photograph(seed))
    return folder


def test_a_folder_is_made_once_and_the_same_again(photographs, tmp_path):
    record = make_training_images(photographs, tmp_path / "a", FEW)
    assert len(record["train"]) == 4  # one photograph and one rendered scene, two views each
    assert len(record["held_out"]) == 4
    assert list(record["photographs"]) == ["p0.png", "p1.png", "p2.png"]
    for group in ("train", "held_out"):
        assert {p.name for p in (tmp_path / "a" / group).glob("*.png")} == set(record[group])
    some = tmp_path / "a" / "train" / record["train"][0]
    before = some.stat().st_mtime_ns
    assert make_training_images(photographs, tmp_path / "a", FEW) == record
    assert some.stat().st_mtime_ns == before
    assert make_training_images(photographs, tmp_path / "b", FEW) == record
    assert some.read_bytes() == (tmp_path / "b" / "train" / some.name).read_bytes()


def test_images_of_other_photographs_are_not_mixed(photographs, tmp_path):
    none_rendered = TrainingImages(rounds=1, rendered=0)
    make_training_images(photographs, tmp_path / "a", none_rendered)
    cv2.imwrite(str(photographs / "p0.png"), photograph(9))
    with pytest.raises(UsageError, match="other photographs or settings"):
        make_training_images(photographs, tmp_path / "a", none_rendered)


def test_seeds_of_the_sample_are_refused(photographs, tmp_path):
    for first in (SEEDS[0], SEEDS[-1], SEEDS[0] - 2):
        with pytest.raises(UsageError, match="night_mini"):
            make_training_images(photographs, tmp_path / "a", TrainingImages(seed=first))
    with pytest.raises(UsageError, match="night_mini"):
        make_training_images(
            photographs, tmp_path / "a", TrainingImages(rendered_seed=SEEDS[0], rendered=1)
        )


def test_bad_folders_are_named(tmp_path):
    with pytest.raises(UsageError, match="no photographs"):
        make_training_images(tmp_path, tmp_path / "a")
    (tmp_path / "x.jpg").write_bytes(b"no picture")
    with pytest.raises(FrameUnreadable, match=r"x\.jpg"):
        make_training_images(tmp_path, tmp_path / "a")
