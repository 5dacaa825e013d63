"""Writing a sequence of one's own in the layout of UAVDark135."""

import os
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from nat2024.boxes import write_boxes
from nat2024.datasets.frames import IMAGE_EXTENSIONS
from nat2024.errors import ArrayContract, UsageError
from nat2024.files import write_atomic
from nat2024.types import Box, Image


def write_sequence(
    folder: str | os.PathLike[str],
    name: str,
    frames: Iterable[tuple[Image, Box]],
    extension: str = ".png",
    quality: int = 95,
) -> Path:
    """Write `data_seq/NAME/00001.png`, ... and then `anno/NAME.txt` below `folder`.

    Args:
        folder: of the dataset; made where absent.
        name: of the sequence.
        frames: uint8 (H, W, 3) BGR images with their boxes, float64 (4,) x, y, w, h.
        extension: `.png` and `.bmp` keep every pixel, `.jpg` does not.
        quality: of JPEG, 1..100.

    Returns:
        The box file.

    Raises:
        UsageError: the sequence is there already, has no frame, its name is no file name, or the
            extension is none of an image.
        ArrayContract: an image or box of another shape or type.
    """
    images, boxes_file = Path(folder) / "data_seq" / name, Path(folder) / "anno" / f"{name}.txt"
    if not name or Path(name).name != name or name.startswith("."):
        msg = f"{name!r} cannot be the name of a sequence: it must be a plain file name"
        raise UsageError(msg)
    if images.exists() or boxes_file.exists():
        msg = f"{folder}: a sequence {name} is there already; choose another name or folder"
        raise UsageError(msg)
    boxes = []
    for number, (image, box) in enumerate(frames, 1):
        write_atomic(images / f"{number:05d}{extension}", encode_image(image, extension, quality))
        boxes.append(np.asarray(box, dtype=np.float64).reshape(4))
    if not boxes:
        msg = f"{folder}: sequence {name} has no frame to write"
        raise UsageError(msg)
    write_boxes(boxes_file, np.stack(boxes))
    return boxes_file


def encode_image(image: Image, extension: str, quality: int = 95) -> bytes:
    """The bytes of an image file.

    Args:
        image: uint8 (H, W, 3) BGR.
        extension: such as `.png` or `.jpg`.
        quality: of JPEG, 1..100.

    Raises:
        ArrayContract: the image is none.
        UsageError: the extension is none of an image.
    """
    import cv2

    if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3 or not image.size:
        msg = f"image must be uint8 of shape (H, W, 3), not {image.dtype} {image.shape}"
        raise ArrayContract(msg)
    if extension.lower() not in IMAGE_EXTENSIONS:
        msg = f"extension {extension!r} is none of {', '.join(sorted(IMAGE_EXTENSIONS))}"
        raise UsageError(msg)
    return bytes(cv2.imencode(extension, image, encoding_options(extension, quality))[1])


def encoding_options(extension: str, quality: int) -> list[int]:
    """What `cv2.imencode` is told for a kind of file; it warns of an option of another kind."""
    import cv2

    is_jpeg = extension.lower() in (".jpg", ".jpeg")
    return [cv2.IMWRITE_JPEG_QUALITY, quality] if is_jpeg else []
