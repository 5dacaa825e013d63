"""The three published versions of NanoTrack, each with its constants.

Source: the configurations `configv1.yaml` to `configv3.yaml` of HonglinChu/SiamTrackers.
"""

from nat2024.errors import InvalidOption
from nat2024.types import closest
from nat2024_trackers.siamese.state import Constants

STRIDE = 16


def _constants(
    map_size: int, penalty_k: float, window_influence: float, learning_rate: float
) -> Constants:
    return Constants(
        instance_size=255,
        map_size=map_size,
        stride=STRIDE,
        penalty_k=penalty_k,
        window_influence=window_influence,
        learning_rate=learning_rate,
    )


# map cells along one side, penalty_k, window influence, learning rate
VARIANTS: dict[str, Constants] = {
    "v1": _constants(16, 0.148, 0.462, 0.390),
    "v2": _constants(16, 0.150, 0.490, 0.385),
    "v3": _constants(15, 0.138, 0.455, 0.348),
}


def find_variant(name: str) -> Constants:
    """The constants of that version; `InvalidOption` says which there are."""
    try:
        return VARIANTS[name]
    except KeyError:
        close = closest(name, VARIANTS)
        msg = f"nanotrack has no variant {name!r}{close}; it has {', '.join(VARIANTS)}"
        raise InvalidOption(msg) from None
