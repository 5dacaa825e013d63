"""Small images, videos and datasets to enhance."""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest


@pytest.fixture
def image() -> np.ndarray:
    """A dark image with a lamp, uint8 (60, 90, 3) BGR."""
    rng = np.random.default_rng(0)
    pixels = rng.integers(0, 40, (60, 90, 3), dtype=np.uint8)
    pixels[5:15, 60:70] = 250
    return pixels


@pytest.fixture
def folder(tmp_path: Path, image: np.ndarray) -> Path:
    """Images with a sub-folder, and files that are none."""
    top = tmp_path / "night"
    (top / "sub").mkdir(parents=True)
    cv2.imwrite(str(top / "b.png"), image)
    cv2.imwrite(str(top / "a.JPG"), image)
    cv2.imwrite(str(top / "sub" / "c.bmp"), image[:20])
    (top / "notes.md").write_text("none")
    (top / ".hidden.png").write_bytes(b"")
    return top


@pytest.fixture
def video() -> Callable[[Path, tuple[int, int]], Path]:
    """Write a video of seven frames at 10 frames a second, each brighter than the last."""

    def write(path: Path, size: tuple[int, int] = (64, 48)) -> Path:
        path.parent.mkdir(parents=True, exist_ok=True)
        code = cv2.VideoWriter.fourcc(*"MJPG")
        writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, code, 10.0, size)
        for number in range(7):
            writer.write(np.full((size[1], size[0], 3), 10 + 10 * number, np.uint8))
        writer.release()
        return path

    return write
