"""What a training run prints about itself: overlap, and whether size is measured or assumed."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import nn

from nat2024.types import Floats, Image
from nat2024_trackers.siamese.state import Constants
from nat2024_trackers.siamrpnpp.anchors import AnchorDecoder
from nat2024_trackers.siamrpnpp.training.pairs import Pair


@dataclass(frozen=True, slots=True)
class PairCheck:
    """How well single search crops are answered.

    Attributes:
        overlap: mean intersection over union of the best candidate and the truth.
        found: share of pairs with an overlap above 0.3.
        slope: of log predicted against log true size, both relative to the size that the crop
            assumes: 1 where size is measured, 0 where the assumed size is repeated.
        bias: geometric mean of predicted size over true size.
    """

    overlap: float
    found: float
    slope: float
    bias: float


def check_pairs(model: nn.Module, pairs: Sequence[Pair]) -> PairCheck:
    """Ask a network in eval mode about pairs, by the raw score without penalty and window.

    Pairs whose target is absent are left out.
    """
    pairs = [pair for pair in pairs if np.isfinite(pair.box).all()]
    truth = np.stack([pair.box for pair in pairs])
    found = np.concatenate([_best(model, pairs[at : at + 16]) for at in range(0, len(pairs), 16)])
    overlap = _overlaps(found, truth)
    assumed = np.log(64.0)
    predicted_size = np.log(found[:, 2] * found[:, 3]) / 2 - assumed
    true_size = np.log(truth[:, 2] * truth[:, 3]) / 2 - assumed
    at_target = overlap > 0.1
    if at_target.sum() < 3:
        return PairCheck(float(overlap.mean()), float((overlap > 0.3).mean()), 0.0, 1.0)
    slope = np.polyfit(true_size[at_target], predicted_size[at_target], 1)[0]
    bias = np.exp((predicted_size - true_size)[at_target].mean())
    return PairCheck(
        float(overlap.mean()), float((overlap > 0.3).mean()), float(slope), float(bias)
    )


def _best(model: nn.Module, pairs: Sequence[Pair]) -> Floats:
    search = np.stack([pair.search for pair in pairs])
    size = search.shape[1]
    decoder = AnchorDecoder(Constants(size, (size - 127) // 8 + 1, 8, 0.0, 0.0, 0.0, anchors=5))
    device = next(model.parameters()).device
    template = np.stack([pair.template for pair in pairs])
    with torch.no_grad():
        maps = model(_batch(template).to(device), _batch(search).to(device))
    candidates = decoder(tuple(one.float().cpu().numpy() for one in maps))
    best = candidates.scores.argmax(axis=1)
    return candidates.boxes[np.arange(len(pairs)), :, best].astype(np.float64)


def _batch(crops: Image) -> torch.Tensor:
    return torch.from_numpy(crops).permute(0, 3, 1, 2).float()


def _overlaps(first: Floats, second: Floats) -> Floats:
    """Intersection over union of centre boxes (n, 4)."""
    low = np.maximum(first[:, :2] - first[:, 2:] / 2, second[:, :2] - second[:, 2:] / 2)
    high = np.minimum(first[:, :2] + first[:, 2:] / 2, second[:, :2] + second[:, 2:] / 2)
    shared = np.clip(high - low, 0, None).prod(axis=1)
    result: Floats = shared / (first[:, 2:].prod(axis=1) + second[:, 2:].prod(axis=1) - shared)
    return result
