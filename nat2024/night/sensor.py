"""From light to grey levels: glow of the lens, shot and read noise, tone curve, black level."""

from dataclasses import dataclass, replace

import numpy as np

from nat2024.night.arrays import Light, log_uniform
from nat2024.types import Image

_STEPS = 4096
_LIMIT = 2.2
"""Light that is white whatever the tone curve, in units of the exposure."""

_SHOULDER = 0.6
_GLOW = ((0.006, 0.5), (0.02, 0.3), (0.07, 0.2))
"""Reach of the glow in frame widths, and the share of scattered light."""


@dataclass(frozen=True, slots=True)
class Sensor:
    """One camera at one setting.

    Attributes:
        gain: what light is multiplied by; see `expose`.
        balance: white balance, factors of blue, green and red.
        saturation: 1 keeps colours, 0 makes them grey.
        glow: share of the light that the lens scatters.
        shot: variance of shot noise per unit of light.
        read: standard deviation of read noise, in units of light.
        grain: standard deviation in pixels of the noise's spatial correlation; 0 for none.
        power: of the tone curve: the grey level is light to the power 1/`power`.
        toe: light that is lost at the dark end.
        black: grey level of no light, 0..1.
        softness: standard deviation of the lens blur in pixels, 0 for none.
        quality: of the JPEG file, 1..100.
    """

    gain: float = 1.0
    balance: tuple[float, float, float] = (1.0, 1.0, 1.0)
    saturation: float = 1.0
    glow: float = 0.02
    shot: float = 1e-4
    read: float = 3e-4
    grain: float = 0.7
    power: float = 2.2
    toe: float = 0.001
    black: float = 0.012
    softness: float = 0.5
    quality: int = 85


def draw_sensor(rng: np.random.Generator) -> Sensor:
    """A camera by chance, in the ranges of real night footage from drones."""
    return Sensor(
        balance=(float(rng.uniform(0.94, 1.06)), 1.0, float(rng.uniform(0.94, 1.06))),
        saturation=float(rng.uniform(0.85, 1.0)),
        glow=log_uniform(rng, 0.005, 0.04),
        shot=log_uniform(rng, 1.5e-5, 8e-5),
        read=log_uniform(rng, 1.5e-4, 2.8e-4),
        grain=float(rng.uniform(0.5, 0.9)),
        power=float(rng.uniform(2.0, 2.4)),
        toe=float(rng.uniform(0.0, 0.001)),
        black=float(rng.uniform(0.006, 0.02)),
        softness=float(rng.uniform(0.0, 0.7)),
        quality=int(rng.integers(75, 93)),
    )


def tone(light: Light, sensor: Sensor) -> Light:
    """The tone curve: light in units of the exposure to grey levels 0..1, with its black level."""
    z = np.maximum(light - np.float32(sensor.toe), 0)
    z = z / (1 + _SHOULDER * np.maximum(z - 0.5, 0))
    grey = np.minimum(z, 1) ** (1 / sensor.power)
    return np.asarray(sensor.black + (1 - sensor.black) * grey, dtype=np.float32)


def expose(sensor: Sensor, samples: list[Light], mean: float) -> Sensor:
    """Choose the gain so that `samples` get the mean grey level `mean`, by bisection."""
    small = np.concatenate([sample.reshape(-1, 3) for sample in samples])
    low, high = 1e-4, 1e4
    for _ in range(40):
        gain = float(np.sqrt(low * high))
        if float(tone(small * np.float32(gain), sensor).mean()) < mean:
            low = gain
        else:
            high = gain
    return replace(sensor, gain=float(np.sqrt(low * high)))


class Development:
    """A sensor made ready for frames of one size; the noise is drawn once and cut at will."""

    def __init__(self, sensor: Sensor, size: tuple[int, int], seed: int) -> None:
        """Draw the noise and tabulate the tone curve.

        Args:
            sensor: exposed already.
            size: (width, height) of the frames.
            seed: of the noise.
        """
        self.sensor = sensor
        self._seed = seed
        self._noise = _noise(np.random.default_rng([seed, 1]), size, sensor.grain)
        # in root light the sum of shot and read noise has the same deviation everywhere
        self._offset = np.float32(sensor.read**2 / sensor.shot)
        self._scale = np.float32((_STEPS - 1) / np.sqrt(_LIMIT + self._offset))
        root = np.arange(_STEPS, dtype=np.float32) / self._scale
        grey = tone(root**2 - self._offset, sensor)
        self._table = np.rint(255 * grey).clip(0, 255).astype(np.uint8)
        self._colours = _colour_matrix(sensor)

    def develop(self, light: Light, index: int) -> Image:
        """What the camera writes of one frame.

        Args:
            light: float32 (H, W, 3) BGR, linear; not changed.
            index: of the frame; its noise follows from it and the seed.
        """
        import cv2

        exposed = cv2.transform(light, self._colours)
        exposed = add_glow(np.asarray(exposed, dtype=np.float32), self.sensor.glow)
        if self.sensor.softness > 0.2:
            exposed = cv2.GaussianBlur(exposed, (0, 0), self.sensor.softness)
        np.maximum(exposed, 0, out=exposed)
        root = cv2.sqrt(exposed + self._offset)
        deviation = float(np.sqrt(self.sensor.shot) / 2 * self._scale)
        steps = cv2.addWeighted(root, float(self._scale), self._cut(index), deviation, 0.5)
        np.clip(steps, 0, _STEPS - 1, out=steps)
        return np.ascontiguousarray(self._table[steps.astype(np.uint16)])

    def _cut(self, index: int) -> Light:
        """The noise of one frame: another part of the drawn field, perhaps turned over."""
        rng = np.random.default_rng([self._seed, 2, index])
        height, width = self._noise.shape[0] - _SPARE, self._noise.shape[1] - _SPARE
        y, x = rng.integers(0, _SPARE, size=2)
        part = self._noise[y : y + height, x : x + width]
        flips = (slice(None, None, int(rng.choice([-1, 1]))) for _ in range(2))
        return np.ascontiguousarray(part[tuple(flips)])


_SPARE = 160


def _noise(rng: np.random.Generator, size: tuple[int, int], grain: float) -> Light:
    import cv2

    shape = (size[1] + _SPARE, size[0] + _SPARE, 3)
    noise = rng.standard_normal(shape, dtype=np.float32)
    if grain > 0.2:
        noise = np.asarray(cv2.GaussianBlur(noise, (0, 0), grain), dtype=np.float32)
        noise /= noise.std()
    return noise


def _colour_matrix(sensor: Sensor) -> Light:
    """Gain, white balance and saturation in one."""
    weights = np.array([0.114, 0.587, 0.299])
    keep = sensor.saturation * np.eye(3) + (1 - sensor.saturation) * np.tile(weights, (3, 1))
    return np.asarray(sensor.gain * keep * np.array(sensor.balance), dtype=np.float32)


def add_glow(light: Light, share: float) -> Light:
    """Scatter a share of the light around every bright place, as a lens and mist do."""
    import cv2

    height, width = light.shape[:2]
    quarter = cv2.resize(
        light, (max(1, width // 4), max(1, height // 4)), interpolation=cv2.INTER_AREA
    )
    coarse = cv2.resize(
        quarter, (max(1, width // 16), max(1, height // 16)), interpolation=cv2.INTER_AREA
    )
    (near, a), (middle, b), (far, c) = _GLOW
    widest = cv2.GaussianBlur(coarse, (0, 0), max(0.3, far * width / 16)) * np.float32(c)
    shape = (quarter.shape[1], quarter.shape[0])
    wide = np.asarray(cv2.resize(widest, shape, interpolation=cv2.INTER_LINEAR), dtype=np.float32)
    wide += cv2.GaussianBlur(quarter, (0, 0), max(0.3, middle * width / 4)) * np.float32(b)
    wide += cv2.GaussianBlur(quarter, (0, 0), max(0.3, near * width / 4)) * np.float32(a)
    scattered = cv2.resize(wide, (width, height), interpolation=cv2.INTER_LINEAR)
    return np.asarray(cv2.addWeighted(light, 1 - share, scattered, share, 0), dtype=np.float32)
