"""The tracker `siamapnpp`."""

from typing import TYPE_CHECKING, ClassVar

from nat2024.cards import Card, read_card
from nat2024.registry import register_tracker
from nat2024_trackers.siamapn.decoder import ProposalDecoder, proposal_constants
from nat2024_trackers.siamese.tracker import OneNetworkTracker

if TYPE_CHECKING:
    from torch import nn

    from nat2024_trackers.siamese.state import Constants
    from nat2024_trackers.siamese.tracker import Decoder

# All three are only in the defaults of the official code, not in its yaml file.
CONSTANTS = proposal_constants(penalty_k=0.079, window_influence=0.44, learning_rate=0.31)
SCORE_WEIGHTS = (1.2, 1.3, 1.1)
# A quarter of the width of the search crop, rounded down.
ANCHOR_REACH = 71


@register_tracker("siamapnpp")
class SiamAPNpp(OneNetworkTracker):
    """SiamAPN++ with the network and constants of vision4robotics/SiamAPN.

    Kept from the official code, since trained weights depend on it: the third classification enters
    the score as a raw logit, the weighted sum is divided by 3 although the weights add up to 3.6,
    and the penalty's divisions are guarded by 1e-5.
    """

    card: ClassVar[Card] = read_card("nat2024_trackers.siamapnpp")

    def build(self) -> "tuple[nn.Module, Decoder, Constants]":
        """The network, its decoder and the constants above."""
        from nat2024_trackers.siamapnpp.model import SiamAPNppNetwork

        return SiamAPNppNetwork(), ProposalDecoder(ANCHOR_REACH, SCORE_WEIGHTS), CONSTANTS
