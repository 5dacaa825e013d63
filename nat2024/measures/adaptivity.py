"""Whether an enhancer adapts: how much of its effect one tone curve per channel explains.

Pairs of images before and after go in, as uint8 (H, W, 3) or floats in 0..1, channels in the order
in which the enhancer was fed. The effect is after - before. Four models of growing freedom are
fitted by least squares, and what each leaves unexplained tells what the enhancer looks at:

| model | freedom |
| --- | --- |
| one curve | one tone curve per channel for all images |
| curve of the image | one tone curve per channel and image |
| one colour map | any function of a pixel's three channels for all images |
| colour map of the image | any function of a pixel's three channels, anew for each image |

The explained share of a model is 1 - (sum of squared residuals) / (sum of squared effects). The
colour maps have too many freedoms to be fitted and counted alike, so theirs is the estimate by
pure error, as in a lack-of-fit test: over colours that occur several times, the squared deviations
from the colour's mean are enlarged by n / (n - 1) for the mean that was fitted to them.
"""

from collections.abc import Iterable
from dataclasses import dataclass, fields
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from nat2024.errors import ArrayContract
from nat2024.measures.colour_maps import ColourMap, pack_colours
from nat2024.measures.tone_curves import CurveFit, apply_tone_curve
from nat2024.types import Floats

Pixels: TypeAlias = npt.NDArray[np.uint8] | npt.NDArray[np.floating[Any]]
"""uint8 (H, W, 3), or floats of that shape in 0..1."""

BORDER = 2
"""Pixels nearer to the border than this are left out of all models and reported apart: what a
network's padding does to them says nothing about whether it adapts."""

EXPLAINED = 0.999
"""From this share on, a model explains what an enhancer does: what it leaves is, as a root mean
square, at most 3.2 % of the effect."""

NO_EFFECT = 0.25 / 255
"""Below this root mean square an effect is less than rounding to 8 bits, and none."""

GAIN_FLOOR = 0.02
"""Added to both values of which a relative gain is formed, five levels of 255, so that black
pixels do not count as infinitely lifted."""

REPEATED_SHARE = 0.5
"""Where the colours that repeat within images hold less of the effect than this, they do not stand
for the others, and the share of a colour map of the image is not given."""

_SURROUNDINGS = 16  # local brightness is a mean over a square whose side is the shorter side / 16

FIXED = "a fixed tone curve"
FIXED_COLOURS = "a fixed colour map"
BETWEEN = "adapts between images"
INSIDE = "adapts inside images"
UNTOLD = "no tone curve; too few colours repeat to tell more"
SINGLE = "a tone curve or colour map in one image; others would tell whether it is fixed"
NONE = "no effect"


@dataclass(frozen=True, slots=True, eq=False)
class Adaptivity:
    """How far an enhancer is from one fixed tone curve per channel.

    Attributes:
        images: number of pairs.
        curve: float64 (3, 256), the best curve per channel at the levels 0/255 .. 255/255.
        observed: bool (3, 256), levels that occurred; the others are interpolated.
        effect: root mean square of after - before.
        explained: share of the effect that one curve per channel explains; NaN without effect.
        explained_by_image_curves: share for a curve per channel and image.
        explained_by_colour: share for one map of colours; NaN where images share no colours.
        explained_by_image_colour: share for a map of colours per image; NaN where too few
            colours repeat.
        mean_residual: mean absolute difference to the one curve.
        max_residual: the largest one.
        border_mean_residual: the mean in the outermost 2 pixels, which count in nothing else.
        border_max_residual: the largest there.
        gain_inside: how much the gain varies inside an image among pixels of the same value in
            a channel: root mean square of (after + 0.02) / (the image's curve + 0.02) - 1.
        gain_between: how much it varies between images: root mean square over all pixels of
            (the image's curve + 0.02) / (the one curve + 0.02) - 1.
        gain_per_stop: how much the gain changes, relatively, for pixels of the same value in the
            same image whose surroundings are twice as bright; NaN where surroundings never differ.
        verdict: one of the texts of this module, see `judge`.
    """

    images: int
    curve: Floats
    observed: npt.NDArray[np.bool_]
    effect: float
    explained: float
    explained_by_image_curves: float
    explained_by_colour: float
    explained_by_image_colour: float
    mean_residual: float
    max_residual: float
    border_mean_residual: float
    border_max_residual: float
    gain_inside: float
    gain_between: float
    gain_per_stop: float
    verdict: str

    def as_row(self) -> dict[str, Any]:
        """The numbers and the verdict by their names, without the curve."""
        names = [field.name for field in fields(self) if field.name not in ("curve", "observed")]
        return {name: getattr(self, name) for name in names}


def measure_adaptivity(pairs: Iterable[tuple[Pixels, Pixels]]) -> Adaptivity:
    """Fit one tone curve per channel to what was done to images, and say what it leaves.

    Args:
        pairs: images before and after, iterated twice (a list, or an object that makes them anew
            each time). Images may differ in size.

    Raises:
        ArrayContract: there is no pair, the two of a pair do not fit together, values are not
            finite, or no image has 5x5 pixels, of which the border leaves one.
    """
    fit, images, pixels = CurveFit(), 0, 0
    for before, after in _checked(pairs):
        images += 1
        pixels += _inside(before).size
        fit.add(_inside(before), _inside(after))
    if not pixels:
        msg = f"adaptivity needs images of at least {2 * BORDER + 1}x{2 * BORDER + 1} pixels"
        raise ArrayContract(msg)
    curve = fit.solve()
    sums = _Sums()
    for before, after in _checked(pairs):
        sums.add(before, after, curve)
    return sums.result(images, curve, fit.observed())


def judge(images: int, effect: float, curve: float, colour: float, image_colour: float) -> str:
    """Say in words whether an enhancer adapts; each share counts from `EXPLAINED` on.

    "no effect" where the root mean square `effect` is below a quarter of a level. "a fixed tone
    curve" where one curve per channel explains it, "a fixed colour map" where one function of the
    three channels does (one curve of the luminance, for example), "adapts between images" where a
    function of the three channels for each image does, else "adapts inside images": what becomes
    of a pixel depends on where it is or on what surrounds it. Where no curve explains it and too
    few colours repeat, nothing more is said. One image alone cannot tell whether what explains it
    is fixed.

    Args:
        images: number of images.
        effect: root mean square.
        curve: share that one curve per channel explains.
        colour: share that one map of colours explains; NaN counts as unknown.
        image_colour: share that a curve or a map of colours per image explains; NaN where no curve
            does and too few colours repeat.
    """
    if effect < NO_EFFECT:
        return NONE
    if curve >= EXPLAINED:
        return FIXED if images > 1 else SINGLE
    if np.isnan(image_colour):
        return UNTOLD
    if image_colour < EXPLAINED:
        return INSIDE
    if images == 1:
        return SINGLE
    return FIXED_COLOURS if colour >= EXPLAINED else BETWEEN


class _Sums:
    """Sums over images from which the measures follow."""

    def __init__(self) -> None:
        self.values = 0
        self.energy = self.left = self.left_by_image = self.absolute = self.largest = 0.0
        self.inside = self.between = self.slope_top = self.slope_bottom = 0.0
        self.border: list[float] = []
        self.border_values, self.border_largest = 0, float("nan")
        self.colours, self.image_left, self.image_energy = ColourMap(), 0.0, 0.0

    def add(self, before: Floats, after: Floats, curve: Floats) -> None:
        """Count one image."""
        residual = after - apply_tone_curve(curve, before)
        self._add_border(residual)
        x, y, r = _inside(before), _inside(after), _inside(residual)
        if not x.size:
            return
        own = CurveFit()
        own.add(x, y)
        predicted = apply_tone_curve(own.solve(), x)
        self.values += x.size
        self.energy += float(np.sum((y - x) ** 2))
        self.left += float(np.sum(r * r))
        self.left_by_image += float(np.sum((y - predicted) ** 2))
        self.absolute += float(np.abs(r).sum())
        self.largest = max(self.largest, float(np.abs(r).max()))
        lifted, common = (np.maximum(values, 0) + GAIN_FLOOR for values in (predicted, y - r))
        gain = (y + GAIN_FLOOR) / lifted - 1
        between = lifted / common - 1
        self.inside += float(np.sum(gain * gain))
        self.between += float(np.sum(between * between))
        self._add_slope(x, gain, _inside(_surroundings(before)[..., None])[..., 0])
        self._add_colours(x, y, r)

    def _add_border(self, residual: Floats) -> None:
        mask = np.ones(residual.shape[:2], dtype=np.bool_)
        _inside(mask)[...] = False
        ring = np.abs(residual[mask])
        if ring.size:
            self.border.append(float(ring.sum()))
            self.border_values += ring.size
            self.border_largest = float(np.fmax(self.border_largest, ring.max()))

    def _add_slope(self, x: Floats, gain: Floats, local: Floats) -> None:
        # Both sides lose their means over pixels of one level: what is left compares like to like.
        for channel in range(3):
            level = np.rint(x[..., channel] * 255).astype(np.intp).ravel()
            count = np.maximum(np.bincount(level, minlength=256), 1)
            g, b = (
                values - (np.bincount(level, values, 256) / count)[level]
                for values in (gain[..., channel].ravel(), local.ravel())
            )
            self.slope_top += float(g @ b)
            self.slope_bottom += float(b @ b)

    def _add_colours(self, x: Floats, y: Floats, residual: Floats) -> None:
        found = ColourMap()
        found.add(pack_colours(x), residual, np.sum((y - x) ** 2, axis=-1))
        left, energy = found.pure_error()
        self.image_left += left
        self.image_energy += energy
        self.colours.merge(found)

    def result(self, images: int, curve: Floats, observed: npt.NDArray[np.bool_]) -> Adaptivity:
        """All measures."""
        effect = float(np.sqrt(self.energy / self.values))
        repeated = self.image_energy >= REPEATED_SHARE * self.energy
        models = (
            (self.left, self.energy),
            (self.left_by_image, self.energy),
            self.colours.pure_error(images=2),
            (self.image_left, self.image_energy if repeated else 0.0),
        )
        none = effect < NO_EFFECT
        explained, by_image, colour, image_colour = (
            float("nan") if none or energy <= 0 else 1 - left / energy for left, energy in models
        )
        # A few repeated colours can show that place matters, but not that it does not.
        few = 1 - self.image_left / self.image_energy if self.image_energy > 0 else float("nan")
        of_image = few if few < EXPLAINED else image_colour
        best = by_image if by_image >= EXPLAINED else of_image
        border = sum(self.border) / self.border_values if self.border_values else float("nan")
        return Adaptivity(
            images=images,
            curve=curve,
            observed=observed,
            effect=effect,
            explained=explained,
            explained_by_image_curves=by_image,
            explained_by_colour=colour,
            explained_by_image_colour=image_colour,
            mean_residual=self.absolute / self.values,
            max_residual=self.largest,
            border_mean_residual=border,
            border_max_residual=self.border_largest,
            gain_inside=float(np.sqrt(self.inside / self.values)),
            gain_between=float(np.sqrt(self.between / self.values)),
            gain_per_stop=(
                self.slope_top / self.slope_bottom if self.slope_bottom > 1e-9 else float("nan")
            ),
            verdict=judge(images, effect, explained, colour, best),
        )


def _inside(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """A view of (H, W, ...) without the border."""
    return values[BORDER:-BORDER, BORDER:-BORDER]


def _surroundings(before: Floats) -> Floats:
    """Local brightness (H, W) in stops: the mean grey level around each pixel."""
    import cv2

    grey = before.mean(axis=2)
    side = max(3, min(grey.shape) // _SURROUNDINGS | 1)
    return np.asarray(np.log2(cv2.blur(grey, (side, side)) + GAIN_FLOOR), dtype=np.float64)


def _checked(pairs: Iterable[tuple[Pixels, Pixels]]) -> Iterable[tuple[Floats, Floats]]:
    found = False
    for before, after in pairs:
        found = True
        x, y = _as_floats(before, "image before"), _as_floats(after, "image after")
        if x.shape != y.shape:
            msg = f"images before and after differ in shape: {x.shape} and {y.shape}"
            raise ArrayContract(msg)
        yield x.clip(0.0, 1.0), y
    if not found:
        msg = "adaptivity needs at least one pair of images, and to see them twice"
        raise ArrayContract(msg)


def _as_floats(image: Any, what: str) -> Floats:
    kind = f"{getattr(image, 'dtype', type(image).__name__)} {getattr(image, 'shape', '')}"
    known = isinstance(image, np.ndarray) and (
        image.dtype == np.uint8 or np.issubdtype(image.dtype, np.floating)
    )
    if not known or image.ndim != 3 or image.shape[2] != 3 or not image.size:
        msg = f"{what} must be uint8 or floats of shape (H, W, 3), not {kind.strip()}"
        raise ArrayContract(msg)
    if image.dtype == np.uint8:
        return np.asarray(image / 255.0, dtype=np.float64)
    values: Floats = image.astype(np.float64)
    if not np.isfinite(values).all():
        msg = f"{what} holds values that are not finite"
        raise ArrayContract(msg)
    return values
