"""Image files to pixels: JPEG, PNG and BMP, refusing what is cut short or claims to be vast.

OpenCV before 5 fills the rest of a truncated JPEG with grey and says nothing to the caller, so
the end of each file is looked at first. So is the size in its header: a file of 200 bytes may
claim 100 000 x 100 000 pixels, and a decoder would ask for 30 GB.
"""

import struct

import numpy as np

from nat2024.errors import FrameUnreadable, UsageError
from nat2024.types import Image

MAX_PIXELS = 2**28
"""Images of more pixels than this are refused before they are decoded."""

REDUCTIONS = (1, 2, 4, 8)
"""By how much an image can be made smaller while it is decoded."""

_PNG = b"\x89PNG\r\n\x1a\n"
_PNG_END = b"IEND\xaeB`\x82"
_JPEG = b"\xff\xd8"
_JPEG_END = b"\xff\xd9"
_BMP = b"BM"
_RIFF, _WEBP = b"RIFF", b"WEBP"
_FRAME_HEADERS = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
_SCAN = 0xDA


def decode_image(data: bytes, where: str, reduction: int = 1) -> Image:
    """Decode the bytes of an image file to uint8 (H, W, 3) BGR, EXIF orientation ignored.

    Args:
        data: the whole file.
        where: what to call it in errors.
        reduction: 2, 4 or 8 give an image of ceil(H / reduction) x ceil(W / reduction) pixels;
            a JPEG is then decoded at that size, which takes a fraction of the time.

    Raises:
        FrameUnreadable: the bytes are empty, truncated, no image, or claim more than
            `MAX_PIXELS` pixels.
        UsageError: another reduction.
    """
    check_reduction(reduction)
    fault = _fault(data)
    if fault:
        msg = f"{where}: {fault}; get this file again"
        raise FrameUnreadable(msg)
    scaled = reduction if data.startswith(_JPEG) else 1
    return shrink(_decode(data, where, scaled), reduction // scaled)


def check_reduction(reduction: int) -> None:
    """Raise `UsageError` for any other reduction than those of `REDUCTIONS`."""
    if reduction not in REDUCTIONS:
        msg = f"reduction {reduction} is none of {', '.join(map(str, REDUCTIONS))}"
        raise UsageError(msg)


def shrink(image: Image, reduction: int) -> Image:
    """An image `reduction` times smaller in both directions, rounded up, by area averaging."""
    import cv2

    if reduction == 1:
        return image
    height, width = (-(-side // reduction) for side in image.shape[:2])
    small = cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA)
    return np.asarray(small, dtype=np.uint8)


def _decode(data: bytes, where: str, reduction: int) -> Image:
    import cv2

    size = {
        1: cv2.IMREAD_COLOR,
        2: cv2.IMREAD_REDUCED_COLOR_2,
        4: cv2.IMREAD_REDUCED_COLOR_4,
        8: cv2.IMREAD_REDUCED_COLOR_8,
    }[reduction]
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), size | cv2.IMREAD_IGNORE_ORIENTATION)
    except cv2.error as error:
        reason = str(error).strip().split("\n", 1)[0]
        msg = f"{where}: cannot be decoded ({reason}); get this file again"
        raise FrameUnreadable(msg) from None
    if image is None:
        msg = f"{where}: cannot be decoded, damaged or no image; get this file again"
        raise FrameUnreadable(msg)
    return np.asarray(image, dtype=np.uint8)


def image_size(data: bytes) -> tuple[int, int] | None:
    """(width, height) from the header of a JPEG, PNG or BMP file; None where it has none."""
    if data.startswith(_JPEG):
        return _jpeg_header(data)[0]
    if data.startswith(_PNG) and len(data) >= 24:
        width, height = struct.unpack(">II", data[16:24])
        return int(width), int(height)
    if data.startswith(_BMP) and len(data) >= 26:
        old = data[14:18] == b"\x0c\0\0\0"
        width, height = struct.unpack(*("<HH", data[18:22]) if old else ("<ii", data[18:26]))
        return abs(int(width)), abs(int(height))
    return None


def size_fault(size: tuple[int, int] | None) -> str:
    """Why an image of the size that its header states is not decoded, or an empty text."""
    if size is None or size[0] * size[1] <= MAX_PIXELS:
        return ""
    return f"claims {size[0]} x {size[1]} pixels, more than the {MAX_PIXELS} that are decoded"


def _fault(data: bytes) -> str:
    """What is wrong with an image file as far as header and end tell, or an empty text."""
    if not data:
        return "the file is empty"
    return size_fault(image_size(data)) or _ending_fault(data)


def _ending_fault(data: bytes) -> str:
    if data.startswith(_JPEG):
        scan = _jpeg_header(data)[1] or len(_JPEG)
        return "" if data.find(_JPEG_END, scan) >= 0 else "truncated, the JPEG has no end marker"
    if data.startswith(_PNG):
        return "" if _PNG_END in data else "truncated, the PNG has no end chunk"
    if data.startswith(_BMP) and len(data) >= 6:
        stated = int.from_bytes(data[2:6], "little")
        return "" if len(data) >= stated else f"truncated, {len(data)} of {stated} bytes"
    if data[:4] == _RIFF and data[8:12] == _WEBP:  # by its format under 2**28 pixels
        return ""
    return "no JPEG, PNG or BMP image"


def _jpeg_header(data: bytes) -> tuple[tuple[int, int] | None, int | None]:
    """(width, height), and where the first scan begins; None for what the header lacks.

    Segments are stepped over: an end marker of a thumbnail inside one is not the image's own.
    """
    size = None
    position = 2
    while position + 4 <= len(data) and data[position] == 0xFF:
        marker = data[position + 1]
        if marker == 0xFF:  # fill byte
            position += 1
            continue
        length = int.from_bytes(data[position + 2 : position + 4], "big")
        if marker in _FRAME_HEADERS and position + 9 <= len(data):
            height, width = struct.unpack(">HH", data[position + 5 : position + 9])
            size = (int(width), int(height))
        position += 2 + length
        if marker == _SCAN:
            return size, position
    return size, None
