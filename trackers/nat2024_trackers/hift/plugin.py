"""The tracker `hift`."""

from typing import ClassVar

from nat2024.cards import Card, read_card
from nat2024.interfaces import BatchEnhancer, Scope, load_weights
from nat2024.registry import register_tracker
from nat2024.zoo import WeightsSpec, find_weights
from nat2024_trackers.hift.decoder import DistanceDecoder, distance_constants
from nat2024_trackers.siamese.tracker import SiameseTracker

CONSTANTS = distance_constants(penalty_k=0.08, window_influence=0.42, learning_rate=0.30)


@register_tracker("hift")
class HiFT(SiameseTracker):
    """HiFT with the network and constants of vision4robotics/HiFT."""

    card: ClassVar[Card] = read_card("nat2024_trackers.hift")

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
        from nat2024_trackers.hift.model import HiFTNetwork

        self.weights = find_weights(self.name, weights, self.card)
        model = HiFTNetwork()
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
