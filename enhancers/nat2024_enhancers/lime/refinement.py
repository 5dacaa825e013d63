"""The illumination that balances closeness to the first guess against weighted smoothness.

`refine_quickly` solves LIME's sped-up form, one linear system; `refine_exactly` minimises
||T - guess||^2 + alpha ||W o grad T||_1 itself by alternating directions.
"""

import numpy as np
import torch
from torch import Tensor

from nat2024_enhancers.lime.dissection import FivePoint, solve
from nat2024_enhancers.lime.illumination import Map, Smoothness
from nat2024_enhancers.lime.multigrid import Multigrid, apply_stencil

_TOLERANCE = 5e-7
_MOST_STEPS = 40
_LARGEST_LINK = 1e5
_SMALL_CHANGE = 1e-8
_RELAXATION = 1.7


def refine_quickly(guess: Map, smoothness: Smoothness, alpha: float, *, of_start: bool) -> Map:
    """Solve (1 + alpha sum D' w D) t = guess, float64 (H, W).

    Args:
        guess: the first guess.
        smoothness: its weights w_x and w_y.
        alpha: how much smoothness counts.
        of_start: whether a link has the weight of the pixel where it starts (the left or upper one)
            in the equations of both its pixels. Else each equation takes the weight of the other
            pixel, and the system is not symmetric.
    """
    across = torch.from_numpy(alpha * smoothness.weight_x)
    down = torch.from_numpy(alpha * smoothness.weight_y)
    target = torch.from_numpy(guess)
    system = _assemble(across, down, of_start=of_start)
    # beyond that, single precision no longer helps conjugate gradients on
    moderate = max(across.max().item(), down.max().item()) <= _LARGEST_LINK
    t = _solve_by_gradients(system, target) if of_start and moderate else None
    if t is None:
        t = solve(FivePoint(*(part[None] for part in system)), target[None])[0]
    answer: Map = t.numpy()
    return answer


def _assemble(across: Tensor, down: Tensor, *, of_start: bool) -> FivePoint:
    up, below, left, right = (torch.zeros_like(across) for _ in range(4))
    up[1:] = -down[:-1]
    left[:, 1:] = -across[:, :-1]
    below[:-1] = -(down[:-1] if of_start else down[1:])
    right[:, :-1] = -(across[:, :-1] if of_start else across[:, 1:])
    return FivePoint(1.0 - up - below - left - right, up, below, left, right)


def _solve_by_gradients(system: FivePoint, target: Tensor) -> Tensor | None:
    """Conjugate gradients with a multigrid cycle; None where they do not get there."""
    stencil = target.new_zeros(3, 3, *target.shape)
    for (row, column), part in zip(((1, 1), (0, 1), (2, 1), (1, 0), (1, 2)), system, strict=True):
        stencil[row, column] = part
    # What improves the residual only has to be roughly right: single precision will do.
    precondition = Multigrid(stencil.float())
    t = target.clone()
    residual = target - apply_stencil(stencil, t, 5)
    direction, before = torch.zeros_like(t), 1.0
    for step in range(_MOST_STEPS):
        improvement = precondition(residual.float()).double()
        if improvement.abs().max() < _TOLERANCE:
            return t + improvement
        product = torch.dot(residual.flatten(), improvement.flatten()).item()
        direction = improvement.add_(direction, alpha=product / before if step else 0.0)
        image = apply_stencil(stencil, direction, 5)
        length = product / torch.dot(direction.flatten(), image.flatten()).item()
        t.add_(direction, alpha=length)
        residual.sub_(image, alpha=length)
        before = product
    return None


def refine_exactly(guess: Map, smoothness: Smoothness, alpha: float, *, passes: int = 500) -> Map:
    """Minimise ||T - guess||^2 + alpha ||W o grad T||_1 over T, float64 (H, W).

    An augmented Lagrangian method: each pass finds T by the fast Fourier transform, which takes the
    image as periodic, then the gradients G by soft thresholding; links over the border weigh
    nothing. Official code differs: its penalty mu only grows, which ends the search at 50 passes
    wherever it is; here mu stays, steps are over-relaxed, and the minimum is reached.

    Args:
        guess: the first guess.
        smoothness: its weights W_x and W_y.
        alpha: how much smoothness counts.
        passes: how many are made at most; fewer where nothing changes any more.
    """
    limits = alpha * np.stack([smoothness.strength_x, smoothness.strength_y])
    limits[0, :, -1] = 0.0
    limits[1, -1] = 0.0
    if not limits.any():
        return guess
    # Found by trial: steps of T and of G are about as long as each other then.
    mu = 15.0 * float(np.sqrt(np.median(limits[limits > 0])))
    spectrum = _laplace_spectrum(*guess.shape)
    gradients, multipliers = np.zeros_like(limits), np.zeros_like(limits)
    t = guess
    for _ in range(passes):
        before = t
        pull = 2.0 * guess + _divergence(mu * gradients - multipliers)
        t = np.fft.irfft2(np.fft.rfft2(pull) / (2.0 + mu * spectrum), s=guess.shape)
        slopes = _RELAXATION * _gradient(t) + (1.0 - _RELAXATION) * gradients
        wanted = slopes + multipliers / mu
        gradients = np.sign(wanted) * np.maximum(np.abs(wanted) - limits / mu, 0.0)
        multipliers += mu * (slopes - gradients)
        if np.abs(t - before).max() < _SMALL_CHANGE:
            break
    return t


def objective(t: Map, guess: Map, smoothness: Smoothness, alpha: float) -> float:
    """||T - guess||^2 + alpha ||W o grad T||_1, without links over the border."""
    rough = (smoothness.strength_x[:, :-1] * np.abs(np.diff(t, axis=1))).sum()
    rough += (smoothness.strength_y[:-1] * np.abs(np.diff(t, axis=0))).sum()
    return float(np.square(t - guess).sum() + alpha * rough)


def _laplace_spectrum(height: int, width: int) -> Map:
    rows = 2.0 - 2.0 * np.cos(2.0 * np.pi * np.arange(height) / height)
    columns = 2.0 - 2.0 * np.cos(2.0 * np.pi * np.arange(width // 2 + 1) / width)
    spectrum: Map = rows[:, None] + columns
    return spectrum


def _gradient(t: Map) -> Map:
    return np.stack([np.roll(t, -1, axis=1) - t, np.roll(t, -1, axis=0) - t])


def _divergence(gradients: Map) -> Map:
    """The transpose of `_gradient`."""
    across, down = gradients
    answer: Map = np.roll(across, 1, axis=1) - across + np.roll(down, 1, axis=0) - down
    return answer
