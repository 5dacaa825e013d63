"""How RUAS is trained: the values of its losses, and presets."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Annotated, Any

import msgspec

Weight = Annotated[float, msgspec.Meta(ge=0.0)]


class RUASSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Values of the losses of the illumination cells and of the denoiser.

    The official code trains the two by turns: the cells at every step with learning rate 0.015, the
    denoiser at every 50th with 0.001. Here both learn at every step of one optimiser; neither loss
    reaches the other's weights, and `denoising` makes up for the denoiser's slower pace.

    Attributes:
        fidelity: weight of the mean squared distance of the illumination to the image.
        smoothness: weight of the illumination's smoothness.
        smooth_fixed: whether colours and the exponent of the smoothness are as the paper means
            them; the official code scrambles the colours and gets the exponent wrong.
        denoising: weight of the denoiser's loss; 1/750 stands for 1/15 of the learning rate at
            every 50th step.
    """

    fidelity: Weight = 0.5
    smoothness: Weight = 1.0
    smooth_fixed: bool = False
    denoising: Weight = 1 / 750


_OFFICIAL: dict[str, Any] = {
    "steps": 800,
    "batch_size": 1,
    "optimiser": "sgd",
    "learning_rate": 0.015,
    "momentum": 0.9,
    "weight_decay": 3e-4,
    "clip": 5.0,
    "size": 320,
    "fit": "crop",
}

PRESETS: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "paper": _OFFICIAL,
        "default": {
            **_OFFICIAL,
            "size": 256,
            "fit": "resize",
            "crop": 128,
            "mirror": 0.5,
            "draw": "uniform",
            "checkpoint_every": 100,
        },
    }
)
"""Settings by preset: the authors' recipe over all pictures, where their code keeps drawing windows
of the first one alone; and the same on smaller crops of whole pictures."""
