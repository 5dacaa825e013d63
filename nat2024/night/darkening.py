"""Night out of day: the light of a night on frames that were taken in daylight.

A frame is read as reflectance, lit by a weak ambient light and by lamps that stand on the ground,
exposed to a wanted mean grey level, and given the noise, tone curve and black level of a night
camera. Lamps keep to the ground: the camera's movement is followed from frame to frame by the
shift, turn and scale that most of the picture shares, so a moving target passes through pools of
light. What cannot be known from a picture is left out: no shadow, no light that is shut off by
what stands on the ground, no head light.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from nat2024.errors import ArrayContract, UsageError
from nat2024.night.arrays import Colour, Light, log_uniform
from nat2024.night.lamps import ambient_light, lamp_colour
from nat2024.night.sensor import Development, Sensor, draw_sensor, expose
from nat2024.night.sprites import add_spot
from nat2024.types import Floats, Image

LEVELS = (0.03, 0.5)
"""Lowest and highest mean grey level 0..1 that can be asked for."""

_CELL = 0.6
"""Distance of lamps in frame widths."""

_COARSE = 8
_TRACKED = 320
_MOST_ZOOM = 3.0


@dataclass(frozen=True, slots=True)
class _Pool:
    """A lamp over the ground, lengths in pixels of the first frame."""

    x: float
    y: float
    radius: float
    power: float
    strength: float
    tint: Colour
    head: float
    size: float


class Darkening:
    """One daytime sequence on its way into the night, at several light levels at once.

    Frames are given in order, each once. Everything follows from the seed; levels differ in their
    exposure only, so their frames show the same lamps and the same noise pattern.
    """

    def __init__(self, levels: Sequence[float], seed: int = 0) -> None:
        """Choose the lamps.

        Args:
            levels: mean grey levels 0..1 that the first frame gets.
            seed: of lamps, camera and noise.

        Raises:
            UsageError: no level, or one outside of `LEVELS`.
        """
        wrong = [level for level in levels if not LEVELS[0] <= level <= LEVELS[1]]
        if wrong or not levels:
            got = f"{wrong[0]:g}" if wrong else "none"
            msg = f"light levels are mean grey levels from {LEVELS[0]} to {LEVELS[1]}, not {got}"
            raise UsageError(msg)
        self.levels = tuple(levels)
        self._seed = seed
        rng = np.random.default_rng([seed, 7])
        self._ambient = ambient_light(rng) * np.float32(1.6)
        self._tint = lamp_colour(rng)
        self._sensor = draw_sensor(rng)
        self._gain = 0.0
        self._to_first = np.eye(3)
        self._before: Image | None = None
        self._developments: list[Development] = []
        self._shape: tuple[int, ...] = ()
        self._index = 0

    @property
    def sensor(self) -> Sensor:
        """The camera, before it is exposed for a level."""
        return self._sensor

    def darken(self, image: Image) -> list[Image]:
        """The next frame at every level, uint8 (H, W, 3) BGR in the order of the levels.

        Raises:
            ArrayContract: the image is none, or of another size than the first.
        """
        if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3 or not image.size:
            msg = f"image must be uint8 of shape (H, W, 3), not {image.dtype} {image.shape}"
            raise ArrayContract(msg)
        self._follow(image)
        light = self._light(image)
        if not self._developments:
            self._expose(light)
        if light.shape[:2] != self._shape:
            msg = f"frame {self._index} is {image.shape[1]}x{image.shape[0]}, the first is not"
            raise ArrayContract(msg)
        made = [one.develop(light, self._index) for one in self._developments]
        self._index += 1
        return made

    def _expose(self, light: Light) -> None:
        self._shape = light.shape[:2]
        size = (light.shape[1], light.shape[0])
        step = light[::2, ::2]
        for level in self.levels:
            exposed = expose(self._sensor, [step], level)
            self._developments.append(Development(exposed, size, self._seed))

    def _follow(self, image: Image) -> None:
        """Keep the movement of the picture since the first frame up to date."""
        import cv2

        scale = min(1.0, _TRACKED / image.shape[1])
        grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
        small = cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        if self._before is not None and small.shape == self._before.shape:
            step = np.eye(3)
            step[:2] = _shared_motion(np.asarray(small, dtype=np.uint8), self._before)
            step[:2, 2] /= scale
            self._to_first = self._to_first @ step
        self._before = np.asarray(small, dtype=np.uint8)

    def _light(self, image: Image) -> Light:
        import cv2

        height, width = image.shape[:2]
        light = (image.astype(np.float32) / np.float32(255)) ** np.float32(2.2)
        coarse = (max(1, width // _COARSE), max(1, height // _COARSE))
        small = cv2.resize(light, coarse, interpolation=cv2.INTER_AREA)
        if not self._gain:
            top = float(np.percentile(np.asarray(small).mean(axis=2), 99))
            self._gain = 0.8 / max(top, 1e-3)
        pools = self._pools(width, height)
        lit = self._irradiance(pools, (width, height), coarse)
        lit *= _without_sky(np.asarray(small, dtype=np.float32) * np.float32(self._gain))
        field = cv2.resize(lit + self._ambient, (width, height), interpolation=cv2.INTER_LINEAR)
        scene = np.asarray(light * np.float32(self._gain) * field, dtype=np.float32)
        for pool, (x, y), zoom in self._seen(pools):
            if pool.head:
                add_spot(scene, x, y, max(0.7, pool.size * zoom), pool.tint * np.float32(pool.head))
        return scene

    def _pools(self, width: int, height: int) -> list[_Pool]:
        """The lamps that reach the frame: one or none in each square of the first frame's plane."""
        corners = np.array([[0, 0, 1], [width, 0, 1], [0, height, 1], [width, height, 1.0]])
        seen = (corners @ self._to_first.T)[:, :2] / (_CELL * width)
        low, high = np.floor(seen.min(axis=0)) - 1, np.ceil(seen.max(axis=0)) + 1
        high = np.minimum(high, low + 24)
        cells = [
            (c, r)
            for r in range(int(low[1]), int(high[1]))
            for c in range(int(low[0]), int(high[0]))
        ]
        return [pool for c, r in cells for pool in self._pool(c, r, width)]

    def _pool(self, column: int, row: int, width: int) -> Iterator[_Pool]:
        rng = np.random.default_rng([self._seed, 11, column + 2**20, row + 2**20])
        if rng.random() > 0.8:
            return
        x, y = (np.array([column, row]) + rng.uniform(0.1, 0.9, size=2)) * _CELL * width
        tint = self._tint if rng.random() < 0.7 else lamp_colour(rng)
        yield _Pool(
            float(x),
            float(y),
            radius=log_uniform(rng, 0.1, 0.35) * width,
            power=float(rng.uniform(1.5, 2.5)),
            strength=log_uniform(rng, 0.25, 1.5),
            tint=tint,
            head=log_uniform(rng, 2, 12) if rng.random() < 0.6 else 0.0,
            size=log_uniform(rng, 0.003, 0.008) * width,
        )

    def _irradiance(
        self, pools: Sequence[_Pool], size: tuple[int, int], coarse: tuple[int, int]
    ) -> Light:
        columns = (np.arange(coarse[0]) + 0.5) * (size[0] / coarse[0])
        rows = (np.arange(coarse[1]) + 0.5) * (size[1] / coarse[1])
        a = self._to_first
        x = (a[0, 0] * columns + a[0, 2] + (a[0, 1] * rows)[:, None]).astype(np.float32)
        y = (a[1, 0] * columns + a[1, 2] + (a[1, 1] * rows)[:, None]).astype(np.float32)
        lit = np.zeros((coarse[1], coarse[0], 3), dtype=np.float32)
        for pool in pools:
            squared = ((x - pool.x) ** 2 + (y - pool.y) ** 2) / np.float32(pool.radius**2)
            lit += (pool.strength * (1 + squared) ** -pool.power)[..., None] * pool.tint
        return lit

    def _seen(self, pools: Sequence[_Pool]) -> Iterator[tuple[_Pool, tuple[float, float], float]]:
        """Lamps with their places in this frame, and how much larger they are than in the first."""
        back = np.linalg.inv(self._to_first)
        zoom = float(np.sqrt(abs(np.linalg.det(back[:2, :2]))))
        for pool in pools:
            x, y = (back @ (pool.x, pool.y, 1.0))[:2]
            yield pool, (float(x), float(y)), zoom


def _without_sky(scene: Light) -> Light:
    """What lamps reach: little of the sky and of blown areas, 1 elsewhere, (h, w, 1)."""
    import cv2

    grey = scene.mean(axis=2)
    blurred = cv2.GaussianBlur(grey, (0, 0), max(0.5, scene.shape[1] / 60))
    share = 1 - 0.85 * np.clip((np.asarray(blurred) - 0.6) / 0.2, 0, 1)
    return np.asarray(share[..., None], dtype=np.float32)


def _shared_motion(now: Image, before: Image) -> Floats:
    """The (2, 3) shift, turn and scale from `now` to `before` that most of the picture shares."""
    import cv2

    still = np.eye(3)[:2]
    points = cv2.goodFeaturesToTrack(before, 150, 0.01, 7)
    if points is None or len(points) < 8:
        return still
    moved, found, _ = cv2.calcOpticalFlowPyrLK(before, now, points, None)  # type: ignore[call-overload]
    kept = found.ravel() == 1
    if kept.sum() < 8:
        return still
    matrix, inliers = cv2.estimateAffinePartial2D(
        moved[kept], points[kept], method=cv2.RANSAC, ransacReprojThreshold=1.0
    )
    if matrix is None or inliers.sum() < 0.3 * kept.sum():
        return still
    zoom = float(np.hypot(matrix[0, 0], matrix[1, 0]))
    if not 1 / _MOST_ZOOM < zoom < _MOST_ZOOM:
        return still
    return np.asarray(matrix, dtype=np.float64)
