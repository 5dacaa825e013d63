"""How HighlightNet is trained: the values of its loss, and presets."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Annotated, Any

import msgspec

Weight = Annotated[float, msgspec.Meta(ge=0.0)]
Level = Annotated[float, msgspec.Meta(ge=0, le=1)]


class HighlightNetSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Values of the loss and of the start; the defaults are the official code's.

    Attributes:
        smoothness: weight of the smoothness of the range mask, beside the 2 of the code.
        spatial: weight of spatial consistency with the image.
        exposure: weight of the exposure.
        level: the wanted mean level of a region.
        darkness: weight of keeping dark what is nearly black in the image.
        region: side of the regions, pixels.
        initial_spread: standard deviation of the initial weights; 0 keeps PyTorch's.
    """

    smoothness: Weight = 200.0
    spatial: Weight = 1.0
    exposure: Weight = 20.0
    level: Level = 0.6
    darkness: Weight = 50.0
    region: Annotated[int, msgspec.Meta(ge=1)] = 16
    initial_spread: Weight = 0.02


_OFFICIAL: dict[str, Any] = {
    "epochs": 100,
    "batch_size": 8,
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
            "learning_rate": 3e-3,
            "schedule": "cosine",
            "final_rate": 0.02,
            "mirror": 0.5,
            "draw": "uniform",
            "level": 0.4,
            "checkpoint_every": 100,
        },
    }
)
"""Settings by preset: the authors' recipe; and minutes on night images alone, whose wanted level
must be lower."""
