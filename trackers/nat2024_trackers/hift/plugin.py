"""The tracker `hift`."""

from typing import TYPE_CHECKING, ClassVar

from nat2024.cards import Card, read_card
from nat2024.registry import register_tracker
from nat2024_trackers.hift.decoder import DistanceDecoder, distance_constants
from nat2024_trackers.siamese.tracker import OneNetworkTracker

if TYPE_CHECKING:
    from torch import nn

    from nat2024_trackers.siamese.state import Constants
    from nat2024_trackers.siamese.tracker import Decoder

CONSTANTS = distance_constants(penalty_k=0.08, window_influence=0.42, learning_rate=0.30)


@register_tracker("hift")
class HiFT(OneNetworkTracker):
    """HiFT with the network and constants of vision4robotics/HiFT."""

    card: ClassVar[Card] = read_card("nat2024_trackers.hift")

    def build(self) -> "tuple[nn.Module, Decoder, Constants]":
        """The network, its decoder and the constants above."""
        from nat2024_trackers.hift.model import HiFTNetwork

        return HiFTNetwork(), DistanceDecoder(), CONSTANTS
