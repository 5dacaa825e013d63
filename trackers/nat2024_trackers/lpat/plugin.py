"""The tracker `lpat`."""

from typing import ClassVar

from nat2024.cards import Card, read_card
from nat2024.interfaces import BatchEnhancer, Scope, load_weights
from nat2024.registry import register_tracker
from nat2024.zoo import WeightsSpec, find_weights
from nat2024_trackers.hift.decoder import DistanceDecoder, distance_constants
from nat2024_trackers.siamese.tracker import SiameseTracker

CONSTANTS = distance_constants(penalty_k=0.385, window_influence=0.205, learning_rate=0.285)


@register_tracker("lpat")
class LPAT(SiameseTracker):
    """LPAT with the network and constants of vision4robotics/LPAT."""

    card: ClassVar[Card] = read_card("nat2024_trackers.lpat")

    def __init__(
        self,
        *,
        weights: WeightsSpec = None,
        enhancer: BatchEnhancer | None = None,
        device: str = "cpu",
        scope: Scope | None = None,
        enhance_template: bool = False,
    ) -> None:
        """Build the network and load its weights.

        Args:
            weights: a checkpoint path, False for fresh initial weights, None for the best at hand.
            enhancer: anything with `enhance_batch`.
            device: where the network runs, such as "cpu" or "cuda:1".
            scope: what is enhanced: "patch" (default) or "frame".
            enhance_template: whether the template crop is enhanced too; not by default, since the
                published results with enhancers were made without.

        Raises:
            WeightsMissing, WeightsMismatch: no weights, or of another network.
        """
        from nat2024_trackers.lpat.model import LPATNetwork

        self.weights = find_weights(self.name, weights, self.card)
        model = LPATNetwork()
        load_weights(model, self.weights)
        super().__init__(
            model,
            DistanceDecoder(),
            CONSTANTS,
            enhancer=enhancer,
            device=device,
            scope=scope,
            enhance_template=enhance_template,
        )
