"""Filling images up to sizes that a network can take."""

from collections.abc import Sequence
from typing import Literal

import torch.nn.functional as F
from torch import Tensor


def pad_to_multiple(
    batch: Tensor, multiple: int, *, where: Literal["end", "centre"] = "end"
) -> tuple[Tensor, int, int]:
    """Pad both sides up to a multiple by reflection, a side too short for it by replication.

    Args:
        batch: (N, C, H, W).
        multiple: what both sides shall be multiples of.
        where: "end" pads bottom and right, "centre" splits the padding (the smaller half first).

    Returns:
        The padded batch, and the row and column where the given one begins in it.
    """
    height, width = batch.shape[-2:]
    extra_rows, extra_columns = -height % multiple, -width % multiple
    top, left = (extra_rows // 2, extra_columns // 2) if where == "centre" else (0, 0)
    batch = _pad(batch, (left, extra_columns - left, 0, 0), width)
    return _pad(batch, (0, 0, top, extra_rows - top), height), top, left


def _pad(batch: Tensor, amounts: Sequence[int], size: int) -> Tensor:
    if not any(amounts):
        return batch
    mode = "reflect" if max(amounts) < size else "replicate"
    return F.pad(batch, list(amounts), mode=mode)
