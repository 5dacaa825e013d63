"""Image files to pixels: JPEG, PNG and BMP, refusing what is cut short.

OpenCV before 5 fills the rest of a truncated JPEG with grey and says nothing to the caller, so
the end of each file is looked at first.
"""

import struct

import numpy as np

from nat2024.errors import FrameUnreadable
from nat2024.types import Image

_PNG = b"\x89PNG\r\n\x1a\n"
_PNG_END = b"IEND\xaeB`\x82"
_JPEG = b"\xff\xd8"
_JPEG_END = b"\xff\xd9"
_BMP = b"BM"
_FRAME_HEADERS = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
_SCAN = 0xDA


def decode_image(data: bytes, where: str) -> Image:
    """Decode the bytes of an image file to uint8 (H, W, 3) BGR, EXIF orientation ignored.

    `where` is named in errors.

    Raises:
        FrameUnreadable: the bytes are empty, truncated or no image.
    """
    import cv2

    fault = _fault(data)
    if fault:
        msg = f"{where}: {fault}; get this file again"
        raise FrameUnreadable(msg)
    try:
        image = cv2.imdecode(
            np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION
        )
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
    if data.startswith(_BMP) and len(data) >= 26 and data[14:18] != b"\x0c\0\0\0":
        width, height = struct.unpack("<ii", data[18:26])
        return int(width), abs(int(height))
    return None


def _fault(data: bytes) -> str:
    """What is wrong with an image file as far as its ends tell, or an empty text."""
    if not data:
        return "the file is empty"
    if data.startswith(_JPEG):
        scan = _jpeg_header(data)[1] or len(_JPEG)
        return "" if data.find(_JPEG_END, scan) >= 0 else "truncated, the JPEG has no end marker"
    if data.startswith(_PNG):
        return "" if _PNG_END in data else "truncated, the PNG has no end chunk"
    if data.startswith(_BMP) and len(data) >= 6:
        stated = int.from_bytes(data[2:6], "little")
        return "" if len(data) >= stated else f"truncated, {len(data)} of {stated} bytes"
    return ""  # named .jpg but something else: OpenCV decides


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
