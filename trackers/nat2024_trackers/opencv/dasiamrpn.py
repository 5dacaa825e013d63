"""The tracker `opencv_dasiamrpn`: OpenCV's TrackerDaSiamRPN over three ONNX files."""

import dataclasses
from typing import Any, ClassVar

import msgspec

from nat2024.cards import Card, WeightsFile, read_card
from nat2024.errors import WeightsMissing
from nat2024.registry import register_tracker
from nat2024.zoo import WeightsSpec, sha256_of
from nat2024_trackers.opencv.base import OpenCVTracker, finite_score, try_out
from nat2024_trackers.opencv.onnx_files import find_folder

_FILES = {
    "model": "dasiamrpn_model.onnx",
    "kernel_cls1": "dasiamrpn_kernel_cls1.onnx",
    "kernel_r1": "dasiamrpn_kernel_r1.onnx",
}


@register_tracker("opencv_dasiamrpn")
class OpenCVDaSiamRPN(OpenCVTracker):
    """DaSiamRPN as OpenCV runs it."""

    card: ClassVar[Card] = read_card("nat2024_trackers.opencv", "dasiamrpn.toml")

    def __init__(self, *, weights: WeightsSpec = None, **base: Any) -> None:
        """Find the three networks and try them once.

        Args:
            weights: the folder that holds the three ONNX files under their published names.
            base: `enhancer`, `device`, `scope`, of which there is only "frame".

        Raises:
            InvalidOption: fresh weights, which ONNX files do not have.
            WeightsMissing: no folder, or files are not in it; says which.
            WeightsMismatch: the files do not run.
        """
        super().__init__(**base)
        wanted = _as_folder(self.card)
        found, folder = find_folder(self.name, weights, wanted, "its three ONNX files")
        self._files = {part: folder / name for part, name in _FILES.items()}
        missing = [path.name for path in self._files.values() if not path.is_file()]
        if missing:
            msg = f"{folder}: no {' and no '.join(missing)} in it; all three are needed"
            raise WeightsMissing(msg)
        files = tuple(self._files.values())
        self.weights = dataclasses.replace(found, sha256=sha256_of(*files), files=files)
        try_out(self, f"{folder}: {', '.join(_FILES.values())}")

    def make(self) -> Any:
        """A new tracker; the networks are read anew, so no state is left over."""
        import cv2

        parameters: Any = cv2.TrackerDaSiamRPN.Params()
        for part, path in self._files.items():
            setattr(parameters, part, str(path))
        return cv2.TrackerDaSiamRPN.create(parameters)

    def confidence(self, tracker: Any) -> float:
        """OpenCV's score; 0 where it is no finite number."""
        return finite_score(tracker)


def _as_folder(card: Card) -> Card:
    """The card with the three files as the one thing that a user has to get."""
    names = ", ".join(file.name for file in card.weights)
    first = card.weights[0]
    folder = WeightsFile(
        name=f"{names}, all in one folder", where=first.where, licence=first.licence
    )
    return msgspec.structs.replace(card, weights=(folder,))
