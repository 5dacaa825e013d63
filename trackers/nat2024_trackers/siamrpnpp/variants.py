"""The published configurations of SiamRPN++, each with its constants, and one of our own.

Source: `experiments/*/config.yaml` of STVIR/pysot; `otb` configurations are those tuned for OTB.
`compact` is not published: a small network trained by this project, its constants chosen on
rendered clips.
"""

from dataclasses import dataclass
from typing import Literal, TypeAlias

from nat2024.errors import InvalidOption
from nat2024.types import closest
from nat2024_trackers.siamese.state import Constants

Backbone: TypeAlias = Literal["alexnet", "mobilenetv2", "resnet50", "compact"]

ANCHORS = 5
STRIDE = 8


@dataclass(frozen=True, slots=True)
class Variant:
    """One configuration.

    Attributes:
        backbone: which feature network.
        constants: of the tracking loop.
        experiment: folder of the official configuration and of its `model.pth`; empty for what is
            not published.
        weighted: whether the heads of several levels have learned weights.
    """

    backbone: Backbone
    constants: Constants
    experiment: str
    weighted: bool = False


def _constants(
    instance_size: int, base: int, penalty_k: float, window_influence: float, learning_rate: float
) -> Constants:
    return Constants(
        instance_size=instance_size,
        map_size=(instance_size - 127) // STRIDE + 1 + base,
        stride=STRIDE,
        penalty_k=penalty_k,
        window_influence=window_influence,
        learning_rate=learning_rate,
        anchors=ANCHORS,
    )


# instance size, map cells added, penalty_k, window influence, learning rate
_ALEX = _constants(287, 0, 0.16, 0.40, 0.30)
_MOBILEV2 = _constants(255, 8, 0.04, 0.40, 0.50)
_R50 = _constants(255, 8, 0.05, 0.42, 0.38)
_R50_OTB = _constants(255, 8, 0.24, 0.50, 0.25)
_COMPACT = _constants(255, 0, 0.60, 0.30, 0.30)

VARIANTS: dict[str, Variant] = {
    "alex": Variant("alexnet", _ALEX, "siamrpn_alex_dwxcorr"),
    "alex_otb": Variant("alexnet", _ALEX, "siamrpn_alex_dwxcorr_otb"),
    "mobilev2": Variant("mobilenetv2", _MOBILEV2, "siamrpn_mobilev2_l234_dwxcorr"),
    "r50": Variant("resnet50", _R50, "siamrpn_r50_l234_dwxcorr", weighted=True),
    "r50_otb": Variant("resnet50", _R50_OTB, "siamrpn_r50_l234_dwxcorr_otb"),
    "compact": Variant("compact", _COMPACT, ""),
}


def find_variant(name: str) -> Variant:
    """The variant of that name; `InvalidOption` says which there are."""
    try:
        return VARIANTS[name]
    except KeyError:
        close = closest(name, VARIANTS)
        msg = f"siamrpnpp has no variant {name!r}{close}; it has {', '.join(VARIANTS)}"
        raise InvalidOption(msg) from None
