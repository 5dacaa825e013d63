"""Buildings: boxes with facades of lit and dark windows, shops and signs."""

from dataclasses import dataclass

import numpy as np

from nat2024.night.arrays import Colour, Light, Points, colour, log_uniform
from nat2024.night.camera import Camera
from nat2024.night.lamps import lamp_colour
from nat2024.types import Flags

_FLOOR = 3.2
"""Height of a storey in metres."""


@dataclass(frozen=True, slots=True)
class Building:
    """A box on the ground.

    Attributes:
        box: (x0, y0, x1, y1) of its footprint in metres.
        height: in metres.
        facades: light of its four sides, south, east, north, west: float32 (h, w, 3), the first
            row at the top.
        roof: light of its roof, BGR.
    """

    box: tuple[float, float, float, float]
    height: float
    facades: tuple[Light, Light, Light, Light]
    roof: Colour

    @property
    def footprint(self) -> Points:
        """(4, 2) corners, south west first, anticlockwise seen from above."""
        x0, y0, x1, y1 = self.box
        return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]], dtype=np.float64)

    def corners(self) -> Points:
        """(8, 3) corners of foot and top."""
        flat = self.footprint
        low, high = np.zeros((4, 1)), np.full((4, 1), self.height)
        return np.concatenate([np.hstack([flat, low]), np.hstack([flat, high])])


def make_building(
    rng: np.random.Generator,
    box: tuple[float, float, float, float],
    height: float,
    ambient: Colour,
    photograph: Light | None = None,
) -> Building:
    """A building with windows, perhaps with shops at its foot and a sign.

    Args:
        rng: where chance comes from.
        box: (x0, y0, x1, y1) of its footprint in metres.
        height: in metres.
        ambient: light that falls on it.
        photograph: reflectance that its walls take their pattern from.
    """
    x0, y0, x1, y1 = box
    wall = np.float32(rng.uniform(0.15, 0.4)) * colour(0.9, 0.97, 1.0)
    tint = lamp_colour(rng)
    share = float(rng.uniform(0.08, 0.45))
    facades = []
    for width in (x1 - x0, y1 - y0, x1 - x0, y1 - y0):
        facade = _facade(rng, width, height, wall * ambient, tint, share)
        if photograph is not None:
            facade += _pattern(photograph, facade.shape) * ambient
        facades.append(facade)
    south, east, north, west = facades
    return Building(box, height, (south, east, north, west), wall * ambient * np.float32(0.7))


def _pattern(photograph: Light, shape: tuple[int, ...]) -> Light:
    import cv2

    size = (shape[1], shape[0])
    return np.asarray(cv2.resize(photograph, size, interpolation=cv2.INTER_AREA), np.float32)


def _facade(
    rng: np.random.Generator, width: float, height: float, wall: Colour, tint: Colour, share: float
) -> Light:
    """Windows in a grid of storeys, lit from the street at its foot."""
    import cv2

    scale = 5
    columns, rows = max(2, int(width * scale)), max(2, int(height * scale))
    facade = np.empty((rows, columns, 3), dtype=np.float32)
    foot = np.exp(-np.arange(rows, dtype=np.float32)[::-1] / (3.0 * scale))
    facade[:] = wall * (1 + np.float32(rng.uniform(0, 8)) * foot[:, None, None])
    step = int(rng.integers(11, 18))
    storey = round(_FLOOR * scale)
    for y in range(rows - 2 * storey, 0, -storey):
        for x in range(3, columns - step, step):
            if rng.random() < share:
                light = (0.6 * tint + 0.4 * lamp_colour(rng)) * np.float32(
                    log_uniform(rng, 0.1, 1.6)
                )
            else:
                light = wall * np.float32(0.25)
            cv2.rectangle(facade, (x, y), (x + step - 5, y + storey - 7), light.tolist(), -1)
    if rng.random() < 0.45:
        _shops(rng, facade, storey)
    if rng.random() < 0.4 and rows > 3 * storey:
        _sign(rng, facade)
    return facade


def _shops(rng: np.random.Generator, facade: Light, storey: int) -> None:
    """Lit shop windows of several colours along the foot."""
    rows, columns = facade.shape[:2]
    x = 0
    while x < columns:
        width = int(rng.integers(12, 40))
        if rng.random() < 0.7:
            light = lamp_colour(rng) * np.float32(log_uniform(rng, 0.3, 3.0))
            facade[rows - storey + 4 : rows - 3, x + 1 : x + width - 1] = light
        x += width


def _sign(rng: np.random.Generator, facade: Light) -> None:
    """Luminous letters: blocks of random strokes."""
    rows, columns = facade.shape[:2]
    letters = int(rng.integers(2, 6))
    cell = max(2, min(rows // 14, columns // (6 * letters)))
    light = lamp_colour(rng) * np.float32(log_uniform(rng, 1.0, 6.0))
    strokes = rng.random((5, letters * 6)) < 0.5
    strokes[:, 5::6] = False
    grid = np.kron(strokes, np.ones((cell, cell), dtype=bool))
    top, left = rows // 12 + 1, max(0, (columns - grid.shape[1]) // 2)
    part = facade[top : top + grid.shape[0], left : left + grid.shape[1]]
    part[grid[: part.shape[0], : part.shape[1]]] = light


def draw_building(frame: Light, building: Building, camera: Camera) -> None:
    """Draw a building into a frame, in place: its sides that face the camera, then its roof."""
    pixels, depth = camera.project(building.corners())
    if depth.min() < 1 or not _in_frame(pixels, camera.size):
        return
    for number, facade in enumerate(building.facades):
        a, b = number, (number + 1) % 4
        quad = pixels[[a + 4, b + 4, b, a]]
        if _area(quad) > 0.5:
            _warp(frame, facade, quad)
    _fill(frame, pixels[4:], building.roof)


def _in_frame(pixels: Points, size: tuple[int, int]) -> bool:
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    near = bool((high - low).max() < 12 * max(size))
    return near and bool((high > 0).all() and (low < size).all())


def _area(quad: Points) -> float:
    """Signed area in pixels, positive where the corners run clockwise on the screen."""
    (ax, ay), (bx, by) = (quad[2] - quad[0]).tolist(), (quad[3] - quad[1]).tolist()
    return float(0.5 * (ax * by - ay * bx))


def _window(points: Points, size: tuple[int, int]) -> tuple[int, int, int, int] | None:
    """The part of the frame around points: x0, y0, x1, y1."""
    low = np.maximum(np.floor(points.min(axis=0)).astype(int), 0)
    high = np.minimum(np.ceil(points.max(axis=0)).astype(int) + 1, size)
    if (low >= high).any():
        return None
    return int(low[0]), int(low[1]), int(high[0]), int(high[1])


def _warp(frame: Light, picture: Light, quad: Points) -> None:
    import cv2

    window = _window(quad, (frame.shape[1], frame.shape[0]))
    if window is None:
        return
    x0, y0, x1, y1 = window
    extent = np.ptp(quad, axis=0)
    shrink = max(
        1.0, min(picture.shape[1] / max(extent[0], 1), picture.shape[0] / max(extent[1], 1))
    )
    if shrink > 1.5:  # windows far away run together instead of flickering
        smaller = (max(2, int(picture.shape[1] / shrink)), max(2, int(picture.shape[0] / shrink)))
        picture = np.asarray(cv2.resize(picture, smaller, interpolation=cv2.INTER_AREA))
    rows, columns = picture.shape[:2]
    source = np.array([[0, 0], [columns, 0], [columns, rows], [0, rows]], np.float32) - 0.5
    target = (quad - (x0, y0) - 0.5).astype(np.float32)
    matrix = cv2.getPerspectiveTransform(source.astype(np.float32), target)
    size = (x1 - x0, y1 - y0)
    drawn = cv2.warpPerspective(
        picture, matrix, size, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    cover = soft_mask(quad - (x0, y0), size)[..., None]
    part = frame[y0:y1, x0:x1]
    part *= 1 - cover
    part += drawn * cover


def _fill(frame: Light, points: Points, light: Colour) -> None:
    window = _window(points, (frame.shape[1], frame.shape[0]))
    if window is None:
        return
    x0, y0, x1, y1 = window
    cover = soft_mask(points - (x0, y0), (x1 - x0, y1 - y0))[..., None]
    part = frame[y0:y1, x0:x1]
    part *= 1 - cover
    part += cover * light


def soft_mask(points: Points, size: tuple[int, int]) -> Light:
    """Coverage of a convex polygon, float32 (height, width) 0..1, smooth at the edges."""
    import cv2

    mask = np.zeros((size[1], size[0]), dtype=np.uint8)
    fine = np.rint(np.clip(points - 0.5, -2000, 4000) * 16).astype(np.int32)
    cv2.fillConvexPoly(mask, fine, 255, cv2.LINE_AA, 4)
    return mask.astype(np.float32) / np.float32(255)


def hides(building: Building, camera: Camera, places: Points) -> Flags:
    """Which places on the ground have the building on their way to the camera, bool (n,)."""
    x0, y0, x1, y1 = building.box
    eye = np.array(camera.position[:2])
    ray = eye - places[:, :2]
    ray = np.where(np.abs(ray) < 1e-9, 1e-9, ray)
    a = (np.array([x0, y0]) - places[:, :2]) / ray
    b = (np.array([x1, y1]) - places[:, :2]) / ray
    enter, leave = np.minimum(a, b).max(axis=1), np.maximum(a, b).min(axis=1)
    return np.asarray((enter < leave) & (leave > 0) & (enter < 1))


def hull_in(building: Building, camera: Camera) -> Points:
    """The building's outline in the frame, (n, 2) in pixels."""
    import cv2

    pixels, _ = camera.project(building.corners())
    outline = cv2.convexHull(np.clip(pixels, -4000, 8000).astype(np.float32))[:, 0]
    return np.asarray(outline, dtype=np.float64)
