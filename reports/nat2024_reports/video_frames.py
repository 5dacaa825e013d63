"""Frames of a video that shows what several runs did: panels, insets, a legend with overlaps."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from nat2024.types import Box, Image
from nat2024_reports.figures.looks import Look
from nat2024_reports.framing import choose_view, cut_view, place_box
from nat2024_reports.overlays import WHITE, Color, DrawnBox, bgr, draw_into, edge_of, write_lines
from nat2024_reports.style import shortened

WIDEST = 1280
"""Of a video, in pixels."""

_GROUND = (24, 24, 24)
_MISSING = (70, 70, 70)
_LETTERS = 0.42  # of OpenCV's own size
_LINE_ROOM = 48  # pixels of the legend before a name
_OVERLAP_ROOM = 52  # pixels behind it
_ROW = 24  # pixels of one line of the legend
_LEAST_ENTRY = 236  # pixels of one entry of the legend
_INSET = 0.34  # side of an inset over the height of its panel
_INSET_SIDES = 2.6  # side of what it shows over the size of the target
_MAGNIFIED = 1.4  # an inset that magnifies less shows nothing new


@dataclass(frozen=True, slots=True)
class Scene:
    """What one frame of the video shows.

    Attributes:
        number: 0-based, of the frame.
        panels: uint8 (H, W, 3) BGR by what they are, such as `original`; None where there is no
            image. All of one size.
        truth: x, y, w, h in pixels of the frame, None where not known.
        boxes: by run, None where it gave none.
        overlaps: by run, NaN where the truth is not known.
    """

    number: int
    panels: Mapping[str, Image | None]
    truth: Box | None = None
    boxes: Mapping[str, Box | None] = field(default_factory=dict)
    overlaps: Mapping[str, float] = field(default_factory=dict)


def panel_size(frame_size: tuple[int, int], panels: int, widest: int = WIDEST) -> tuple[int, int]:
    """Width and height of each of `panels` pictures side by side: even, never enlarged."""
    scale = min(1.0, widest / (panels * frame_size[0]))
    width, height = (max(2, int(side * scale / 2 + 1e-9) * 2) for side in frame_size)
    return width, height


def video_size(
    frame_size: tuple[int, int], panels: int, looks: Mapping[str, Look]
) -> tuple[int, int]:
    """Width and height of the frames that `video_frame` makes, both even."""
    width, height = panel_size(frame_size, panels)
    return panels * width, height + _legend_height(panels * width, looks)


def video_frame(
    scene: Scene, looks: Mapping[str, Look], frame_size: tuple[int, int], *, inset: bool = True
) -> Image:
    """One frame, uint8 BGR of `video_size`.

    Args:
        scene: what is shown.
        looks: by run; these are in the legend.
        frame_size: (width, height) of the frames of the sequence.
        inset: magnify the target in a corner of each panel.
    """
    size = panel_size(frame_size, len(scene.panels))
    boxes = _drawn_boxes(scene, looks)
    panels = [
        _panel(title, image, boxes, scene, size, frame_size, inset=inset)
        for title, image in scene.panels.items()
    ]
    picture = np.concatenate(panels, axis=1)
    return np.concatenate([picture, _legend(scene, looks, picture.shape[1])])


def _drawn_boxes(scene: Scene, looks: Mapping[str, Look]) -> list[DrawnBox]:
    boxes = [] if scene.truth is None else [DrawnBox(scene.truth, WHITE)]
    for run, look in looks.items():
        box = scene.boxes.get(run)
        if box is not None:
            boxes.append(DrawnBox(box, bgr(look.color), look.is_dashed))
    return boxes


def _panel(
    title: str,
    image: Image | None,
    boxes: Sequence[DrawnBox],
    scene: Scene,
    size: tuple[int, int],
    frame_size: tuple[int, int],
    *,
    inset: bool,
) -> Image:
    lines = (f"#{scene.number:04d}", *([_ascii(title)] if title else []))
    if image is None:
        panel = np.full((size[1], size[0], 3), _MISSING, dtype=np.uint8)
        write_lines(panel, (*lines, "no image"), 1)
        return panel
    whole = np.array([0.0, 0.0, image.shape[1], image.shape[0]])
    panel = np.ascontiguousarray(cut_view(image, whole, size))
    thick = max(1, round(min(size) / 300))
    draw_into(panel, _placed(boxes, np.array([0.0, 0.0, *frame_size]), size), thick, halo=True)
    if inset and scene.truth is not None:
        _add_inset(panel, image, boxes, scene.truth, frame_size)
    write_lines(panel, lines, thick)
    return panel


def _placed(boxes: Iterable[DrawnBox], view: Box, size: tuple[int, int]) -> list[DrawnBox]:
    return [DrawnBox(place_box(b.box, view, size), b.color, b.is_dashed) for b in boxes]


def _add_inset(
    panel: Image,
    image: Image,
    boxes: Sequence[DrawnBox],
    truth: Box,
    frame_size: tuple[int, int],
) -> None:
    """Magnify the target in the upper right corner, or the upper left where it is there itself."""
    height, width = panel.shape[:2]
    side = round(_INSET * height)
    view = choose_view(frame_size, truth, aspect=1.0, sides=_INSET_SIDES)
    if side < 48 or side / view[2] < _MAGNIFIED * width / frame_size[0]:
        return  # the target is large enough as it is
    inset = np.ascontiguousarray(cut_view(image, view, (side, side)))
    draw_into(inset, _placed(boxes, view, (side, side)), 2, halo=True)
    inset[:2] = inset[-2:] = inset[:, :2] = inset[:, -2:] = WHITE
    centre = (truth[:2] + truth[2:] / 2) * width / frame_size[0]
    is_there = centre[0] > width - side - 8 and centre[1] < side + 8
    left = 8 if is_there else width - side - 8
    top = height - side - 8 if is_there else 8
    panel[top : top + side, left : left + side] = inset


def _legend_columns(width: int, looks: Mapping[str, Look]) -> int:
    """As many as have room for the longest name."""
    widest = max((_text_width(_ascii(look.label)) for look in looks.values()), default=0)
    return max(1, width // max(_LEAST_ENTRY, _LINE_ROOM + widest + _OVERLAP_ROOM))


def _legend_height(width: int, looks: Mapping[str, Look]) -> int:
    return _ROW * -(-(len(looks) + 1) // _legend_columns(width, looks)) + 8


def _text_width(text: str) -> int:
    import cv2

    (width, _), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, _LETTERS, 1)
    return int(width)


def _fitting(label: str, room: int) -> str:
    """A name of the legend, its middle left out where even one column is too narrow for it."""
    length = len(label)
    while length > 3 and _text_width(_ascii(shortened(label, length))) > room:
        length -= 1
    return _ascii(shortened(label, length))


def _legend(scene: Scene, looks: Mapping[str, Look], width: int) -> Image:
    import cv2

    legend = np.full((_legend_height(width, looks), width, 3), _GROUND, dtype=np.uint8)
    columns = _legend_columns(width, looks)
    entries: list[tuple[str, Color, bool]] = [("Ground truth", WHITE, False)]
    room = width // columns - _LINE_ROOM - _OVERLAP_ROOM
    for run, look in looks.items():
        text = f"{_fitting(look.label, room)}{_told(scene, run)}"
        entries.append((text, bgr(look.color), look.is_dashed))
    for number, (text, color, is_dashed) in enumerate(entries):
        row, column = divmod(number, columns)
        left, middle = round(column * width / columns) + 10, 4 + _ROW * row + _ROW // 2
        for start in range(left, left + 30, 11 if is_dashed else 30):
            end = min(left + 30, start + (7 if is_dashed else 30))
            for shade, thick in ((edge_of(color), 5), (color, 3)):
                cv2.line(legend, (start, middle), (end, middle), shade, thick, cv2.LINE_AA)
        cv2.putText(
            legend,
            text,
            (left + 38, middle + 5),
            cv2.FONT_HERSHEY_SIMPLEX,
            _LETTERS,
            WHITE,
            1,
            cv2.LINE_AA,
        )
    return legend


def _told(scene: Scene, run: str) -> str:
    overlap = scene.overlaps.get(run, math.nan)
    return "" if math.isnan(overlap) else f"  {overlap:.2f}"


def _ascii(text: str) -> str:
    """Text that OpenCV's fonts can show."""
    return text.replace(r"\$", "$").replace("…", "..").encode("ascii", "replace").decode()
