import pickle
import struct

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nat2024.datasets import FolderFrames
from nat2024.datasets.decoding import decode_image, image_size
from nat2024.datasets.frames import image_names
from nat2024.errors import FrameUnreadable


@pytest.mark.parametrize("extension", [".png", ".bmp"])
def test_pixels_come_back(make, extension):
    image = make.image()
    assert (decode_image(make.encoded(extension), "x") == image).all()


def test_a_jpeg_is_what_opencv_makes_of_it(make):
    data = make.encoded(".jpg")
    expected = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    decoded = decode_image(data, "x")
    assert (decoded == expected).all()
    assert decoded.flags.c_contiguous


def test_grey_and_transparent_images_get_three_channels():
    grey = np.arange(48, dtype=np.uint8).reshape(6, 8)
    decoded = decode_image(cv2.imencode(".png", grey)[1].tobytes(), "x")
    assert (decoded == grey[..., None]).all()
    assert decoded.shape == (6, 8, 3)
    transparent = np.full((6, 8, 4), 7, np.uint8)
    assert decode_image(cv2.imencode(".png", transparent)[1].tobytes(), "x").shape == (6, 8, 3)


@pytest.mark.parametrize("extension", [".jpg", ".png", ".bmp"])
@pytest.mark.parametrize("keep", [0.3, 0.6, 0.95])
def test_truncated_images_are_refused(make, extension, keep):
    data = make.encoded(extension)
    with pytest.raises(FrameUnreadable, match=r"^here: "):
        decode_image(data[: int(len(data) * keep)], "here")


def test_a_jpeg_cut_short_and_filled_up_with_zeros_is_refused(make):
    data = make.encoded()
    with pytest.raises(FrameUnreadable, match="truncated, the JPEG has no end marker"):
        decode_image(data[: len(data) // 2] + bytes(len(data) // 2), "x")


def test_padding_after_the_end_of_a_jpeg_is_harmless(make):
    data = make.encoded()
    for padding in (b"\0", bytes(100), b"garbage after the end"):
        assert (decode_image(data + padding, "x") == decode_image(data, "x")).all()


def _exif(orientation: int, thumbnail: bytes = b"") -> bytes:
    tiff = b"II*\0" + struct.pack("<IHHHIII", 8, 1, 0x0112, 3, 1, orientation, 0)
    body = b"Exif\0\0" + tiff + thumbnail
    return b"\xff\xe1" + struct.pack(">H", len(body) + 2) + body


def test_the_end_of_a_thumbnail_is_not_the_end_of_the_image(make):
    data = make.encoded()
    with_thumbnail = data[:2] + _exif(1, make.encoded(seed=1)) + data[2:]
    assert (decode_image(with_thumbnail, "x") == decode_image(data, "x")).all()
    with pytest.raises(FrameUnreadable, match="truncated"):
        decode_image(with_thumbnail[:-40], "x")


def test_orientation_is_ignored_in_pixels_and_size(make):
    data = make.encoded()
    turned = data[:2] + _exif(6) + data[2:]
    assert (decode_image(turned, "x") == decode_image(data, "x")).all()
    assert image_size(turned) == (16, 12)


@pytest.mark.parametrize("data", [b"", b"no image", b"\xff\xd8", b"\xff\xd8\xff\xd9"])
def test_what_is_no_image_is_refused(data):
    with pytest.raises(FrameUnreadable, match="get this file again"):
        decode_image(data, "x")


@pytest.mark.parametrize("extension", [".jpg", ".png", ".bmp"])
def test_size_is_read_from_the_header(make, extension):
    data = make.encoded(extension)
    assert image_size(data) == (16, 12)
    assert image_size(data[:400]) in {(16, 12), None}


@given(st.binary(max_size=300), st.sampled_from([b"", b"\xff\xd8", b"\x89PNG\r\n\x1a\n", b"BM"]))
def test_any_bytes_give_a_size_or_none(data, start):
    size = image_size(start + data)
    assert size is None or len(size) == 2


def test_frames_follow_the_listing_in_natural_order(tmp_path, make):
    for name in ("10.jpg", "2.JPEG", "1.png", "Thumbs.db", "._1.jpg", "notes.txt", "x.jpg.tmp"):
        (tmp_path / name).write_bytes(make.encoded())
    names = image_names([p.name for p in tmp_path.iterdir()])
    assert names == ("1.png", "2.JPEG", "10.jpg")


@given(st.lists(st.integers(0, 10**8), unique=True), st.sampled_from(["", "img", "a1_"]))
def test_numbered_names_are_sorted_by_number(numbers, prefix):
    names = image_names([f"{prefix}{n}.jpg" for n in numbers])
    assert names == tuple(f"{prefix}{n}.jpg" for n in sorted(numbers))


@given(st.lists(st.from_regex(r"[a-z0-9]{1,6}\.jpg", fullmatch=True), unique=True))
def test_order_does_not_depend_on_the_listing(names):
    assert image_names(names) == image_names(names[::-1])
    assert sorted(image_names(names)) == sorted(names)


def test_folder_frames(tmp_path, make):
    folder = tmp_path / "nächtlich"
    make.frames(folder, 3, first=27)
    (folder / "00028.jpg").write_bytes(make.encoded(seed=5))
    frames = FolderFrames(folder, image_names([p.name for p in folder.iterdir()]))
    assert len(frames) == 3
    assert frames.frame_size == (16, 12)
    assert frames.path(0).name == "00027.jpg"
    assert (frames[1] == decode_image(make.encoded(seed=5), "x")).all()
    assert (frames[np.int64(1)] == frames[-2]).all()
    with pytest.raises(IndexError):
        frames[3]
    again = pickle.loads(pickle.dumps(frames))
    assert again == frames
    assert again.frame_size == (16, 12)


def test_errors_name_file_and_frame(tmp_path, make):
    make.frames(tmp_path, 3)
    (tmp_path / "00002.jpg").write_bytes(make.encoded()[:100])
    frames = FolderFrames(tmp_path, ("00001.jpg", "00002.jpg", "00009.jpg"))
    with pytest.raises(FrameUnreadable, match=r"00002\.jpg \(frame 1, counted from 0\): trunc"):
        frames[1]
    with pytest.raises(FrameUnreadable, match=r"00009\.jpg \(frame 2.*: cannot be read"):
        frames[2]
    with pytest.raises(FrameUnreadable, match="no images"):
        FolderFrames(tmp_path, ()).frame_size  # noqa: B018


def test_the_size_of_a_frame_without_a_readable_header_is_that_of_its_pixels(tmp_path, make):
    ok, webp = cv2.imencode(".webp", make.image())
    assert ok
    (tmp_path / "1.jpg").write_bytes(webp.tobytes())
    assert FolderFrames(tmp_path, ("1.jpg",)).frame_size == (16, 12)
