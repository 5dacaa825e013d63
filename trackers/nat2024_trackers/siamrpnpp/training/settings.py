"""How `siamrpnpp` is trained: what its network is shown, and a preset for one or two cores."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Annotated, Any, Literal

import msgspec

Share = Annotated[float, msgspec.Meta(ge=0.0, le=1.0)]
Amount = Annotated[float, msgspec.Meta(ge=0.0)]


class PairSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What a training of `siamrpnpp` shows its network; all else is in the loop's settings.

    Attributes:
        search: side of the search crops, 127 plus a multiple of 8; tracking takes 255 whatever
            was trained on.
        shift, scale, aspect, turn: as in `Ranges`.
        procedural, composite, still, clips: shares of the generators, as in `Mix`.
        checked: new pairs of each generator, of the same material, that a validation looks at.
        precision: of convolutions; sums, norms and the loss are float32 in any case.
    """

    search: Annotated[int, msgspec.Meta(ge=127)] = 191
    shift: Amount = 32.0
    scale: Amount = 0.6
    aspect: Amount = 0.3
    turn: Amount = 0.12
    procedural: Share = 0.36
    composite: Share = 0.24
    still: Share = 0.04
    clips: Share = 0.36
    checked: Annotated[int, msgspec.Meta(ge=3)] = 48
    precision: Literal["bfloat16", "float32"] = "bfloat16"


PRESETS: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "default": {
            "steps": 8000,
            "batch_size": 8,
            "optimiser": "adamw",
            "learning_rate": 2e-3,
            "weight_decay": 1e-4,
            "schedule": "cosine",
            "warm_up": 300,
            "final_rate": 0.02,
            "clip": 5.0,
            "average": 0.999,
            "checkpoint_every": 250,
            "validate_every": 1000,
        },
    }
)
"""Settings by preset: minutes to an hour on one or two cores."""
