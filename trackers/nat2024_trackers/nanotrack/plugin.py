"""The tracker `nanotrack`."""

from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import msgspec

from nat2024.backends import OPENVINO_FIRST, ExportedPart
from nat2024.cards import Card, read_card
from nat2024.errors import UsageError, WeightsMismatch
from nat2024.files import expand
from nat2024.interfaces import load_weights
from nat2024.registry import register_tracker
from nat2024.zoo import Weights, WeightsSpec, find_weights
from nat2024_trackers.nanotrack.points import PointDecoder
from nat2024_trackers.nanotrack.variants import VARIANTS, find_variant
from nat2024_trackers.siamese.tracker import SiameseNetwork, SiameseTracker

if TYPE_CHECKING:
    import torch

    from nat2024_trackers.nanotrack.onnx_network import OnnxNetwork
    from nat2024_trackers.siamese.state import Constants

_ONNX_CARD = read_card("nat2024_trackers.opencv", "nano.toml")


@register_tracker("nanotrack")
class NanoTrack(SiameseTracker):
    """NanoTrack in the loop and with the constants of its authors, crops enhanced on request.

    Attributes:
        variant: which version it is.
        runtime: what runs the network. With "opencv" there is no `model`.
    """

    card: ClassVar[Card] = read_card("nat2024_trackers.nanotrack")
    fastest_backends = OPENVINO_FIRST

    def __init__(
        self,
        *,
        weights: WeightsSpec = None,
        variant: str = "v3",
        runtime: Literal["torch", "opencv"] = "torch",
        **base: Any,
    ) -> None:
        """Build the network and load its weights; `base` as in `SiameseTracker`.

        Args:
            weights: a checkpoint path, False for fresh initial weights, None for the best at hand;
                with runtime "opencv" a folder that holds one `*backbone*.onnx` and one
                `*head*.onnx` of the variant.
            variant: "v1", "v2" or "v3".
            runtime: "torch", or "opencv" for the authors' ONNX files in `cv2.dnn`, on the CPU
                whatever `device` says, which is then for the enhancer; `backend` is not asked.
            base: `enhancer`, `device`, `scope`, `enhance_template`, `backend`, `precision`.

        Raises:
            InvalidOption: no such variant, or fresh weights with runtime "opencv".
            WeightsMissing, WeightsMismatch: no weights, or of another network or variant.
        """
        self.variant = variant
        self.runtime = runtime
        constants = find_variant(variant)
        build = self._build_onnx if runtime == "opencv" else self._build_torch
        if runtime == "opencv":
            base["backend"] = "torch"  # it has a network of its own
        super().__init__(build(weights, constants), PointDecoder(constants), constants, **base)
        self._network: SiameseNetwork = self.model
        if runtime == "opencv":
            del self.model  # it has no PyTorch weights that could be listed or loaded

    @property
    def network(self) -> SiameseNetwork:
        """What the loop runs."""
        return self._network if self.runtime == "opencv" else super().network

    def export_onnx(self, folder: str | Path) -> list[ExportedPart]:
        """As `SiameseTracker.export_onnx`.

        Raises:
            UsageError: with runtime "opencv", whose network is two ONNX files already.
        """
        if self.runtime == "opencv":
            msg = "nanotrack with runtime=opencv runs ONNX files already; export runtime=torch"
            raise UsageError(msg)
        return super().export_onnx(folder)

    def _build_torch(self, weights: WeightsSpec, constants: "Constants") -> "torch.nn.Module":
        del constants
        from nat2024_trackers.nanotrack.model import NanoTrackNetwork

        _refuse_onnx(weights)
        files = tuple(file for file in self.card.weights if file.variant == self.variant)
        card = msgspec.structs.replace(self.card, weights=files)
        self.weights = find_weights(self.name, weights, card)
        model = NanoTrackNetwork(self.variant)
        load_weights(model, self.weights)
        return model

    def _build_onnx(self, weights: WeightsSpec, constants: "Constants") -> "OnnxNetwork":
        from nat2024_trackers.nanotrack.onnx_network import OnnxNetwork
        from nat2024_trackers.opencv.onnx_files import find_onnx_weights

        files, self.weights = find_onnx_weights(
            self.name, weights, _ONNX_CARD, self.variant, tuple(VARIANTS)
        )
        return OnnxNetwork(files, constants)


def _refuse_onnx(weights: WeightsSpec) -> None:
    """Say which option runs ONNX files, where these are given to PyTorch."""
    path = weights.path if isinstance(weights, Weights) else weights
    if not path:
        return
    path = expand(path)
    if path.suffix.lower() == ".onnx" or (path.is_dir() and any(path.glob("*.onnx"))):
        msg = f"{path}: ONNX files run with runtime=opencv; runtime=torch takes nanotrackv*.pth"
        raise WeightsMismatch(msg)
