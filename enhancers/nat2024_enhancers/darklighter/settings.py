"""How DarkLighter is trained: the values of its loss, and presets."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Annotated, Any

import msgspec

Weight = Annotated[float, msgspec.Meta(ge=0.0)]


class DarkLighterSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Values of the loss and of the start.

    The official loss has a perceptual term of VGG16 features as well, with weight 0.001; it is left
    out, since its weights cannot be shipped.

    Attributes:
        smoothness: weight of the smoothness of the light maps.
        colour: weight of colour constancy.
        exposure: weight of the exposure, which counts more in the centre.
        level: the wanted mean level of a region.
        noise: weight of the size of the noise maps.
        initial_spread: standard deviation of the initial weights; 0 keeps PyTorch's.
    """

    smoothness: Weight = 1600.0
    colour: Weight = 50.0
    exposure: Weight = 10.0
    level: Annotated[float, msgspec.Meta(ge=0, le=1)] = 0.6
    noise: Weight = 50.0
    initial_spread: Weight = 0.02


_OFFICIAL: dict[str, Any] = {
    "epochs": 200,
    "batch_size": 32,
    "optimiser": "adam",
    "learning_rate": 1e-4,
    "weight_decay": 1e-4,
    "clip": 0.1,
}

PRESETS: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "paper": _OFFICIAL,
        "default": {
            **_OFFICIAL,
            "epochs": 0,
            "steps": 600,
            "batch_size": 4,
            "learning_rate": 1e-3,
            "schedule": "cosine",
            "final_rate": 0.02,
            "level": 0.4,
            "checkpoint_every": 100,
        },
    }
)
"""Settings by preset: the authors' recipe without its VGG term; and a short one."""
