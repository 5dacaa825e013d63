"""The tracker `opencv_nano`: OpenCV's TrackerNano over the published ONNX files of NanoTrack."""

from typing import Any, ClassVar

from nat2024.cards import Card, read_card
from nat2024.errors import InvalidOption
from nat2024.registry import register_tracker
from nat2024.zoo import WeightsSpec
from nat2024_trackers.opencv.base import OpenCVTracker, finite_score, try_out
from nat2024_trackers.opencv.onnx_files import find_onnx_weights

_VARIANTS = ("v1", "v2")


@register_tracker("opencv_nano")
class OpenCVNano(OpenCVTracker):
    """NanoTrack as OpenCV runs it; results differ from the authors' own PyTorch tracker.

    Attributes:
        variant: which NanoTrack the files are.
        files: the two ONNX files in use.
    """

    card: ClassVar[Card] = read_card("nat2024_trackers.opencv", "nano.toml")

    def __init__(self, *, weights: WeightsSpec = None, variant: str = "v1", **base: Any) -> None:
        """Find the two networks and try them once.

        Args:
            weights: a folder that holds one `*backbone*.onnx` and one `*head*.onnx` of the variant.
            variant: "v1" or "v2"; v3 does not run in OpenCV's tracker (`nanotrack` runs it).
            base: `enhancer`, `device`, `scope`, of which there is only "frame".

        Raises:
            InvalidOption: no such variant, or fresh weights, which ONNX files do not have.
            WeightsMissing: no folder, or one of the two files is not in it.
            WeightsMismatch: the files do not run, or are of another variant.
        """
        super().__init__(**base)
        self.variant = _checked(variant)
        self.files, self.weights = find_onnx_weights(
            self.name, weights, self.card, variant, _VARIANTS
        )
        try_out(self, str(self.files), "the files of NanoTrack v3 (15x15 map) cannot run there")

    def make(self) -> Any:
        """A new tracker; the networks are read anew, so no state is left over."""
        import cv2

        parameters: Any = cv2.TrackerNano.Params()
        parameters.backbone = str(self.files.backbone)
        parameters.neckhead = str(self.files.head)
        return cv2.TrackerNano.create(parameters)

    def confidence(self, tracker: Any) -> float:
        """OpenCV's score: the network's, penalised and windowed; 0 where it is no finite number."""
        return finite_score(tracker)


def _checked(variant: str) -> str:
    if variant in _VARIANTS:
        return variant
    why = " (OpenCV expects a 16x16 map, v3 gives 15x15)" if variant == "v3" else ""
    msg = f"opencv_nano has no variant {variant!r}{why}; it has {', '.join(_VARIANTS)}"
    raise InvalidOption(msg)
