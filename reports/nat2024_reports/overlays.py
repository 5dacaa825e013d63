"""Boxes drawn into frames."""

import numpy as np

from nat2024.types import Box, Image

FOUND, TRUTH = (0, 158, 230), (115, 158, 0)
"""Colours of the tracker's box and of the reference, BGR: orange and green of Okabe and Ito."""


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
    import cv2

    drawn = frame.copy()
    thick = max(1, round(min(frame.shape[:2]) / 240))
    for box, color in ((truth, TRUTH), (found, FOUND)):
        if box is None or not np.isfinite(box).all():
            continue
        corners = np.clip(np.round([*box[:2], *(box[:2] + box[2:])]), -1e5, 1e5).astype(int)
        cv2.rectangle(drawn, corners[:2].tolist(), corners[2:].tolist(), color, thick, cv2.LINE_AA)
    scale = max(0.4, min(frame.shape[:2]) / 720)
    for number, line in enumerate(lines, 1):
        place = (round(10 * scale), round(26 * scale * number))
        for color, width in (((0, 0, 0), 3 * thick), ((255, 255, 255), thick)):
            cv2.putText(
                drawn, line, place, cv2.FONT_HERSHEY_SIMPLEX, scale, color, width, cv2.LINE_AA
            )
    return drawn
