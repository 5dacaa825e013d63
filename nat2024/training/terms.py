"""A batch on its device, and the terms of a loss as numbers and as one sum."""

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from nat2024.errors import TrainingFailed
from nat2024.training.interfaces import Batch

if TYPE_CHECKING:
    import torch


def to_device(batch: Batch, device: str) -> Batch:
    """The batch with its tensors on a device."""
    import torch

    return {
        name: value.to(device, non_blocking=True) if isinstance(value, torch.Tensor) else value
        for name, value in batch.items()
    }


def sum_terms(terms: Any) -> "torch.Tensor":
    """The sum of the terms that a loss has returned.

    Raises:
        TrainingFailed: they are no tensors of one number by name, or no weight has a part in them.
    """
    if not isinstance(terms, Mapping):
        msg = f"the loss returned {_kind(terms)}; return its terms by name, a dict of tensors"
        raise TrainingFailed(msg)
    if not terms:
        msg = "the loss has no terms; return at least one, by its name"
        raise TrainingFailed(msg)
    for name, term in terms.items():
        if getattr(term, "numel", lambda: 0)() != 1:
            msg = f"loss term {name!r} is {_kind(term)}; a term is a tensor of one number"
            raise TrainingFailed(msg)
    first, *others = (term.reshape(()) for term in terms.values())
    total: torch.Tensor = sum(others, start=first)
    if not total.requires_grad:
        msg = f"the loss ({', '.join(map(str, terms))}) depends on no weight of the network; "
        msg += "make its terms from what the network gives, without detach or no_grad"
        raise TrainingFailed(msg)
    return total


def _kind(value: Any) -> str:
    shape = getattr(value, "shape", None)
    return f"a {type(value).__name__}" + ("" if shape is None else f" of shape {tuple(shape)}")


def numbers_of(terms: "Mapping[str, torch.Tensor]", total: "torch.Tensor") -> dict[str, float]:
    """The terms as numbers, and `loss`, their sum."""
    numbers = {name: float(term.detach()) for name, term in terms.items()}
    return {**numbers, "loss": float(total.detach())}


def find_bad(numbers: Mapping[str, float]) -> str:
    """Names the first number that is not finite; an empty text where all are."""
    bad = [name for name, value in numbers.items() if not math.isfinite(value)]
    return f"loss term {bad[0]!r} is {numbers[bad[0]]}" if bad else ""
