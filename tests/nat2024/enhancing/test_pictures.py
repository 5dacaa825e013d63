from pathlib import Path

import cv2
import numpy as np
import pytest

from nat2024.enhancing import read_picture
from nat2024.enhancing.pictures import Picture, encode_picture, is_grey
from nat2024.errors import FrameUnreadable


def decode(data: bytes) -> np.ndarray:
    found = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    assert found is not None
    return found


def test_alpha_is_kept_unchanged_beside_new_colours(tmp_path: Path, image: np.ndarray) -> None:
    alpha = np.arange(60 * 90, dtype=np.uint8).reshape(60, 90)
    path = tmp_path / "a.png"
    cv2.imwrite(str(path), np.dstack([image, alpha]))
    picture = read_picture(path)
    np.testing.assert_array_equal(picture.image, image)
    assert not picture.reduced
    stored = decode(encode_picture(255 - image, picture, ".png", 95))
    np.testing.assert_array_equal(stored, np.dstack([255 - image, alpha]))


def test_alpha_stays_behind_in_a_jpeg(image: np.ndarray) -> None:
    picture = Picture(image, alpha=image[..., 0])
    assert decode(encode_picture(image, picture, ".jpg", 95)).shape == image.shape


def test_sixteen_bits_become_eight_as_opencv_reads_them(tmp_path: Path) -> None:
    deep = np.random.default_rng(0).integers(0, 2**16, (7, 9, 4), dtype=np.uint16)
    path = tmp_path / "a.png"
    cv2.imwrite(str(path), deep)
    picture = read_picture(path)
    assert picture.reduced
    np.testing.assert_array_equal(picture.image, cv2.imread(str(path)))
    np.testing.assert_array_equal(picture.alpha, deep[..., 3] // 256)


def test_grey_stays_grey_only_where_the_result_is(image: np.ndarray) -> None:
    grey = np.repeat(image[..., :1], 3, axis=2)
    assert is_grey(grey)
    assert decode(encode_picture(grey // 2, Picture(grey), ".png", 95)).ndim == 2
    tinted = grey.copy()
    tinted[3, 5] = 1, 2, 3  # one pixel, which the coarse look misses
    assert not is_grey(tinted)
    assert decode(encode_picture(tinted, Picture(grey), ".png", 95)).ndim == 3
    assert decode(encode_picture(grey, Picture(tinted), ".png", 95)).ndim == 3


def test_quality_is_that_of_jpeg(image: np.ndarray) -> None:
    sizes = [len(encode_picture(image, Picture(image), ".JPG", q)) for q in (30, 95)]
    assert sizes[0] < sizes[1]


def test_what_is_no_image_is_named(tmp_path: Path) -> None:
    for name, data in (("a.png", b""), ("b.jpg", b"text")):
        (tmp_path / name).write_bytes(data)
        with pytest.raises(FrameUnreadable, match=name):
            read_picture(tmp_path / name)
    with pytest.raises(FrameUnreadable, match="absent"):
        read_picture(tmp_path / "absent.png")


def test_a_side_that_jpeg_cannot_hold_is_told() -> None:
    wide = np.zeros((1, 65_600, 3), np.uint8)
    with pytest.raises(FrameUnreadable, match="65600x1 cannot be stored"):
        encode_picture(wide, Picture(wide), ".jpg", 95)
