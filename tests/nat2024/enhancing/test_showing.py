from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nat2024.enhancing import enhance_images, find_source
from nat2024.enhancing.showing import (
    check_inset,
    choose_images,
    choose_insets,
    find_image,
    light_numbers,
    luma,
    read_stored,
    thumbnail,
)
from nat2024.errors import UsageError


def test_images_are_chosen_evenly_from_first_to_last(night_clip: Path) -> None:
    source = find_source(night_clip)
    names = [item.title(index) for item, index in choose_images(source, 3)]
    assert names[0] == "data_seq/narrow/00001.png"
    assert names[1].startswith("data_seq/tall/")
    assert names[2] == "data_seq/wide/00008.png"
    assert len(choose_images(source, 0)) == 24
    assert len(choose_images(source, 99)) == 24


def test_an_image_is_found_by_its_name(folder: Path) -> None:
    source = find_source(folder)
    assert str(find_image(source, "c.bmp")[0].target) == "sub/c.bmp"
    assert find_image(source, "sub/c.bmp") == find_image(source, "c.bmp")
    with pytest.raises(UsageError, match="closest: b"):
        find_image(source, "b.jpg")


def test_what_is_stored_is_read_again(folder: Path, tmp_path: Path, image: np.ndarray) -> None:
    source = find_source(folder)
    enhance_images(source, ["none"], tmp_path / "out")
    chosen = find_image(source, "b.png")
    np.testing.assert_array_equal(read_stored(tmp_path / "out" / "none", chosen), image)
    assert read_stored(tmp_path / "absent", chosen) is None


def test_the_brightest_lamp_and_the_dark_detail_are_found() -> None:
    image = np.full((100, 160, 3), 8, np.uint8)
    image[10:22, 100:116] = 255  # the lamp
    image[64:80, 20:40] += (13 * (np.indices((16, 20)).sum(0) % 2)[..., None]).astype(np.uint8)
    lamp, dark = choose_insets(image)
    assert lamp[0] <= 100
    assert lamp[0] + lamp[2] >= 116
    assert lamp[1] <= 10
    assert lamp[1] + lamp[3] >= 22
    assert dark[0] <= 20
    assert dark[0] + dark[2] >= 40
    assert dark[1] <= 64
    assert dark[1] + dark[3] >= 80
    assert choose_insets(image) == (lamp, dark)


@given(st.integers(1, 60), st.integers(1, 60), st.integers(0, 9))
def test_insets_lie_in_any_image_and_do_not_overlap(height: int, width: int, seed: int) -> None:
    image = np.random.default_rng(seed).integers(0, 256, (height, width, 3), dtype=np.uint8)
    insets = choose_insets(image)
    for inset in insets:
        assert check_inset(inset, image) == inset
    if len(insets) == 2:
        (x, y, w, h), (u, v, _, _) = insets
        assert abs(x - u) >= w or abs(y - v) >= h


@pytest.mark.parametrize("inset", [(-1, 0, 2, 2), (0, 0, 0, 2), (8, 0, 3, 2), (0, 9, 1, 2)])
def test_insets_outside_are_refused(inset: tuple[int, int, int, int]) -> None:
    with pytest.raises(UsageError, match="does not lie in the 10x10 image"):
        check_inset(inset, np.zeros((10, 10, 3), np.uint8))


def test_light_by_hand() -> None:
    image = np.zeros((1, 4, 3), np.uint8)
    image[0, 0] = 255
    image[0, 1] = 0, 0, 255  # red in BGR
    np.testing.assert_allclose(luma(image)[0], [1, 0.299, 0, 0])
    found = light_numbers(image)
    assert found["mean"] == pytest.approx(1.299 / 4)
    assert found["dark_share"] == 0.5
    assert found["saturated_share"] == 0.5


def test_thumbnails_keep_their_sides_in_proportion() -> None:
    assert thumbnail(np.zeros((3, 5000, 3), np.uint8), 400, 600).shape == (1, 400, 3)
    assert thumbnail(np.zeros((3, 5, 3), np.uint8), 400, 600).shape == (3, 5, 3)
    assert thumbnail(np.zeros((1200, 600, 3), np.uint8), 400, 600).shape == (600, 300, 3)
