"""Boxes drawn into the pixels of frames."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from nat2024.types import Box, Image

FOUND, TRUTH = (0, 158, 230), (115, 158, 0)
"""Colours of the tracker's box and of the reference, BGR: orange and green of Okabe and Ito."""

WHITE, BLACK = (255, 255, 255), (0, 0, 0)
_DARK = 60.0  # of 255; a darker line is lost on black
_FAR = 1e5  # pixels beyond which a box is cut, so that OpenCV's integers hold it

Color = tuple[int, int, int]
"""Blue, green, red."""


@dataclass(frozen=True, slots=True)
class DrawnBox:
    """A box and how it is drawn.

    Attributes:
        box: x, y, w, h in pixels; not finite is not drawn.
        color: of its lines.
        is_dashed: whether they are dashed.
    """

    box: Box
    color: Color
    is_dashed: bool = False


def bgr(color: str) -> Color:
    """A colour `#rrggbb` as blue, green, red."""
    red, green, blue = bytes.fromhex(color.lstrip("#"))
    return blue, green, red


def edge_of(color: Color) -> Color:
    """What sets a line off from ground of any brightness: white for dark lines, else black."""
    blue, green, red = color
    return WHITE if 0.114 * blue + 0.587 * green + 0.299 * red < _DARK else BLACK


def draw_boxes(
    frame: Image, found: Box | None, truth: Box | None = None, lines: tuple[str, ...] = ()
) -> Image:
    """A copy of a uint8 (H, W, 3) BGR frame with boxes and lines of text in its corner.

    Args:
        frame: not changed.
        found: the tracker's box x, y, w, h; drawn last.
        truth: the reference; None or not finite is not drawn.
        lines: texts, from the top down.
    """
    boxes = [
        DrawnBox(box, color) for box, color in ((truth, TRUTH), (found, FOUND)) if box is not None
    ]
    drawn = frame.copy()
    thick = max(1, round(min(frame.shape[:2]) / 240))
    draw_into(drawn, boxes, thick)
    write_lines(drawn, lines, thick)
    return drawn


def draw_into(image: Image, boxes: Iterable[DrawnBox], thick: int, *, halo: bool = False) -> None:
    """Draw boxes into an image of one's own, the last one on top.

    Args:
        image: uint8 (H, W, 3) BGR, changed.
        boxes: in pixels of the image.
        thick: of lines in pixels.
        halo: draw each line on one of `edge_of` its colour, for ground of any brightness.
    """
    kept = [one for one in boxes if np.isfinite(one.box).all()]
    for one in kept:
        x, y, w, h = one.box
        corners = np.clip(np.round([x, y, x + w, y + h]), -_FAR, _FAR).astype(int).tolist()
        if halo:
            _rectangle(image, corners, edge_of(one.color), thick + 2, one.is_dashed)
        _rectangle(image, corners, one.color, thick, one.is_dashed)


def _rectangle(
    image: Image, corners: Sequence[int], color: Color, thick: int, is_dashed: bool
) -> None:
    import cv2

    left, top, right, bottom = corners
    if not is_dashed:
        cv2.rectangle(image, (left, top), (right, bottom), color, thick, cv2.LINE_AA)
        return
    sides = (
        ((left, top), (right, top)),
        ((right, top), (right, bottom)),
        ((right, bottom), (left, bottom)),
        ((left, bottom), (left, top)),
    )
    for start, end in sides:
        for first, last in _dashes(np.array(start), np.array(end), 4 * thick, image.shape):
            cv2.line(image, first, last, color, thick, cv2.LINE_AA)


def _dashes(
    start: "np.ndarray[tuple[int, ...], np.dtype[np.int_]]",
    end: "np.ndarray[tuple[int, ...], np.dtype[np.int_]]",
    length: int,
    shape: tuple[int, ...],
) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Dashes along a side, whole at both corners; only those that an image of `shape` can show."""
    total = int(np.abs(end - start).sum())
    count = max(1, round((total / length - 1) / 1.7))
    if total <= length:
        return [(tuple(start.tolist()), tuple(end.tolist()))]
    direction = (end - start) / total
    gap = (total - length) / count
    limit = np.array([shape[1], shape[0]])
    places = np.round(start + direction * (np.arange(count + 1) * gap)[:, None]).astype(int)
    ends = np.round(places + direction * length).astype(int)
    seen = (np.maximum(places, ends) >= -length) & (np.minimum(places, ends) <= limit + length)
    return [
        (tuple(first), tuple(last))
        for first, last in zip(
            places[seen.all(axis=1)].tolist(), ends[seen.all(axis=1)].tolist(), strict=True
        )
    ]


def write_lines(image: Image, lines: Iterable[str], thick: int) -> None:
    """Write lines of text, white on a dark edge, into the upper left corner of an image."""
    import cv2

    scale = max(0.4, min(image.shape[:2]) / 720)
    for number, line in enumerate(lines, 1):
        place = (round(10 * scale), round(26 * scale * number))
        for color, width in ((BLACK, 3 * thick), (WHITE, thick)):
            cv2.putText(
                image, line, place, cv2.FONT_HERSHEY_SIMPLEX, scale, color, width, cv2.LINE_AA
            )
