"""The parts of a training of `siamrpnpp`: batches, loss and checks for the loop."""

from collections import deque
from collections.abc import Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any

import cv2
import numpy as np
import torch
from torch import Tensor

from nat2024.errors import UsageError
from nat2024.types import Image
from nat2024_trackers.siamese.state import Constants
from nat2024_trackers.siamrpnpp.anchors import anchor_boxes
from nat2024_trackers.siamrpnpp.model import DepthwiseRPN
from nat2024_trackers.siamrpnpp.training.checks import check_pairs
from nat2024_trackers.siamrpnpp.training.clips import BoxedClip
from nat2024_trackers.siamrpnpp.training.loss import WEIGHTS, PairNetwork, pair_terms
from nat2024_trackers.siamrpnpp.training.movement import Ranges
from nat2024_trackers.siamrpnpp.training.pairs import Mix, PairSource
from nat2024_trackers.siamrpnpp.training.settings import PairSettings

_AHEAD = 16
_CHECK_SEED = 99
_CHECKS = ("overlap", "found", "slope", "bias")


def make_pair_source(
    settings: PairSettings, photographs: Sequence[Image], clips: Sequence[BoxedClip], seed: int
) -> PairSource:
    """Pairs of some material under these settings."""
    ranges = Ranges(settings.search, settings.shift, settings.scale, settings.aspect, settings.turn)
    mix = Mix(settings.procedural, settings.composite, settings.still, settings.clips)
    return PairSource(photographs, clips, seed, mix, ranges)


def check_trainable(network: torch.nn.Module, variant: str) -> None:
    """Raise `UsageError` where the loss does not know a network's heads."""
    if not isinstance(getattr(network, "rpn_head", None), DepthwiseRPN):
        msg = (
            f"siamrpnpp variant {variant} cannot be trained: its head has several levels; "
            "compact, alex and alex_otb can"
        )
        raise UsageError(msg)


class PairBatches:
    """Batches of pairs for the loop; the number of a step is all the state there is.

    Attributes:
        pairs: where they come from.
        batch_size: pairs a step.
        steps_per_epoch: steps between checkpoints, since the pairs have no end.
    """

    def __init__(
        self, pairs: PairSource, batch_size: int, *, steps_per_epoch: int = 250, apart: bool = False
    ) -> None:
        """Prepare.

        Args:
            pairs: the source.
            batch_size: pairs a step.
            steps_per_epoch: see above.
            apart: whether another process makes the pairs, ahead of the training; they are the
                same. Its photographs and frames are sent there once.
        """
        self.pairs, self.batch_size, self.steps_per_epoch = pairs, batch_size, steps_per_epoch
        self._waiting: deque[tuple[int, Future[dict[str, Any]]]] = deque()
        self._pool: ProcessPoolExecutor | None = None
        if apart:
            context = get_context("spawn")
            self._pool = ProcessPoolExecutor(1, context, initializer=_keep, initargs=(pairs,))

    def draw(self, step: int) -> dict[str, Tensor]:
        """The batch of a step: template, search float32 (n, 3, s, s) 0..255 BGR, box (n, 4)."""
        if self._pool is None:
            return as_tensors(self.pairs.batch(step, self.batch_size))
        if self._waiting and self._waiting[0][0] != step:
            self._waiting.clear()
        following = self._waiting[-1][0] + 1 if self._waiting else step
        for number in range(following, step + _AHEAD):
            self._waiting.append((number, self._pool.submit(_made, number, self.batch_size)))
        _, batch = self._waiting.popleft()
        return as_tensors(batch.result())

    def close(self) -> None:
        """End the other process, if there is one."""
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)


_kept: list[PairSource] = []


def _keep(pairs: PairSource) -> None:
    cv2.setNumThreads(1)
    _kept[:] = [pairs]


def _made(number: int, size: int) -> dict[str, Any]:
    return _kept[0].batch(number, size)


def as_tensors(arrays: Mapping[str, Any]) -> dict[str, Tensor]:
    """A batch of pairs as the loss takes it; crops are channels-last in memory."""
    batch = {name: torch.from_numpy(values) for name, values in arrays.items()}
    for name in ("template", "search"):
        batch[name] = batch[name].permute(0, 3, 1, 2).float()
    return batch


class PairLoss:
    """Weighted terms of the loss of a network on batches of `PairBatches`."""

    def __init__(self, network: PairNetwork, settings: PairSettings | None = None) -> None:
        """Lay out the anchors."""
        self.network = network
        self.settings = settings or PairSettings()
        cells = (self.settings.search - 127) // 8 + 1
        constants = Constants(self.settings.search, cells, 8, 0.0, 0.0, 0.0)
        self.anchors = torch.from_numpy(anchor_boxes(constants))

    def __call__(self, batch: Mapping[str, Tensor]) -> dict[str, Tensor]:
        """positive, negative, cross and box; see `loss`."""
        device = batch["box"].device
        self.anchors = self.anchors.to(device)
        is_half = self.settings.precision == "bfloat16"
        with torch.autocast(device.type, torch.bfloat16, enabled=is_half):
            terms = pair_terms(self.network, batch, self.anchors)
        return {name: WEIGHTS[name] * term for name, term in terms.items()}


class PairValidation:
    """Overlap and size slope of a network on fixed pairs, by generator.

    The pairs are new ones: of the same material, but of another seed than the training's.
    """

    def __init__(self, pairs: PairSource, *, count: int = 48) -> None:
        """Make the pairs; `count` of each generator that has material."""
        kinds = [kind for kind, share in pairs.shares().items() if share and kind != "still"]
        self.pairs = {
            kind: [
                pairs.make(kind, np.random.default_rng([_CHECK_SEED, pairs.seed, number]))
                for number in range(count)
            ]
            for kind in kinds
        }

    @property
    def names(self) -> list[str]:
        """Names of the numbers that a call gives."""
        return [f"{kind}_{name}" for kind in self.pairs for name in _CHECKS]

    def __call__(self, network: torch.nn.Module) -> dict[str, float]:
        """`KIND_overlap`, `KIND_found`, `KIND_slope` and `KIND_bias`, see `PairCheck`."""
        numbers = {}
        for kind, pairs in self.pairs.items():
            check = check_pairs(network, pairs)
            for name in _CHECKS:
                numbers[f"{kind}_{name}"] = float(getattr(check, name))
        return numbers
