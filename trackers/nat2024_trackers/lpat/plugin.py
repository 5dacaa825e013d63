"""The tracker `lpat`."""

from typing import TYPE_CHECKING, Any, ClassVar

from nat2024.cards import Card, read_card
from nat2024.registry import register_tracker
from nat2024_trackers.hift.decoder import DistanceDecoder, distance_constants
from nat2024_trackers.siamese.tracker import OneNetworkTracker

if TYPE_CHECKING:
    from torch import nn

    from nat2024_trackers.siamese.state import Constants
    from nat2024_trackers.siamese.tracker import Decoder

CONSTANTS = distance_constants(penalty_k=0.385, window_influence=0.205, learning_rate=0.285)


@register_tracker("lpat")
class LPAT(OneNetworkTracker):
    """LPAT with the network and constants of vision4robotics/LPAT."""

    card: ClassVar[Card] = read_card("nat2024_trackers.lpat")

    def __init__(self, *, enhance_template: bool = False, **base: Any) -> None:
        """Build the network and load its weights; `base` as in `OneNetworkTracker`.

        Args:
            enhance_template: whether the template crop is enhanced too; not by default, since the
                published results with enhancers were made without.
            base: `weights` and the options of `SiameseTracker`.

        Raises:
            WeightsMissing, WeightsMismatch: no weights, or of another network.
        """
        super().__init__(enhance_template=enhance_template, **base)

    def build(self) -> "tuple[nn.Module, Decoder, Constants]":
        """The network, its decoder and the constants above."""
        from nat2024_trackers.lpat.model import LPATNetwork

        return LPATNetwork(), DistanceDecoder(), CONSTANTS
