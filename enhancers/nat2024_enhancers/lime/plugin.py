"""LIME as an enhancer: two published variants, two solvers, and their options."""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from nat2024.cards import read_card
from nat2024.devices import explain_lack_of_memory
from nat2024.errors import InvalidOption
from nat2024.images import batch_to_image, check_batch, check_image, image_to_batch
from nat2024.interfaces import Enhancer
from nat2024.registry import register_enhancer
from nat2024.types import Image

if TYPE_CHECKING:
    import torch

    from nat2024_enhancers.lime.illumination import Map

_LEAST = 1e-3  # of the illumination that an image is divided by
_LARGEST_SIGMA = 100.0


@dataclass(frozen=True)
class _Settings:
    alpha: float
    sigma: float
    gamma: float
    eps: float


_DEFAULTS = {
    "texture": _Settings(alpha=0.15, sigma=2.0, gamma=0.8, eps=0.001),
    "windowed": _Settings(alpha=0.15, sigma=3.0, gamma=0.6, eps=0.001),
}


@register_enhancer("lime")
class Lime(Enhancer):
    """Divides an image by its illumination, the largest channel refined, to the power gamma.

    The order of channels does not matter. `maps` gives, float32 (N, 1, H, W), `T_init`, the first
    guess; `wx` and `wy`, the weights of smoothness; `T_refined` (`T_refined_clipped` in the variant
    "windowed", limited to 0.001..1), and `T_gamma`, what the image is divided by.
    """

    card = read_card("nat2024_enhancers.lime")

    def __init__(
        self,
        *,
        variant: Literal["texture", "windowed"] = "texture",
        solver: Literal["sped_up", "exact"] = "sped_up",
        alpha: float | None = None,
        sigma: float | None = None,
        gamma: float | None = None,
        eps: float | None = None,
        symmetric: bool = False,
        passes: int = 500,
        clamp: bool = True,
        quantise: Literal["round", "truncate"] = "round",
        **base: Any,
    ) -> None:
        """Keep the settings; those that are None take the default of the variant.

        Args:
            variant: "texture" weighs smoothness by differences of the blurred guess, "windowed" by
                sums over a window as printed in the paper.
            solver: "sped_up" solves one linear system, "exact" minimises the paper's first
                objective, which takes many times as long.
            alpha: how much smoothness counts; 0.15. What suits the sped-up solver flattens nearly
                everything with the exact one, for which about 0.0001 gives similar maps.
            sigma: of the blur or the window, which has about 5 sigma pixels a side; 2 or 3.
            gamma: power of the illumination; 0.8 or 0.6.
            eps: what keeps the weights of smoothness finite; 0.001.
            symmetric: whether in the variant "windowed" both equations of a link have the weight
                of the pixel where it starts; the published code takes the other pixel's.
            passes: how many the exact solver makes at most.
            clamp: whether outputs are limited to 0..1; False gives the raw quotient.
            quantise: how `enhance` makes 8-bit numbers.
            base: `device`.

        Raises:
            InvalidOption: a number is out of its range.
        """
        super().__init__(**base)
        defaults = _DEFAULTS[variant]
        self.variant, self.solver, self.symmetric = variant, solver, symmetric
        self.alpha = _number("alpha", alpha, defaults.alpha, least=0.0)
        self.sigma = _number("sigma", sigma, defaults.sigma, least=0.1, most=_LARGEST_SIGMA)
        self.gamma = _number("gamma", gamma, defaults.gamma, least=0.0)
        self.eps = _number("eps", eps, defaults.eps, least=1e-6)
        if passes < 1:
            msg = f"lime.passes must be at least 1, not {passes}"
            raise InvalidOption(msg)
        self.passes = passes
        self.clamp = clamp
        self.quantise: Literal["round", "truncate"] = quantise

    def enhance(self, image: Image, *, bgr: bool = False) -> Image:  # noqa: ARG002
        """Enhance one image; see `Enhancer.enhance`. The order of channels does not matter."""
        height, width = check_image(image).shape[:2]
        with explain_lack_of_memory(self.name, height, width):
            batch = image_to_batch(image, self.device)
            return batch_to_image(self.enhance_batch(batch), quantise=self.quantise)

    def enhance_batch(self, batch: "torch.Tensor") -> "torch.Tensor":
        """Enhance a batch; see `Enhancer.enhance_batch`."""
        divisor = self.maps(batch)["T_gamma"]
        enhanced = batch.detach().to(self.device) / divisor
        return enhanced.clamp_(0.0, 1.0) if self.clamp else enhanced

    def maps(self, batch: "torch.Tensor") -> "dict[str, torch.Tensor]":
        """The illumination in its steps; see the class."""
        import torch

        check_batch(batch)
        count, _, height, width = batch.shape
        with torch.no_grad(), explain_lack_of_memory(self.name, height, width, count):
            images = batch.detach().cpu().double().numpy()
            found = [self._light(image) for image in images]
            return {
                name: torch.stack([torch.from_numpy(one[name]) for one in found])
                .float()
                .unsqueeze(1)
                .to(self.device)
                for name in found[0]
            }

    def _light(self, image: "Map") -> "dict[str, Map]":
        import numpy as np

        from nat2024_enhancers.lime import illumination, refinement

        texture = self.variant == "texture"
        guess = illumination.guess_illumination(image, illumination.OFFSET if texture else 0.0)
        weigh = illumination.smoothness_by_texture if texture else illumination.smoothness_by_window
        smoothness = weigh(guess, self.sigma, self.eps)
        if self.solver == "exact":
            refined = refinement.refine_exactly(guess, smoothness, self.alpha, passes=self.passes)
        else:
            of_start = texture or self.symmetric
            refined = refinement.refine_quickly(guess, smoothness, self.alpha, of_start=of_start)
        limited = np.clip(refined, _LEAST, None if texture else 1.0)
        return {
            "T_init": guess,
            "wx": smoothness.weight_x,
            "wy": smoothness.weight_y,
            "T_refined" if texture else "T_refined_clipped": limited,
            "T_gamma": limited**self.gamma,
        }


def _number(
    name: str, given: float | None, default: float, *, least: float, most: float = math.inf
) -> float:
    value = default if given is None else float(given)
    if not (math.isfinite(value) and least <= value <= most):
        upper = "" if math.isinf(most) else f" and at most {most:g}"
        msg = f"lime.{name} must be a finite number of at least {least:g}{upper}, not {given}"
        raise InvalidOption(msg)
    return value
