"""The drone's camera: where it is, where it looks, and how its view moves.

World: metres, x and y on the ground, z up. Image: pixels from the left and the top edge of the
frame, so the centre of the first pixel is (0.5, 0.5).
"""

from dataclasses import dataclass, field

import numpy as np

from nat2024.night.arrays import Points
from nat2024.types import Floats

_NEAR = 0.5


@dataclass(frozen=True, slots=True)
class Camera:
    """One view.

    Attributes:
        position: x, y, z in metres.
        yaw: direction of view over the ground, radians from the y axis towards the x axis.
        pitch: how far it looks down, radians; a right angle is straight down.
        roll: turn about the direction of view, radians.
        focal: focal length in pixels.
        size: (width, height) of the frame in pixels.
    """

    position: tuple[float, float, float]
    yaw: float
    pitch: float
    roll: float
    focal: float
    size: tuple[int, int]
    _matrix: Floats = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_matrix", self._compute())

    def axes(self) -> Floats:
        """Rows right, down and forward of the camera in world coordinates."""
        sin_yaw, cos_yaw = np.sin(self.yaw), np.cos(self.yaw)
        sin_pitch, cos_pitch = np.sin(self.pitch), np.cos(self.pitch)
        forward = np.array([sin_yaw * cos_pitch, cos_yaw * cos_pitch, -sin_pitch])
        level = np.array([cos_yaw, -sin_yaw, 0.0])
        upright = np.cross(forward, level)
        right = np.cos(self.roll) * level + np.sin(self.roll) * upright
        return np.stack([right, np.cross(forward, right), forward])

    def matrix(self) -> Floats:
        """The (3, 4) matrix from the world to the image."""
        return self._matrix

    def _compute(self) -> Floats:
        width, height = self.size
        inner = np.array([[self.focal, 0, width / 2], [0, self.focal, height / 2], [0, 0, 1.0]])
        axes = self.axes()
        outer = np.column_stack([axes, -axes @ np.array(self.position)])
        return np.asarray(inner @ outer, dtype=np.float64)

    def ground(self) -> Floats:
        """The (3, 3) homography from ground x, y to the image."""
        return np.asarray(self._matrix[:, [0, 1, 3]], dtype=np.float64)

    def project(self, points: Points) -> tuple[Points, Floats]:
        """Where points of the world are seen.

        Args:
            points: (n, 3) in metres.

        Returns:
            (n, 2) in pixels and the depths (n,) in metres; points behind the camera keep a depth
            below the nearest that is drawn, and a place far outside.
        """
        matrix = self._matrix
        seen = points @ matrix[:, :3].T + matrix[:, 3]
        depth = seen[:, 2]
        safe = np.where(depth > _NEAR, depth, _NEAR)
        return seen[:, :2] / safe[:, None], depth


@dataclass(frozen=True, slots=True)
class Flight:
    """How the camera moves over one sequence; arrays have one entry a frame.

    Attributes:
        aim: (n, 2) point of the ground in the middle of the view.
        distance: (n,) metres from the camera to that point.
        yaw: (n,) radians.
        pitch: (n,) radians.
        roll: (n,) radians.
        focal: focal length in pixels.
        size: (width, height) of the frame.
    """

    aim: Points
    distance: Floats
    yaw: Floats
    pitch: Floats
    roll: Floats
    focal: float
    size: tuple[int, int]

    def camera(self, index: int) -> Camera:
        """The view of one frame."""
        yaw, pitch = float(self.yaw[index]), float(self.pitch[index])
        distance = float(self.distance[index])
        back = distance * np.cos(pitch)
        x = float(self.aim[index, 0] - back * np.sin(yaw))
        y = float(self.aim[index, 1] - back * np.cos(yaw))
        z = float(distance * np.sin(pitch))
        return Camera((x, y, z), yaw, pitch, float(self.roll[index]), self.focal, self.size)


def sway(rng: np.random.Generator, frames: int, slow: float, fast: float) -> Floats:
    """A drone's sway: two slow waves and a faster small one; starts anywhere.

    Args:
        rng: where chance comes from.
        frames: number of values.
        slow: reach of the slow waves (periods of 80 to 300 frames).
        fast: reach of the fast one (periods of 12 to 30 frames).
    """
    time = np.arange(frames)
    value = np.zeros(frames)
    for reach, low, high in ((slow, 120, 300), (slow / 2, 80, 150), (fast, 12, 30)):
        phase, period = rng.uniform(0, 2 * np.pi), rng.uniform(low, high)
        value += reach * np.sin(2 * np.pi * time / period + phase)
    return value


def pulse(frames: int, middle: float, length: float) -> Floats:
    """A smooth rise to 1 at frame `middle` and back, about `length` frames long."""
    return np.asarray(np.exp(-(((np.arange(frames) - middle) / (0.5 * length)) ** 4)))
