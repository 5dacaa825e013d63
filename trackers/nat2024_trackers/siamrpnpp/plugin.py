"""The tracker `siamrpnpp`."""

from typing import ClassVar

import msgspec

from nat2024.cards import Card, read_card
from nat2024.interfaces import BatchEnhancer, Scope, load_weights
from nat2024.registry import register_tracker
from nat2024.zoo import WeightsSpec, find_weights
from nat2024_trackers.siamese.tracker import SiameseTracker
from nat2024_trackers.siamrpnpp.anchors import AnchorDecoder
from nat2024_trackers.siamrpnpp.variants import Variant, find_variant

_DEFAULT_VARIANT = "alex"


@register_tracker("siamrpnpp")
class SiamRPNpp(SiameseTracker):
    """SiamRPN++ with the networks and constants of STVIR/pysot.

    Attributes:
        variant: name of the configuration in use.
    """

    card: ClassVar[Card] = read_card("nat2024_trackers.siamrpnpp")

    def __init__(
        self,
        *,
        weights: WeightsSpec = None,
        enhancer: BatchEnhancer | None = None,
        device: str = "cpu",
        scope: Scope | None = None,
        enhance_template: bool = True,
        variant: str | None = None,
    ) -> None:
        """Build the network and load its weights.

        Args:
            weights: a checkpoint path, False for fresh initial weights, None for the best at hand.
            enhancer: anything with `enhance_batch`.
            device: where the network runs, such as "cpu" or "cuda:1".
            scope: what is enhanced: "patch" (default) or "frame".
            enhance_template: whether the template crop is enhanced too.
            variant: which configuration; None is "alex".

        Raises:
            InvalidOption: no such variant.
            WeightsMissing, WeightsMismatch: no weights, or of another network.
        """
        from nat2024_trackers.siamrpnpp.model import SiamRPN

        self.variant = variant or _DEFAULT_VARIANT
        chosen = find_variant(self.variant)
        self.weights = find_weights(self.name, weights, _card_of(self.card, chosen))
        model = SiamRPN(chosen)
        load_weights(model, self.weights)
        super().__init__(
            model,
            AnchorDecoder(chosen.constants),
            chosen.constants,
            enhancer=enhancer,
            device=device,
            scope=scope,
            enhance_template=enhance_template,
        )


def _card_of(card: Card, variant: Variant) -> Card:
    """The card with the weights files of one variant only, so that errors name the right file."""
    files = tuple(f for f in card.weights if f.name.startswith(f"{variant.experiment}/"))
    return msgspec.structs.replace(card, weights=files)
