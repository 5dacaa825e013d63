"""The tracker `opencv_vit`: OpenCV's TrackerVit over one ONNX file."""

from pathlib import Path
from typing import Any, ClassVar

from nat2024.cards import Card, read_card
from nat2024.errors import InvalidOption, WeightsMissing
from nat2024.registry import register_tracker
from nat2024.zoo import WeightsSpec, find_weights
from nat2024_trackers.opencv.base import OpenCVTracker, finite_score, try_out


@register_tracker("opencv_vit")
class OpenCVVit(OpenCVTracker):
    """VitTrack as OpenCV runs it; below OpenCV's score threshold (0.2) the last box stays."""

    card: ClassVar[Card] = read_card("nat2024_trackers.opencv", "vit.toml")

    def __init__(self, *, weights: WeightsSpec = None, **base: Any) -> None:
        """Find the network and try it once.

        Args:
            weights: the ONNX file.
            base: `enhancer`, `device`, `scope`, of which there is only "frame".

        Raises:
            InvalidOption: fresh weights, which ONNX files do not have.
            WeightsMissing: no such file.
            WeightsMismatch: the file does not run.
        """
        super().__init__(**base)
        if weights is False:
            msg = f"{self.name} has no fresh weights; pass its ONNX file"
            raise InvalidOption(msg)
        self.weights = find_weights(self.name, weights, self.card)
        self._file = self.weights.path or Path()
        if not self._file.is_file():
            msg = f"weights of {self.name}: {self._file}: pass the ONNX file itself"
            raise WeightsMissing(msg)
        try_out(self, str(self._file))

    def make(self) -> Any:
        """A new tracker; the network is read anew, so no state is left over."""
        import cv2

        parameters: Any = cv2.TrackerVit.Params()
        parameters.net = str(self._file)
        return cv2.TrackerVit.create(parameters)

    def confidence(self, tracker: Any) -> float:
        """OpenCV's score: the network's, windowed; 0 where it is no finite number."""
        return finite_score(tracker)
