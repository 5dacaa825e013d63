"""The tracker `siamapn`."""

from typing import TYPE_CHECKING, ClassVar

from nat2024.cards import Card, read_card
from nat2024.registry import register_tracker
from nat2024_trackers.siamapn.decoder import ProposalDecoder, proposal_constants
from nat2024_trackers.siamese.tracker import OneNetworkTracker

if TYPE_CHECKING:
    from torch import nn

    from nat2024_trackers.siamese.state import Constants
    from nat2024_trackers.siamese.tracker import Decoder

# The window influence is only in the defaults of the official code, not in its yaml file.
CONSTANTS = proposal_constants(penalty_k=0.08, window_influence=0.4364, learning_rate=0.302)
SCORE_WEIGHTS = (1.18, 1.0, 1.0)
# Half the width of the search crop.
ANCHOR_REACH = 143


@register_tracker("siamapn")
class SiamAPN(OneNetworkTracker):
    """SiamAPN with the network and constants of vision4robotics/SiamAPN.

    Kept from the official code, since trained weights depend on it: the third classification enters
    the score as a raw logit, and the penalty's divisions are guarded by 1e-5.
    """

    card: ClassVar[Card] = read_card("nat2024_trackers.siamapn")

    def build(self) -> "tuple[nn.Module, Decoder, Constants]":
        """The network, its decoder and the constants above."""
        from nat2024_trackers.siamapn.model import SiamAPNNetwork

        return SiamAPNNetwork(), ProposalDecoder(ANCHOR_REACH, SCORE_WEIGHTS), CONSTANTS
