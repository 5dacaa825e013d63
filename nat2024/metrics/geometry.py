"""Per-frame geometry of boxes: overlap, centre error, normalised centre error.

Boxes are float64 (n, 4) of x, y, w, h in pixels. Inputs are never written to. A NaN in a row gives
NaN for that row; what a NaN is worth is for the protocol to say.

The toolkits compute the same quantities in different orders of operations. The last bit differs,
and a value that sits on a threshold then falls on the other side, so each order is kept here as a
`Corners` or `Centers` form and the protocols name theirs.
"""

from typing import Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from nat2024.errors import ArrayContract, LengthMismatch
from nat2024.types import Boxes, Floats

Corners: TypeAlias = Literal["exact", "continuous", "guarded", "inclusive", "lenient"]
"""How an intersection is formed.

* `exact`: from differences of coordinates, so that equal boxes overlap by exactly 1;
* `continuous`: corners at x and x + w (pysot);
* `guarded`: the same, 2**-52 added to the union (GOT-10k toolkit);
* `inclusive`: corners at x and x + w - 1, 1 added back (pytracking);
* `lenient`: the same, a NaN corner ignored as MATLAB and pandas do (OTB, LaSOT, TrackingNet).
"""

Scaling: TypeAlias = Literal["difference", "centers", "floored", "factored"]
"""How a centre difference is divided by the size of the true box.

* `difference`: (c - g) / size;
* `centers`: c / size - g / size (pysot, LaSOT toolkit, pytracking);
* `floored`: (c - g) / max(1, size) (GOT-10k toolkit);
* `factored`: d / size * d / size (TrackingNet).
"""

Columns: TypeAlias = Floats
"""float64 (4, n), C-contiguous: x, y, w, h as rows."""

_EPSILON = float(np.finfo(np.float64).eps)


def overlap(predicted: npt.ArrayLike, truth: npt.ArrayLike) -> Floats:
    """Intersection over union of each pair of rows.

    Symmetric, in 0..1, exactly 1 for equal boxes of positive size; a box without area overlaps
    nothing (0).

    Args:
        predicted: (n, 4) boxes x, y, w, h.
        truth: (n, 4) boxes x, y, w, h.

    Returns:
        float64 (n,); NaN where either row has a NaN or infinite value.

    Raises:
        ArrayContract: an input is not of the shape (n, 4).
        LengthMismatch: the inputs differ in length.

    Example:
        >>> overlap([[0, 0, 10, 10]], [[5, 0, 10, 10]]).round(4).tolist()
        [0.3333]
    """
    p, t = columns_of(predicted, truth)
    finite = np.isfinite(p).all(axis=0) & np.isfinite(t).all(axis=0)
    solid = (p[2:] > 0).all(axis=0) & (t[2:] > 0).all(axis=0)
    with np.errstate(all="ignore"):
        values = np.where(solid, overlap_of(p, t, "exact"), 0.0)
    values[~finite] = np.nan
    return values


def center_error(predicted: npt.ArrayLike, truth: npt.ArrayLike) -> Floats:
    """Euclidean distance in pixels between the centres of each pair of rows.

    The centre is x + (w - 1) / 2 as in pysot; the constant half pixel cancels.

    Args:
        predicted: (n, 4) boxes x, y, w, h.
        truth: (n, 4) boxes x, y, w, h.

    Returns:
        float64 (n,), at least 0; NaN where either row has a NaN.

    Raises:
        ArrayContract: an input is not of the shape (n, 4).
        LengthMismatch: the inputs differ in length.

    Example:
        >>> center_error([[3, 4, 10, 10]], [[0, 0, 10, 10]]).tolist()
        [5.0]
    """
    p, t = columns_of(predicted, truth)
    with np.errstate(all="ignore"):
        return error_of(centers_of(p), centers_of(t))


def normalized_center_error(predicted: npt.ArrayLike, truth: npt.ArrayLike) -> Floats:
    """Centre distance with x divided by the true width and y by the true height.

    Muller et al., TrackingNet, ECCV 2018. Unchanged when both boxes are scaled alike.

    Args:
        predicted: (n, 4) boxes x, y, w, h.
        truth: (n, 4) boxes x, y, w, h.

    Returns:
        float64 (n,), at least 0; NaN where either row has a NaN or the true box has no area.

    Raises:
        ArrayContract: an input is not of the shape (n, 4).
        LengthMismatch: the inputs differ in length.

    Example:
        >>> normalized_center_error([[3, 8, 10, 20]], [[0, 0, 10, 20]]).tolist()
        [0.5]
    """
    p, t = columns_of(predicted, truth)
    with np.errstate(all="ignore"):
        values = normalized_error_of(centers_of(p), centers_of(t), t[2:], "difference")
    values[~(t[2:] > 0).all(axis=0)] = np.nan
    return values


def as_boxes(boxes: npt.ArrayLike, name: str) -> Boxes:
    """`boxes` as float64 (n, 4); an `ArrayContract` error names `name` and the shape it has."""
    try:
        array = np.asarray(boxes, dtype=np.float64)
    except (TypeError, ValueError):
        msg = f"{name}: not an array of numbers; expected boxes x, y, w, h of shape (n, 4)"
        raise ArrayContract(msg) from None
    if array.size == 0 and array.ndim <= 2 and array.shape[-1] in (0, 4):
        return array.reshape(0, 4)
    if array.ndim != 2 or array.shape[1] != 4:
        msg = f"{name}: shape {array.shape}, expected (n, 4) boxes x, y, w, h"
        raise ArrayContract(msg)
    return array


def columns_of(predicted: npt.ArrayLike, truth: npt.ArrayLike) -> tuple[Columns, Columns]:
    """Both inputs checked, of equal length, as fresh columns x, y, w, h."""
    p, t = as_boxes(predicted, "predicted"), as_boxes(truth, "truth")
    if len(p) != len(t):
        msg = f"predicted has {len(p)} rows, truth has {len(t)}; they must be equal"
        raise LengthMismatch(msg)
    return p.T.copy(), t.T.copy()


def overlap_of(p: Columns, t: Columns, corners: Corners) -> Floats:
    """Intersection over union of columns (4, n), in the named order of operations.

    This and the functions below leave it to the caller to silence floating point warnings.
    """
    if corners == "exact":
        sides = _exact_sides(p, t)
    elif corners == "lenient":
        sides = np.fmin(p[:2] + p[2:] - 1.0, t[:2] + t[2:] - 1.0)
        sides -= np.fmax(p[:2], t[:2])
        sides += 1.0
        np.fmax(sides, 0.0, out=sides)
    else:
        sides = _sides(p, t, 1.0 if corners == "inclusive" else 0.0)
    shared: Floats = sides[0] * sides[1]
    union = p[2] * p[3]
    union += t[2] * t[3]
    union -= shared
    if corners == "guarded":
        union += _EPSILON
    shared /= union
    if corners not in ("inclusive", "lenient"):
        np.minimum(shared, 1.0, out=shared)
        np.maximum(shared, 0.0, out=shared)
    return shared


def _exact_sides(p: Columns, t: Columns) -> Floats:
    first = np.maximum(p[:2], t[:2])
    sides = np.minimum(p[2:] - (first - p[:2]), t[2:] - (first - t[:2]))
    positive: Floats = np.maximum(sides, 0.0, out=sides)
    return positive


def _sides(p: Columns, t: Columns, pixel: float) -> Floats:
    ends, true_ends = p[:2] + p[2:], t[:2] + t[2:]
    if pixel:
        ends -= pixel
        true_ends -= pixel
    sides: Floats = np.minimum(ends, true_ends)
    sides -= np.maximum(p[:2], t[:2])
    if pixel:
        sides += pixel
    return np.maximum(sides, 0.0, out=sides)


def centers_of(boxes: Columns) -> Floats:
    """Centres (2, n) of columns (4, n): x + (w - 1) / 2, y + (h - 1) / 2."""
    centers = boxes[2:] - 1.0
    centers *= 0.5
    centers += boxes[:2]
    return centers


def error_of(p: Floats, t: Floats) -> Floats:
    """Euclidean distance of centres (2, n)."""
    return _length(p - t)


def normalized_error_of(p: Floats, t: Floats, size: Floats, scaling: Scaling) -> Floats:
    """Distance of centres (2, n) in units of `size` (2, n), in the named order of operations."""
    if scaling == "centers":
        return _length(p / size - t / size)
    difference = p - t
    if scaling == "factored":
        squares = difference / size * difference / size
        return np.asarray(np.sqrt(squares[0] + squares[1]))
    difference /= np.maximum(size, 1.0) if scaling == "floored" else size
    return _length(difference)


def _length(difference: Floats) -> Floats:
    difference *= difference
    squared: Floats = difference[0] + difference[1]
    return np.sqrt(squared, out=squared)
