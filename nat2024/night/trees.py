"""Trees: crowns of leaves with gaps, which cover what stands behind or below them."""

from dataclasses import dataclass

import numpy as np

from nat2024.night.arrays import Colour, Light, Points, colour, smooth_noise
from nat2024.night.camera import Camera
from nat2024.night.sprites import Sprite, line_kernel

_FINE = 96
KINDS = 6
"""Number of different crowns."""


@dataclass(frozen=True, slots=True)
class Tree:
    """A tree.

    Attributes:
        place: (x, y) of its foot in metres.
        height: of the middle of its crown.
        radius: of its crown.
        kind: number of its crown's picture.
        albedo: of its leaves.
    """

    place: tuple[float, float]
    height: float
    radius: float
    kind: int
    albedo: Colour

    @property
    def middle(self) -> Points:
        """(1, 3) the middle of its crown."""
        return np.array([[*self.place, self.height]])


def make_tree(rng: np.random.Generator, x: float, y: float, height: float, radius: float) -> Tree:
    """A tree at a place, its leaves by chance."""
    green = colour(0.03, 0.075, 0.06) * np.float32(rng.uniform(0.6, 1.5))
    return Tree((x, y), height, radius, int(rng.integers(KINDS)), green)


def crowns(rng: np.random.Generator) -> tuple[tuple[Light, Light], ...]:
    """Pictures of crowns: shade (h, w) about 1 and cover (h, w) 0..1, float32."""
    rows, columns = np.mgrid[0:_FINE, 0:_FINE].astype(np.float32) / (_FINE / 2) - 1 + 1 / _FINE
    made = []
    for _ in range(KINDS):
        leaves = sum(
            share * smooth_noise(rng, (_FINE, _FINE), scale)
            for scale, share in ((24, 0.16), (8, 0.12), (3, 0.1))
        )
        edge = 0.86 + leaves - np.hypot(rows, columns)
        cover = np.clip(edge * 9, 0, 1)
        shade = np.exp(0.45 * smooth_noise(rng, (_FINE, _FINE), 4) - 0.5 * rows)
        made.append((shade.astype(np.float32), cover.astype(np.float32)))
    return tuple(made)


def draw_tree(
    tree: Tree,
    camera: Camera,
    light: Colour,
    picture: tuple[Light, Light],
    motion: tuple[float, float],
) -> Sprite | None:
    """Draw a crown as the camera sees it; None where it is outside the frame."""
    import cv2

    pixels, depth = camera.project(tree.middle)
    if depth[0] < 2:
        return None
    (x, y), radius = pixels[0], camera.focal / depth[0] * tree.radius
    width, height = camera.size
    inside = -radius < x < width + radius and -radius < y < height + radius
    if not inside or radius < 1:
        return None
    left, top = int(np.floor(x - radius)) - 1, int(np.floor(y - radius)) - 1
    side = int(np.ceil(2 * radius)) + 3
    scale = 2 * radius / _FINE
    matrix = np.array(
        [
            [scale, 0, x - radius - left + 0.5 * scale - 0.5],
            [0, scale, y - radius - top + 0.5 * scale - 0.5],
        ]
    )
    shade = cv2.warpAffine(picture[0], matrix, (side, side), borderMode=cv2.BORDER_REPLICATE)
    cover = cv2.warpAffine(picture[1], matrix, (side, side))
    tint = (shade * cover)[..., None] * (tree.albedo * light)
    kernel = line_kernel(motion)
    if kernel is not None:
        tint, cover = cv2.filter2D(tint, -1, kernel), cv2.filter2D(cover, -1, kernel)
    return Sprite((left, top), tint, np.asarray(cover, np.float32), np.asarray(cover > 0.5), 1)
