"""One image file in, one out: what of a file is kept when its colours are enhanced.

Colours become 8 bits a channel as OpenCV reads them. Alpha is kept beside the new colours, where
the file is a PNG. A grey image goes in as three equal channels; it is stored as grey again only
where the enhanced image is grey too.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from nat2024.archives import read_bytes
from nat2024.datasets.decoding import decode_image
from nat2024.datasets.writing import encoding_options
from nat2024.errors import FrameUnreadable
from nat2024.types import Image

_PNG = b"\x89PNG\r\n\x1a\n"
_DEPTH, _COLOUR_TYPE = 24, 25  # places of these bytes in a PNG file
_WITH_ALPHA = (4, 6)
_STEP = 16  # a coarse look tells nearly every colour image


@dataclass(frozen=True, slots=True)
class Picture:
    """One image to be enhanced.

    Attributes:
        image: uint8 (H, W, 3) BGR.
        alpha: uint8 (H, W), None where the file has none.
        reduced: whether the file has 16 bits a channel.
    """

    image: Image
    alpha: npt.NDArray[np.uint8] | None = None
    reduced: bool = False


def read_picture(path: Path) -> Picture:
    """Read an image file, also one inside a .zip archive; EXIF orientation is ignored.

    Raises:
        FrameUnreadable: it is absent, truncated or no image; names the file.
    """
    try:
        data = read_bytes(path)
    except OSError as error:
        msg = f"{path}: cannot be read ({error.strerror or error})"
        raise FrameUnreadable(msg) from None
    image = decode_image(data, str(path))
    if not data.startswith(_PNG):
        return Picture(image)
    return Picture(image, _alpha(data), data[_DEPTH] == 16)


def _alpha(data: bytes) -> npt.NDArray[np.uint8] | None:
    if data[_COLOUR_TYPE] not in _WITH_ALPHA and b"tRNS" not in data[: data.find(b"IDAT")]:
        return None
    import cv2

    whole = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if whole is None or whole.ndim != 3 or whole.shape[2] != 4:
        return None
    alpha = np.ascontiguousarray(whole[..., 3])
    return (alpha // 256 if alpha.dtype == np.uint16 else alpha).astype(np.uint8)


def encode_picture(image: Image, like: Picture, extension: str, quality: int) -> bytes:
    """The bytes of an enhanced image.

    Args:
        image: enhanced, uint8 (H, W, 3) BGR.
        like: what it was made of.
        extension: such as `.png` or `.JPG`.
        quality: of JPEG, 1..100.

    Raises:
        FrameUnreadable: OpenCV cannot write it so, such as a JPEG of over 65 500 pixels a side.
    """
    import cv2

    stored: npt.NDArray[np.uint8] = image
    if like.alpha is not None and extension.lower() == ".png":
        stored = np.dstack([image, like.alpha])
    elif is_grey(like.image) and is_grey(image):
        stored = image[..., 0]
    options = encoding_options(extension, quality)
    try:
        done, data = cv2.imencode(extension, np.ascontiguousarray(stored), options)
    except cv2.error:
        done = False
    if not done:
        height, width = image.shape[:2]
        msg = f"an image of {width}x{height} cannot be stored as {extension}; convert it to .png"
        raise FrameUnreadable(msg)
    return bytes(data)


def is_grey(image: Image) -> bool:
    """Whether the three channels of an image (H, W, 3) are equal."""
    for part in (image[::_STEP, ::_STEP], image):
        if (part[..., :1] != part[..., 1:]).any():
            return False
    return True
