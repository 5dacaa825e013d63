"""The tracker `siamrpnpp`."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar

import msgspec

from nat2024.cards import Card, read_card
from nat2024.interfaces import load_weights
from nat2024.registry import register_tracker
from nat2024.types import Image
from nat2024.zoo import Weights, WeightsSpec, find_weights
from nat2024_trackers.siamese.tracker import SiameseTracker
from nat2024_trackers.siamrpnpp.anchors import AnchorDecoder
from nat2024_trackers.siamrpnpp.training.settings import PRESETS, PairSettings
from nat2024_trackers.siamrpnpp.variants import Variant, find_variant

if TYPE_CHECKING:
    from torch import nn

    from nat2024_trackers.siamrpnpp.training.clips import BoxedClip
    from nat2024_trackers.siamrpnpp.training.recipe import PairBatches, PairLoss, PairValidation

_OFFICIAL, _BUNDLED = "alex", "compact"


@register_tracker("siamrpnpp")
class SiamRPNpp(SiameseTracker):
    """SiamRPN++ with the networks and constants of STVIR/pysot, or small with weights of our own.

    Attributes:
        variant: name of the configuration in use.
    """

    card: ClassVar[Card] = read_card("nat2024_trackers.siamrpnpp")
    training_settings = PairSettings()
    training_options: ClassVar[Mapping[str, Any]] = {"variant": _BUNDLED}
    training_presets: ClassVar[Mapping[str, Mapping[str, Any]]] = PRESETS

    def __init__(
        self, *, weights: WeightsSpec = None, variant: str | None = None, **base: Any
    ) -> None:
        """Build the network and load its weights; `base` as in `SiameseTracker`.

        Args:
            weights: a checkpoint path, False for fresh initial weights, None for the best at hand.
            variant: which configuration; None is "alex" where weights are given (or False) and
                else "compact", whose weights come with the package.
            base: `enhancer`, `device`, `scope`, `enhance_template`, `backend`, `precision`.

        Raises:
            InvalidOption: no such variant.
            WeightsMissing, WeightsMismatch: no weights, or of another network.
        """
        self.variant = variant or _default_variant(weights)
        chosen = find_variant(self.variant)
        self.weights = find_weights(self.name, weights, _card_of(self.card, self.variant))
        model = _build(chosen)
        load_weights(model, self.weights)
        super().__init__(model, AnchorDecoder(chosen.constants), chosen.constants, **base)

    def training_parts(
        self,
        photographs: Sequence[Image],
        clips: "Sequence[BoxedClip]",
        settings: PairSettings,
        *,
        seed: int,
        batch_size: int,
    ) -> "tuple[PairLoss, PairBatches, PairValidation]":
        """Loss, batches and validation for `nat2024.training.train`.

        Args:
            photographs: images that objects are cut from and laid on, BGR.
            clips: sequences with boxes.
            settings: which pairs are made of them.
            seed: of the pairs.
            batch_size: pairs a step.

        Raises:
            UsageError: there is no material, or the variant has heads of several levels.
        """
        from nat2024_trackers.siamrpnpp.training import recipe

        recipe.check_trainable(self.model, self.variant)
        pairs = recipe.make_pair_source(settings, photographs, clips, seed)
        unseen = recipe.make_pair_source(settings, photographs, clips, seed + 1)
        return (
            recipe.PairLoss(self.model, settings),
            recipe.PairBatches(pairs, batch_size),
            recipe.PairValidation(unseen, count=settings.checked),
        )


def _default_variant(weights: WeightsSpec) -> str:
    """The variant where none is named: that of weights which are at hand, else our own."""
    if isinstance(weights, Weights):
        return str(weights.options.get("variant", _OFFICIAL))
    return _BUNDLED if weights is None else _OFFICIAL


def _build(variant: Variant) -> "nn.Module":
    if variant.backbone == "compact":
        from nat2024_trackers.siamrpnpp.compact import CompactSiamRPN

        return CompactSiamRPN()
    from nat2024_trackers.siamrpnpp.model import SiamRPN

    return SiamRPN(variant)


def _card_of(card: Card, variant: str) -> Card:
    """The card with the weights files of one variant only, so that errors name the right file."""
    files = tuple(file for file in card.weights if file.variant == variant)
    return msgspec.structs.replace(card, weights=files)
