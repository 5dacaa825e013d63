"""What a training is made of, and the report of one."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Protocol, TypeAlias

if TYPE_CHECKING:
    import torch
    from torch import nn

Batch: TypeAlias = "Mapping[str, Any]"
"""Tensors by name, and anything else that the loss wants to know."""

Loss: TypeAlias = "Callable[[Batch], Mapping[str, torch.Tensor]]"
"""Terms by name, each already weighted; their sum is what is minimised."""

Validation: TypeAlias = "Callable[[nn.Module], Mapping[str, float]]"
"""Numbers by name. Where it has `names`, a wrong name of `best` is told before the first step."""

Progress: TypeAlias = "Callable[[int, str], object]"


class Source(Protocol):
    """Where batches come from.

    A source whose batches depend on the number of the step alone needs nothing else. One that
    moves on with every batch has `state_dict()` and `load_state_dict(state)` too, of tensors and
    plain values; checkpoints then hold its state.
    """

    @property
    def steps_per_epoch(self) -> int:
        """Steps of one round through the data, at least 1."""
        ...

    def draw(self, step: int, /) -> Batch:
        """The batch of step `step` (0-based), tensors on the CPU."""
        ...


@dataclass(frozen=True, slots=True)
class TrainingReport:
    """What a training came to.

    Attributes:
        folder: where its checkpoints and curves are.
        steps: steps done, those before a resume included.
        wanted: steps of the whole training.
        stopped: "done", "minutes" (resume to go on) or "patience".
        resumed_from: step of the checkpoint that it went on from, 0 for a fresh start.
        best_step: step whose validation was best, None where none was chosen by.
        numbers: the last validation, or the best where one was chosen by.
        terms: loss terms, means since the last row of the curve, `loss` their sum.
        seconds: time of this run.
    """

    folder: Path
    steps: int
    wanted: int
    stopped: Literal["done", "minutes", "patience"]
    resumed_from: int = 0
    best_step: int | None = None
    numbers: dict[str, float] = field(default_factory=dict)
    terms: dict[str, float] = field(default_factory=dict)
    seconds: float = 0.0
