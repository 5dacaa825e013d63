"""The tracker `siamapnpp`."""

from typing import ClassVar

from nat2024.cards import Card, read_card
from nat2024.interfaces import BatchEnhancer, Scope, load_weights
from nat2024.registry import register_tracker
from nat2024.zoo import WeightsSpec, find_weights
from nat2024_trackers.siamapn.decoder import ProposalDecoder, proposal_constants
from nat2024_trackers.siamese.tracker import SiameseTracker

# All three are only in the defaults of the official code, not in its yaml file.
CONSTANTS = proposal_constants(penalty_k=0.079, window_influence=0.44, learning_rate=0.31)
SCORE_WEIGHTS = (1.2, 1.3, 1.1)
# A quarter of the width of the search crop, rounded down.
ANCHOR_REACH = 71


@register_tracker("siamapnpp")
class SiamAPNpp(SiameseTracker):
    """SiamAPN++ with the network and constants of vision4robotics/SiamAPN.

    Kept from the official code, since trained weights depend on it: the third classification enters
    the score as a raw logit, the weighted sum is divided by 3 although the weights add up to 3.6,
    and the penalty's divisions are guarded by 1e-5.
    """

    card: ClassVar[Card] = read_card("nat2024_trackers.siamapnpp")

    def __init__(
        self,
        *,
        weights: WeightsSpec = None,
        enhancer: BatchEnhancer | None = None,
        device: str = "cpu",
        scope: Scope | None = None,
        enhance_template: bool = True,
    ) -> None:
        """Build the network and load its weights.

        Args:
            weights: a checkpoint path, False for fresh initial weights, None for the best at hand.
            enhancer: anything with `enhance_batch`.
            device: where the network runs, such as "cpu" or "cuda:1".
            scope: what is enhanced: "patch" (default) or "frame".
            enhance_template: whether the template crop is enhanced too.

        Raises:
            WeightsMissing, WeightsMismatch: no weights, or of another network.
        """
        from nat2024_trackers.siamapnpp.model import SiamAPNppNetwork

        self.weights = find_weights(self.name, weights, self.card)
        model = SiamAPNppNetwork()
        load_weights(model, self.weights)
        super().__init__(
            model,
            ProposalDecoder(ANCHOR_REACH, SCORE_WEIGHTS),
            CONSTANTS,
            enhancer=enhancer,
            device=device,
            scope=scope,
            enhance_template=enhance_template,
        )
