"""The loss of SiamRPN++ on batches of pairs, as named terms."""

from collections.abc import Mapping
from typing import TypeAlias

import torch
import torch.nn.functional as F
from torch import Tensor

from nat2024_trackers.siamese.correlation import depthwise_correlation
from nat2024_trackers.siamrpnpp.compact import CompactSiamRPN, template_statistics
from nat2024_trackers.siamrpnpp.model import DepthwiseRPN, DepthwiseXCorr, SiamRPN
from nat2024_trackers.siamrpnpp.training.targets import Assignment, assign

WEIGHTS = {"positive": 0.5, "negative": 0.5, "cross": 0.2, "box": 1.2}
"""What the terms are multiplied by before they are added."""

PairNetwork: TypeAlias = CompactSiamRPN | SiamRPN
"""What can be trained on pairs; of `SiamRPN` the variants with one level."""

_HARDEST = 0.05


def pair_terms(
    model: PairNetwork, batch: Mapping[str, Tensor], anchors: Tensor
) -> dict[str, Tensor]:
    """Terms of the loss, not yet weighted.

    `cross` compares the search crop of each pair with the template of the next one in the batch,
    which is not there: negative pairs at the price of a correlation.

    Args:
        model: in training mode.
        batch: template (n, 3, 127, 127) and search (n, 3, s, s) float32 0..255 BGR, and box
            (n, 4): centre offset, width, height; NaN where there is no target.
        anchors: float32 (4, k) of `anchor_boxes` for the map of s.

    Returns:
        positive, negative, cross and box, scalars.
    """
    template, search = _features(model, batch)
    head = model.rpn_head
    assert isinstance(head, DepthwiseRPN)
    matched, crossed = _class_maps(head.cls, template, search)
    offsets = head.loc(head.loc.embed(template), search)
    assigned = assign(batch["box"], anchors)
    absent, there = -F.log_softmax(matched, dim=1).transpose(0, 1)
    return {
        "positive": _mean(there, assigned.positive),
        "negative": _negative_term(absent, assigned.negative),
        "cross": _negative_term(*_all_negative(-F.log_softmax(crossed, dim=1)[:, 0])),
        "box": _box_term(offsets, assigned),
    }


def _features(model: PairNetwork, batch: Mapping[str, Tensor]) -> tuple[Tensor, Tensor]:
    """What the head sees of both crops of each pair."""
    if isinstance(model, CompactSiamRPN):
        statistics = template_statistics(batch["template"])
        template, search = (model.describe(batch[k], *statistics) for k in ("template", "search"))
        return template, search
    [template], [search] = (model.neck(model.backbone(batch[k])) for k in ("template", "search"))
    return template, search


def total(terms: dict[str, Tensor]) -> Tensor:
    """The weighted sum of the terms."""
    return torch.stack([WEIGHTS[name] * term for name, term in terms.items()]).sum()


def _class_maps(branch: DepthwiseXCorr, template: Tensor, search: Tensor) -> tuple[Tensor, Tensor]:
    """Logits (n, 2, k) of each search crop with its own template and with the next pair's."""
    kernel, features = branch.embed(template), branch.conv_search(search)
    both = [depthwise_correlation(features, one) for one in (kernel, kernel.roll(-1, dims=0))]
    # One pass through the head, so that its norms see one distribution.
    maps = branch.head(torch.cat(both))
    matched, crossed = maps.float().reshape(2, len(search), 2, -1)
    return matched, crossed


def _mean(values: Tensor, chosen: Tensor) -> Tensor:
    return (values * chosen).sum() / chosen.sum().clamp(min=1)


def _all_negative(values: Tensor) -> tuple[Tensor, Tensor]:
    return values, torch.ones_like(values, dtype=torch.bool)


def _negative_term(values: Tensor, chosen: Tensor) -> Tensor:
    """Half the mean of all that are chosen, half that of the hardest.

    The hardest are a share of all anchors, so that their number is known without asking the GPU.
    """
    losses = (values * chosen).flatten()
    hardest = losses.topk(max(1, int(len(losses) * _HARDEST))).values
    return (_mean(values, chosen) + hardest.mean()) / 2


def _box_term(maps: Tensor, assigned: Assignment) -> Tensor:
    errors = (maps.float().reshape(len(maps), 4, -1) - assigned.offsets).abs().sum(dim=1)
    return _mean(errors, assigned.positive)
