"""Attention that never holds the matrix of queries by keys."""

import math

import torch
import torch.nn.functional as F
from torch import Tensor

from nat2024.networks.plain_form import is_plain

_STEP = 0.2
_POINTS = 8


def fused_attention(
    query: Tensor, key: Tensor, value: Tensor, *, dropout: float = 0.0, head_multiple: int = 1
) -> Tensor:
    """Attention of (N, heads, L, d) by a kernel that never holds the L x L matrix.

    The head dimension d is filled up with zeros, which change nothing, to a multiple of
    `head_multiple`. (PyTorch on a CPU does hold the matrix where there is dropout.)
    """
    size = query.shape[-1]
    extra = -size % head_multiple
    if extra:
        query, key, value = (F.pad(tokens, (0, extra)) for tokens in (query, key, value))
    scale = size**-0.5
    attended = F.scaled_dot_product_attention(query, key, value, dropout_p=dropout, scale=scale)
    return attended[..., :size]


def scalar_attention(query: Tensor, key: Tensor, value: Tensor) -> Tensor:
    """Attention of float32 (N, heads, L, 1), for many tokens in far less than L x L steps.

    With one number a head, what a query q gets is a smooth function of q alone: the mean of the
    values weighted by exp(q k). It is computed at evenly spaced q and interpolated between them by
    polynomials through 8 neighbours. Where keys span K, the function is analytic up to pi / K off
    the real axis, so that at a spacing of 0.2 / K the error is at most 2e-7 of the values' size, as
    large as float32's rounding. Where that takes more than a quarter of the queries (or they are
    not finite) this is `fused_attention`.
    """
    # Traced, or only a shape, its range is unknown.
    if type(query) is not Tensor or is_plain():
        return fused_attention(query, key, value)
    low, high = query.aminmax(dim=2, keepdim=True)
    least, most = key.aminmax(dim=2, keepdim=True)
    widest = ((high - low) * (most - least)).max().item() / _STEP
    if not widest + _POINTS < query.shape[2] / 4:  # NaN lands here too
        return fused_attention(query, key, value)
    cells = max(math.ceil(widest), 1)
    before = _POINTS // 2 - 1
    start, span = low.double(), (high - low).double()
    step = torch.where(span > 0, span / cells, 1.0)
    numbers = torch.arange(-before, cells + before + 1, device=query.device, dtype=torch.float64)
    nodes = (start + step * numbers.view(-1, 1)).to(query.dtype)
    attended = fused_attention(nodes, key, value).double().squeeze(-1)
    # One polynomial for each cell between nodes, in powers of the place within the cell.
    powers = torch.linalg.inv(torch.vander(numbers[:_POINTS], increasing=True))
    polynomials = attended.unfold(2, _POINTS, 1) @ powers.T
    place = (query.double() - start) / step
    cell = place.floor().clamp(0, cells - 1)
    place = place - cell
    chosen = polynomials.gather(2, cell.long().expand(-1, -1, -1, _POINTS))
    answer: Tensor = chosen[..., -1:]
    for power in range(_POINTS - 2, -1, -1):
        answer = answer * place + chosen[..., power : power + 1]
    return answer.to(query.dtype)
