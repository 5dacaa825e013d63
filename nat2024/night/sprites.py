"""Drawing bodies: each on a small fine canvas of its own, then laid into the frame.

The canvas has several samples a pixel, so edges are smooth and a target's mask is exact to a
fraction of a pixel; movement while the shutter is open smears colour and coverage, not the mask.
"""

import functools
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from nat2024.night.arrays import Colour, Light, Points
from nat2024.night.bodies import Body, Limb, Prism
from nat2024.night.camera import Camera
from nat2024.types import Floats

_FINEST = 4
_MOST = 900
"""Widest canvas in samples."""

_SIDES = ((0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))
_SHADE = (0.5, 0.65, 0.5, 0.4)
"""Light on the right side, front, left side and back of a solid, as a share of that from above."""


@dataclass(frozen=True, slots=True)
class Sprite:
    """A drawn body.

    Attributes:
        corner: (x, y) of its first pixel in the frame; may lie outside.
        colour: float32 (h, w, 3), light that it sends, times its coverage.
        cover: float32 (h, w), share of each pixel that it covers.
        mask: bool (h * samples, w * samples), where the body itself is, unsmeared.
        samples: samples of `mask` a pixel.
    """

    corner: tuple[int, int]
    colour: Light
    cover: Light
    mask: npt.NDArray[np.bool_]
    samples: int


def pose(place: Floats, heading: float) -> Floats:
    """The (3, 4) matrix from a body's own metres to the world's."""
    sin, cos = np.sin(heading), np.cos(heading)
    return np.array([[sin, -cos, 0, place[0]], [cos, sin, 0, place[1]], [0, 0, 1, 0.0]])


def draw_body(
    body: Body,
    camera: Camera,
    place: Floats,
    heading: float,
    light: Colour,
    phase: float = 0.0,
    motion: tuple[float, float] = (0.0, 0.0),
) -> Sprite | None:
    """Draw a body as a camera sees it; None where it is outside the frame.

    Args:
        body: what.
        camera: the view.
        place: (2,) metres on the ground.
        heading: direction of its front, radians from the y axis towards the x axis.
        light: irradiance at its place, BGR.
        phase: of its step, radians.
        motion: how far it moves in the frame while the shutter is open, in pixels.
    """
    matrix = pose(place, heading)
    canvas = _Canvas.around(body, camera, matrix, motion)
    if canvas is None:
        return None
    for prism in body.prisms:
        canvas.prism(prism, light)
    limbs = body.limbs(phase)
    for limb in sorted(limbs, key=lambda one: one.start[2] + one.end[2]):
        canvas.limb(limb, light)
    return canvas.finish(motion)


class _Canvas:
    """Colours and mask while a body is being drawn."""

    def __init__(
        self, camera: Camera, matrix: Floats, corner: tuple[int, int], size: tuple[int, int]
    ) -> None:
        self.camera = camera
        self.matrix = matrix
        self.corner = corner
        self.samples = max(1, min(_FINEST, _MOST // max(size)))
        shape = (size[1] * self.samples, size[0] * self.samples)
        self.colour = np.zeros((*shape, 3), dtype=np.float32)
        self.mask = np.zeros(shape, dtype=np.uint8)

    @classmethod
    def around(
        cls, body: Body, camera: Camera, matrix: Floats, motion: tuple[float, float]
    ) -> "_Canvas | None":
        """A canvas that holds the whole body, where at least part of it can be in the frame."""
        length, width, height = (v / 2 for v in body.size)
        grown = 1.25 if body.gait else 1.08
        x, y = length * grown + 0.15, width * grown + 0.15
        box = np.array([(a, b, c) for a in (-x, x) for b in (-y, y) for c in (0, 2 * height + 0.3)])
        pixels, depth = camera.project(box @ matrix[:, :3].T + matrix[:, 3])
        spare = 2 + int(max(abs(motion[0]), abs(motion[1])))
        low = np.floor(pixels.min(axis=0)).astype(int) - spare
        high = np.ceil(pixels.max(axis=0)).astype(int) + spare
        outside = (high <= 0).any() or (low >= camera.size).any()
        if outside or depth.min() < 1 or (high - low).max() > 4 * max(camera.size):
            return None
        size = high - low
        return cls(camera, matrix, (int(low[0]), int(low[1])), (int(size[0]), int(size[1])))

    def place(self, points: Points) -> Floats:
        """Where points of the body lie on the canvas, in samples from the centre of the first."""
        pixels, _ = self.camera.project(points @ self.matrix[:, :3].T + self.matrix[:, 3])
        return np.asarray((pixels - self.corner) * self.samples - 0.5)

    def prism(self, prism: Prism, light: Colour) -> None:
        corners = self.place(prism.corners())
        for numbers, shade in zip(_SIDES, _SHADE, strict=True):
            face = corners[list(numbers)]
            if _turns_left(face):
                continue
            self.polygon(face, prism.sides * light * np.float32(shade))
            if prism.band:
                self._windows(face, prism.band)
        self.polygon(corners[4:], prism.albedo * light)

    def _windows(self, face: Floats, band: float) -> None:
        """A band of lit windows across a side, between posts."""
        foot_start, foot_end, top_end, top_start = face
        count = max(1, round(float(np.linalg.norm(foot_end - foot_start)) / self.samples / 6))
        for number in range(count):
            edges = (number + 0.12) / count, (number + 0.88) / count
            corners = []
            for across, up in ((0, 0.5), (1, 0.5), (1, 0.85), (0, 0.85)):
                low = foot_start + edges[across] * (foot_end - foot_start)
                high = top_start + edges[across] * (top_end - top_start)
                corners.append(low + up * (high - low))
            tint = np.array([0.75, 0.95, 1.0], dtype=np.float32) * np.float32(band)
            self.polygon(np.array(corners), tint)

    def polygon(self, points: Floats, tint: Colour) -> None:
        import cv2

        fine = np.rint(points * 16).astype(np.int32)
        cv2.fillConvexPoly(self.colour, fine, tint.tolist(), cv2.LINE_8, 4)
        cv2.fillConvexPoly(self.mask, fine, 255, cv2.LINE_8, 4)

    def limb(self, limb: Limb, light: Colour) -> None:
        import cv2

        ends = np.array([limb.start, limb.end], dtype=np.float64)
        world = ends @ self.matrix[:, :3].T + self.matrix[:, 3]
        _, depth = self.camera.project(world)
        scale = self.camera.focal / float(depth.mean()) * self.samples
        thickness = max(1, round(limb.width * scale))
        start, end = (tuple(p) for p in np.rint(self.place(ends) * 16).astype(int).tolist())
        tint = (limb.albedo * light * np.float32(0.6)).tolist()
        cv2.line(self.colour, start, end, tint, thickness, cv2.LINE_8, 4)
        cv2.line(self.mask, start, end, 255, thickness, cv2.LINE_8, 4)

    def finish(self, motion: tuple[float, float]) -> Sprite:
        import cv2

        height, width = (side // self.samples for side in self.mask.shape)
        tint = cv2.resize(self.colour, (width, height), interpolation=cv2.INTER_AREA)
        cover = cv2.resize(self.mask, (width, height), interpolation=cv2.INTER_AREA)
        cover = cover.astype(np.float32) / np.float32(255)
        kernel = line_kernel(motion)
        if kernel is not None:
            tint, cover = cv2.filter2D(tint, -1, kernel), cv2.filter2D(cover, -1, kernel)
        return Sprite(
            self.corner,
            np.asarray(tint, dtype=np.float32),
            np.asarray(cover, dtype=np.float32),
            self.mask > 0,
            self.samples,
        )


def _turns_left(face: Floats) -> bool:
    """Whether a side is seen from behind: its corners then turn the other way."""
    (ax, ay), (bx, by) = face[1] - face[0], face[2] - face[0]
    return bool(ax * by - ay * bx >= 0)


def line_kernel(motion: tuple[float, float]) -> Light | None:
    """The smear of a straight movement in pixels; None where it is under 0.7 of one."""
    x, y = motion
    if max(abs(x), abs(y)) < 0.7:
        return None
    return _line(round(2 * x) / 2, round(2 * y) / 2)


@functools.lru_cache(maxsize=512)
def _line(x: float, y: float) -> Light:
    reach = max(abs(x), abs(y))
    half = int(np.ceil(reach / 2))
    kernel = np.zeros((2 * half + 1, 2 * half + 1), dtype=np.float32)
    for share in np.linspace(-0.5, 0.5, 4 * half + 3):
        column, row = half + share * x, half + share * y
        left, top = int(np.floor(column)), int(np.floor(row))
        for c, r in ((left, top), (left + 1, top), (left, top + 1), (left + 1, top + 1)):
            if c < kernel.shape[1] and r < kernel.shape[0]:
                kernel[r, c] += (1 - abs(column - c)) * (1 - abs(row - r))
    return np.asarray(kernel / kernel.sum(), dtype=np.float32)


def overlap(
    corner: tuple[int, int], shape: tuple[int, ...], size: tuple[int, int]
) -> tuple[tuple[slice, slice], tuple[slice, slice]] | None:
    """Where a small picture meets the frame: slices of the frame and of the picture, if it does.

    Args:
        corner: (x, y) of the picture's first pixel in the frame.
        shape: (height, width, ...) of the picture.
        size: (width, height) of the frame.
    """
    x0, y0 = max(corner[0], 0), max(corner[1], 0)
    x1, y1 = min(corner[0] + shape[1], size[0]), min(corner[1] + shape[0], size[1])
    if x0 >= x1 or y0 >= y1:
        return None
    inner = (slice(y0 - corner[1], y1 - corner[1]), slice(x0 - corner[0], x1 - corner[0]))
    return (slice(y0, y1), slice(x0, x1)), inner


def lay(frame: Light, sprite: Sprite, keep: Light | None = None) -> None:
    """Lay a sprite over a frame, in place.

    Args:
        frame: float32 (H, W, 3); changed.
        sprite: what to lay.
        keep: float32 (h, w) as its cover: share of it that nothing hides, None for all.
    """
    found = overlap(sprite.corner, sprite.cover.shape, (frame.shape[1], frame.shape[0]))
    if found is None:
        return
    outer, inner = found
    cover, tint = sprite.cover[inner][..., None], sprite.colour[inner]
    if keep is not None:
        cover, tint = cover * keep[inner][..., None], tint * keep[inner][..., None]
    part = frame[outer]
    part *= 1 - cover
    part += tint


def add_spot(
    frame: Light, x: float, y: float, sigma: float, light: Colour, tall: float = 1.0
) -> None:
    """Add a round spot of light at a place in pixels, in place; `tall` stretches it upright."""
    reach, rise = int(np.ceil(3 * sigma)) + 1, int(np.ceil(3 * sigma * tall)) + 1
    corner, shape = (int(x) - reach, int(y) - rise), (2 * rise + 1, 2 * reach + 1)
    found = overlap(corner, shape, (frame.shape[1], frame.shape[0]))
    if found is None:
        return
    (rows, columns), _ = found
    across = np.exp(-(((np.arange(columns.start, columns.stop) + 0.5 - x) / sigma) ** 2) / 2)
    down = np.exp(-(((np.arange(rows.start, rows.stop) + 0.5 - y) / (sigma * tall)) ** 2) / 2)
    spot = (down[:, None] * across).astype(np.float32)
    frame[rows, columns] += spot[..., None] * light
