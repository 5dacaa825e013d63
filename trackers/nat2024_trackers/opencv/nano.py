"""The tracker `opencv_nano`: OpenCV's TrackerNano over the published ONNX files of NanoTrack."""

import dataclasses
from pathlib import Path
from typing import Any, ClassVar

import msgspec
import numpy as np

from nat2024.cards import Card, WeightsFile, read_card
from nat2024.errors import InvalidOption, WeightsMismatch, WeightsMissing
from nat2024.interfaces import BatchEnhancer, Scope
from nat2024.registry import register_tracker
from nat2024.zoo import Weights, WeightsSpec, find_weights, sha256_of
from nat2024_trackers.opencv.base import OpenCVFailure, OpenCVTracker
from nat2024_trackers.opencv.onnx_files import OnnxPair, find_pair

_VARIANTS = ("v1", "v2")


@register_tracker("opencv_nano")
class OpenCVNano(OpenCVTracker):
    """NanoTrack as OpenCV runs it; results differ from the authors' own PyTorch tracker.

    Attributes:
        variant: which NanoTrack the files are.
        files: the two ONNX files in use.
    """

    card: ClassVar[Card] = read_card("nat2024_trackers.opencv", "nano.toml")

    def __init__(
        self,
        *,
        weights: WeightsSpec = None,
        enhancer: BatchEnhancer | None = None,
        device: str = "cpu",
        scope: Scope | None = None,
        variant: str = "v1",
    ) -> None:
        """Find the two networks and try them once.

        Args:
            weights: a folder that holds one `*backbone*.onnx` and one `*head*.onnx` of the variant.
            enhancer: anything with `enhance_batch`; sees whole frames.
            device: for the enhancer; the tracker itself runs on the CPU.
            scope: only "frame".
            variant: "v1" or "v2"; v3 does not run in OpenCV.

        Raises:
            InvalidOption: no such variant, or fresh weights, which ONNX files do not have.
            WeightsMissing: no folder, or one of the two files is not in it.
            WeightsMismatch: the files do not run, or are of another variant.
        """
        super().__init__(enhancer=enhancer, device=device, scope=scope)
        self.variant = _checked(variant)
        if weights is False:
            msg = f"{self.name} has no fresh weights; pass the folder of its two ONNX files"
            raise InvalidOption(msg)
        found = find_weights(self.name, weights, _wanted(self.card, variant))
        folder = found.path or Path()
        if not folder.is_dir():
            msg = f"weights of {self.name}: {folder}: pass the folder that holds both ONNX files"
            raise WeightsMissing(msg)
        self.files: OnnxPair = find_pair(folder, variant)
        self.weights = self._identified(found)
        self._try_out()

    def make(self) -> Any:
        """A new tracker; the networks are read anew, so no state is left over."""
        import cv2

        parameters: Any = cv2.TrackerNano.Params()
        parameters.backbone = str(self.files.backbone)
        parameters.neckhead = str(self.files.head)
        return cv2.TrackerNano.create(parameters)

    def confidence(self, tracker: Any) -> float:
        """OpenCV's score: the network's, penalised and windowed; 0 where it is no finite number."""
        score = float(tracker.getTrackingScore())
        return score if np.isfinite(score) else 0.0

    def _identified(self, found: Weights) -> Weights:
        """The weights with the digest of the two files only, and their published name."""
        known = {file.sha256: file for file in self.card.weights if file.sha256}
        names = []
        for path in (self.files.backbone, self.files.head):
            file = known.get(sha256_of(path))
            if file and file.note and not file.note.startswith(f"variant {self.variant}"):
                msg = f"{path}: is a file of NanoTrack {file.note}, not of variant {self.variant}"
                raise WeightsMismatch(msg)
            names.append(file.name if file else "")
        digest = sha256_of(self.files.backbone, self.files.head)
        known_as = " and ".join(names) if all(names) else ""
        return dataclasses.replace(
            found,
            sha256=digest,
            known_as=known_as,
            files=(self.files.backbone, self.files.head),
        )

    def _try_out(self) -> None:
        """One frame through both networks, so that a wrong file is told at creation."""
        image = np.zeros((64, 64, 3), dtype=np.uint8)
        box = np.array([24.0, 24.0, 16.0, 16.0])
        try:
            self.start(image, box)
            self.advance(image)
        except OpenCVFailure as error:
            hint = "the files of NanoTrack v3 (15x15 map) cannot run there"
            msg = f"{self.files}: no NanoTrack networks that OpenCV can run; {hint} ({error})"
            raise WeightsMismatch(msg) from None
        self._tracker = None


def _checked(variant: str) -> str:
    if variant in _VARIANTS:
        return variant
    why = " (OpenCV expects a 16x16 map, v3 gives 15x15)" if variant == "v3" else ""
    msg = f"opencv_nano has no variant {variant!r}{why}; it has {', '.join(_VARIANTS)}"
    raise InvalidOption(msg)


def _wanted(card: Card, variant: str) -> Card:
    """The card with both files of a variant as the one thing that a user has to get."""
    files = [file for file in card.weights if file.note.startswith(f"variant {variant}")]
    folder = WeightsFile(
        name=" and ".join(file.name for file in files) + ", both in one folder",
        where=files[0].where,
        licence=files[0].licence,
    )
    return msgspec.structs.replace(card, weights=(folder,))
