"""Night out of single photographs: images that an enhancer for night video can be trained on.

A photograph counts as reflectance. It is lit by a weak ambient light, street lamps, head lights
and lit facades, gets lamp heads, strings of lights, windows and signs that shine themselves, and
is exposed, scattered and developed by a night camera. No lamp knows what stands in its way, so
one image is plausible in its statistics (see `nat2024.measures.night_statistics`), not in its
geometry; for video with a target use `Darkening` or `NightSequence`.

Lengths are in units of the image's side, light is linear.
"""

from collections.abc import Iterator

import numpy as np

from nat2024.errors import ArrayContract
from nat2024.night.arrays import Colour, Light, colour, log_uniform
from nat2024.night.ground import reflectance
from nat2024.night.lamps import lamp_colour
from nat2024.night.sensor import Development, draw_sensor, expose
from nat2024.night.sprites import add_spot
from nat2024.types import Image

SIDE = 384
"""Side in pixels of the square scenes."""

VIEW = 256
"""Side in pixels of the views of a scene."""

_MEAN = (0.025, 0.12)
"""Mean grey level without what shines itself."""

_DARKEST = 0.01
_COARSE = 2


def night_photograph(photograph: Image, seed: int) -> Image:
    """A square part of a daytime photograph at night; the same for the same photograph and seed.

    Args:
        photograph: uint8 (H, W, 3) BGR, at least 16 pixels a side.
        seed: of the part, the lights, the camera and its noise.

    Returns:
        uint8 (384, 384, 3) BGR, compressed as JPEG and read again.

    Raises:
        ArrayContract: the photograph is none.
    """
    known = photograph.dtype == np.uint8 and photograph.ndim == 3 and photograph.shape[-1:] == (3,)
    if not known or min(photograph.shape[:2]) < 16:
        msg = f"photograph must be uint8 of shape (H, W, 3), not {photograph.dtype} "
        msg += f"{photograph.shape}"
        raise ArrayContract(msg)
    rng = np.random.default_rng([seed, 13])
    albedo = reflectance(_square_part(photograph, rng), rng)
    common = lamp_colour(rng)
    heads = np.zeros((SIDE, SIDE, 3), dtype=np.float32)
    field = _lamp_light(rng, common, heads) * _without_sky(albedo, rng)
    field += _ambient(rng)
    _light_areas(rng, field, common)
    sensor = draw_sensor(rng)
    scene = albedo * field
    exposed = expose(sensor, [scene[::2, ::2]], log_uniform(rng, *_MEAN))
    _add_strings(rng, heads)
    _add_sign(rng, heads)
    scene += heads * np.float32(log_uniform(rng, 0.06, 0.9) / exposed.gain)
    developed = Development(exposed, (SIDE, SIDE), seed).develop(scene, 0)
    return _as_jpeg(developed, exposed.quality)


def night_views(scene: Image, seed: int) -> list[Image]:
    """Views of a scene that a network is trained on: the whole, and a part as trackers cut it.

    Args:
        scene: uint8 (H, W, 3) BGR.
        seed: of the part, 0.22 to 0.9 of the shorter side.

    Returns:
        One or two uint8 (256, 256, 3) BGR; views that are all but black are left out.
    """
    rng = np.random.default_rng([seed, 17])
    height, width = scene.shape[:2]
    side = max(16, round(min(height, width) * log_uniform(rng, 0.22, 0.9)))
    row, column = (int(rng.integers(0, size - side + 1)) for size in (height, width))
    short = min(height, width)
    top, left = (height - short) // 2, (width - short) // 2
    parts = (
        scene[top : top + short, left : left + short],
        scene[row : row + side, column : column + side],
    )
    views = [_resized(part) for part in parts]
    return [view for view in views if view.mean() / 255 >= _DARKEST]


def _resized(part: Image) -> Image:
    import cv2

    larger = part.shape[0] > VIEW
    how = cv2.INTER_AREA if larger else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(part, (VIEW, VIEW), interpolation=how), dtype=np.uint8)


def _as_jpeg(image: Image, quality: int) -> Image:
    import cv2

    _, coded = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return np.asarray(cv2.imdecode(coded, cv2.IMREAD_COLOR), dtype=np.uint8)


def _square_part(photograph: Image, rng: np.random.Generator) -> Image:
    import cv2

    height, width = photograph.shape[:2]
    side = max(16, int(min(height, width) * rng.uniform(0.6, 1.0)))
    row, column = (int(rng.integers(0, size - side + 1)) for size in (height, width))
    part = photograph[row : row + side, column : column + side]
    if rng.random() < 0.5:
        part = part[:, ::-1]
    how = cv2.INTER_AREA if side > SIDE else cv2.INTER_CUBIC
    return np.asarray(cv2.resize(part, (SIDE, SIDE), interpolation=how), dtype=np.uint8)


def _without_sky(albedo: Light, rng: np.random.Generator) -> Light:
    """What lamps reach: little of the sky and of blown areas, 1 elsewhere, (H, W, 1)."""
    import cv2

    blurred = np.asarray(cv2.GaussianBlur(albedo.mean(axis=2), (0, 0), SIDE / 60))
    lost = rng.uniform(0.5, 0.97) * np.clip((blurred - 0.45) / 0.25, 0, 1)
    return np.asarray(1 - lost[..., None], dtype=np.float32)


def _ambient(rng: np.random.Generator) -> Colour:
    tint = colour(float(rng.uniform(0.85, 1.2)), 1.0, float(rng.uniform(0.85, 1.1)))
    return np.asarray(tint * np.float32(log_uniform(rng, 0.003, 0.04)), dtype=np.float32)


def _lamp_light(rng: np.random.Generator, common: Colour, heads: Light) -> Light:
    """Irradiance of street lamps and head lights; their heads are added to `heads`."""
    import cv2

    coarse = SIDE // _COARSE
    places = ((np.arange(coarse) + 0.5) / coarse).astype(np.float32)
    x, y = np.meshgrid(places, places)
    field = np.zeros((coarse, coarse, 3), dtype=np.float32)
    for _ in range(int(rng.integers(1, 7))):
        _add_street_lamp(rng, field, (x, y), common, heads)
    for _ in range(int(rng.poisson(2.5))):
        _add_head_light(rng, field, (x, y), heads)
    fine = cv2.resize(field, (SIDE, SIDE), interpolation=cv2.INTER_LINEAR)
    return np.asarray(fine, dtype=np.float32)


def _add_street_lamp(
    rng: np.random.Generator,
    field: Light,
    places: tuple[Light, Light],
    common: Colour,
    heads: Light,
) -> None:
    x, y = rng.uniform(-0.15, 1.15, size=2)
    tint = common if rng.random() < 0.7 else lamp_colour(rng)
    radius, power = log_uniform(rng, 0.06, 0.38), rng.uniform(1.5, 2.5)
    angle, ratio = rng.uniform(0, np.pi), rng.uniform(0.4, 1)
    across, down = places[0] - np.float32(x), places[1] - np.float32(y)
    along = across * np.cos(angle) + down * np.sin(angle)
    aside = (down * np.cos(angle) - across * np.sin(angle)) / ratio
    squared = (along**2 + aside**2) / radius**2
    pool = log_uniform(rng, 0.25, 2.5) * (1 + squared) ** -power
    if rng.random() < 0.35:  # a shade with an edge
        edge = (rng.uniform(0.8, 1.8) - np.sqrt(squared)) * radius / rng.uniform(0.004, 0.04)
        pool = pool * (0.06 + 0.94 / (1 + np.exp(-np.clip(edge, -30, 30))))
    field += (pool[..., None] * tint).astype(np.float32)
    if rng.random() < 0.6 and 0 < x < 1 and 0 < y < 1:
        _add_head(rng, heads, (x, y), (0.003, 0.014), (2, 30), tint)


def _add_head_light(
    rng: np.random.Generator, field: Light, places: tuple[Light, Light], heads: Light
) -> None:
    x, y = rng.uniform(0, 1, size=2)
    direction = rng.uniform(-np.pi, np.pi)
    half, reach = rng.uniform(0.15, 0.4), rng.uniform(0.04, 0.15)
    across, down = places[0] - np.float32(x), places[1] - np.float32(y)
    distance = np.hypot(across, down)
    turn = np.arctan2(down, across) - direction
    turn = np.abs((turn + np.pi) % (2 * np.pi) - np.pi)
    cone = np.exp(-((turn / half) ** 4)) * np.exp(-distance / reach)
    tint = colour(float(rng.uniform(0.75, 1)), float(rng.uniform(0.9, 1)), 1.0)
    field += (log_uniform(rng, 0.3, 2) * cone[..., None] * tint).astype(np.float32)
    _add_head(rng, heads, (x, y), (0.003, 0.01), (3, 30), tint)


def _add_head(
    rng: np.random.Generator,
    heads: Light,
    place: tuple[float, float],
    radii: tuple[float, float],
    peaks: tuple[float, float],
    tint: Colour,
) -> None:
    radius, peak = log_uniform(rng, *radii) * SIDE, log_uniform(rng, *peaks)
    add_spot(heads, place[0] * SIDE, place[1] * SIDE, radius, tint * np.float32(peak))


def _light_areas(rng: np.random.Generator, field: Light, common: Colour) -> None:
    """Facades and courts with light of their own, which ends in hard edges; in place."""
    import cv2

    for _ in range(int(rng.integers(0, 5))):
        centre, size = rng.uniform(0, 1, size=2), log_uniform(rng, 0.04, 0.25)
        ratio, angle = rng.uniform(0.3, 1), float(rng.choice([0, 90]) + rng.normal(0, 8))
        box = ((centre * SIDE).tolist(), (size * SIDE, size * ratio * SIDE), angle)
        mask = np.zeros((SIDE, SIDE), dtype=np.float32)
        corners = np.rint(cv2.boxPoints(box)).astype(np.int32)
        cv2.fillConvexPoly(mask, corners, 1.0)
        tint = common if rng.random() < 0.5 else lamp_colour(rng)
        factor = log_uniform(rng, 0.15, 1.5)
        if rng.random() < 0.4:  # an area that stands in the shade
            field *= 1 - np.float32(rng.uniform(0.5, 0.95)) * mask[..., None]
        else:
            field += np.float32(factor) * mask[..., None] * tint


def _add_strings(rng: np.random.Generator, heads: Light) -> None:
    """Groups of small lights of one colour, in a line or scattered; in place."""
    if rng.random() > 0.85:
        return
    for _ in range(int(rng.integers(1, 7))):
        tint, level = lamp_colour(rng), log_uniform(rng, 0.8, 20)
        width = int(rng.integers(1, 4))
        for x, y in _string_places(rng):
            row, column = int(y * SIDE), int(x * SIDE)
            if 0 <= row < SIDE and 0 <= column < SIDE:
                factor = np.float32(level * rng.uniform(0.4, 1.2))
                heads[row : row + width, column : column + width] += factor * tint


def _string_places(rng: np.random.Generator) -> Iterator[tuple[float, float]]:
    count, start = int(rng.integers(3, 40)), rng.uniform(0, 1, size=2)
    if rng.random() < 0.5:
        pitch, angle = log_uniform(rng, 0.01, 0.05), rng.uniform(0, np.pi)
        steps = pitch * np.arange(count)[:, None] * (np.cos(angle), np.sin(angle))
    else:
        steps = rng.normal(0, 0.12, size=(count, 2))
    yield from ((float(x), float(y)) for x, y in start + steps)


def _add_sign(rng: np.random.Generator, heads: Light) -> None:
    """A sign or a facade of windows now and then: a grid of lit and unlit fields; in place."""
    import cv2

    if rng.random() > 0.3:
        return
    size = log_uniform(rng, 0.05, 0.3)
    width, height = int(size * SIDE), max(6, int(size * SIDE / 2))
    lit = (rng.random((12, 24)) < 0.45).astype(np.float32)
    grid = cv2.resize(lit, (width, height), interpolation=cv2.INTER_NEAREST)
    row, column = (int(rng.integers(0, SIDE - length)) for length in (height, width))
    light = np.float32(log_uniform(rng, 0.6, 8)) * lamp_colour(rng)
    heads[row : row + height, column : column + width] += np.asarray(grid)[..., None] * light
