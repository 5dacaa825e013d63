"""NanoTrack over its published ONNX files, run by OpenCV's `cv2.dnn` on the CPU."""

from typing import Any

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor, nn

from nat2024.errors import WeightsMismatch
from nat2024_trackers.opencv.base import OpenCVFailure, explained, quiet
from nat2024_trackers.opencv.onnx_files import OnnxPair
from nat2024_trackers.siamese.state import Constants

_INPUTS = ("input1", "input2")
_OUTPUTS = ("output1", "output2")
_NAME = "nanotrack"


class OnnxNetwork(nn.Module):
    """A `SiameseNetwork` without PyTorch weights; sequences of a batch run one after the other.

    The files have a fixed batch of one. Template features are kept as the backbone gives them: the
    template side of the head is inside the head's file.
    """

    def __init__(self, files: OnnxPair, constants: Constants) -> None:
        """Read both networks and run them once, so that a wrong file is told at creation.

        Raises:
            WeightsMismatch: the files do not run, or give maps of another size.
        """
        super().__init__()
        import cv2

        try:
            with explained(_NAME), quiet():
                self._backbone: Any = cv2.dnn.readNetFromONNX(str(files.backbone))
                self._head: Any = cv2.dnn.readNetFromONNX(str(files.head))
                found = self._try_out(constants)
        except OpenCVFailure as error:
            msg = f"{files}: no NanoTrack networks that OpenCV can run ({error})"
            raise WeightsMismatch(msg) from None
        wanted = (2, constants.map_size, constants.map_size)
        if found != wanted:
            msg = f"{files}: give maps of shape {found}, not {wanted}; pass their own variant"
            raise WeightsMismatch(msg)

    def embed(self, template: Tensor) -> tuple[Tensor]:
        """Features (n, c, 8, 8) of template crops (n, 3, 127, 127)."""
        return (torch.from_numpy(np.concatenate([self._features(one) for one in _each(template)])),)

    def match(self, features: tuple[Tensor], search: Tensor) -> tuple[Tensor, Tensor]:
        """(cls, loc): (n, 2, map, map) and (n, 4, map, map) of search crops (n, 3, 255, 255)."""
        maps = []
        with explained(_NAME):
            for template, crop in zip(_each(features[0]), _each(search), strict=True):
                self._head.setInput(template, _INPUTS[0])
                self._head.setInput(self._features(crop), _INPUTS[1])
                # The answer may lie in the network's own memory, which the next crop overwrites.
                maps.append([output.copy() for output in self._head.forward(_OUTPUTS)])
        classes, distances = (np.concatenate(part) for part in zip(*maps, strict=True))
        return torch.from_numpy(classes), torch.from_numpy(distances)

    def _features(self, crop: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        with explained(_NAME):
            self._backbone.setInput(crop)
            features: npt.NDArray[np.float32] = self._backbone.forward().copy()
        return features

    def _try_out(self, constants: Constants) -> tuple[int, ...]:
        """The shape of the map of one crop."""
        sides = (constants.exemplar_size, constants.instance_size)
        template, search = (torch.zeros(1, 3, side, side) for side in sides)
        return tuple(self.match(self.embed(template), search)[0].shape[1:])


def _each(batch: Tensor) -> list[npt.NDArray[np.float32]]:
    """The members of a batch, each (1, ...) and contiguous."""
    array = np.ascontiguousarray(batch.detach().cpu().numpy())
    return [array[index : index + 1] for index in range(len(array))]
