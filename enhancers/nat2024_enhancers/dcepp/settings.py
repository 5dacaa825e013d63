"""How DCE++ is trained: the values of its loss, and presets."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Annotated, Any

import msgspec

Weight = Annotated[float, msgspec.Meta(ge=0.0)]


class DCEppSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Values of the loss; the defaults are the official code's.

    Attributes:
        smoothness: weight of the smoothness of x_r, beside the 2 of the code.
        spatial: weight of spatial consistency with the image.
        colour: weight of colour constancy.
        colour_least: added under its root, whose gradient of a grey image is NaN else.
        exposure: weight of the exposure.
        level: the wanted mean level of a region.
        region: side of the regions, pixels.
        training_scale: scale factor in training; the weights serve any.
    """

    smoothness: Weight = 1600.0
    spatial: Weight = 1.0
    colour: Weight = 5.0
    colour_least: Weight = 1e-12
    exposure: Weight = 10.0
    level: Annotated[float, msgspec.Meta(ge=0, le=1)] = 0.6
    region: Annotated[int, msgspec.Meta(ge=1)] = 16
    training_scale: Annotated[int, msgspec.Meta(ge=1)] = 1


_PAPER: dict[str, Any] = {
    "epochs": 100,
    "batch_size": 8,
    "optimiser": "adam",
    "learning_rate": 1e-4,
    "weight_decay": 1e-4,
    "clip": 0.1,
    "size": 512,
}

PRESETS: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "paper": _PAPER,
        "default": {
            "steps": 300,
            "batch_size": 4,
            "learning_rate": 1e-3,
            "weight_decay": 1e-4,
            "schedule": "cosine",
            "final_rate": 0.02,
            "clip": 0.1,
            "crop": 128,
            "mirror": 0.5,
            "draw": "uniform",
            "level": 0.35,
            "smoothness": 3.0,
            "checkpoint_every": 100,
        },
    }
)
"""Settings by preset: the authors' recipe, for images of all exposures; and minutes on night images
alone, which made the weights that come with the package. There the wanted level must be lower, and
with the smoothness of the authors' recipe one curve for all pixels comes out."""
