"""From a weights file into a network, for enhancers and trackers alike."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from nat2024.zoo import Weights, fit_state_dict, read_checkpoint

if TYPE_CHECKING:
    import torch

    from nat2024.zoo import StateDict


def load_weights(
    model: "torch.nn.Module",
    weights: Weights,
    read: "Callable[[Path], StateDict]" = read_checkpoint,
) -> None:
    """Load `weights` into `model` as `read` gives them; nothing for fresh weights.

    Raises:
        WeightsMismatch: the file is unsafe, unreadable or of another network.
    """
    if weights.path is None:
        return
    state = read(weights.path)
    fitting = fit_state_dict(state, model.state_dict(), str(weights.path))
    model.load_state_dict({**model.state_dict(), **fitting})
