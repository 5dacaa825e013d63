"""Optimisers, the learning rate of every step, and means of weights."""

import contextlib
import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from nat2024.training.settings import TrainingSettings

if TYPE_CHECKING:
    import torch
    from torch import nn

_WARM = 10


def make_optimiser(network: "nn.Module", settings: TrainingSettings) -> "torch.optim.Optimizer":
    """The optimiser of all parameters that want a gradient."""
    import torch

    parameters = [one for one in network.parameters() if one.requires_grad]
    rate, decay = settings.learning_rate, settings.weight_decay
    if settings.optimiser == "sgd":
        return torch.optim.SGD(parameters, rate, settings.momentum, weight_decay=decay)
    kind = torch.optim.AdamW if settings.optimiser == "adamw" else torch.optim.Adam
    return kind(parameters, rate, settings.betas, settings.epsilon, weight_decay=decay)


def learning_rate(settings: TrainingSettings, step: int, steps: int) -> float:
    """The learning rate of step `step`, 0-based, of `steps`."""
    rate = settings.learning_rate
    if step < settings.warm_up:
        return rate * (step + 1) / settings.warm_up
    if settings.schedule == "constant":
        return rate
    done = (step - settings.warm_up) / max(steps - settings.warm_up, 1)
    falling = 0.5 * (1 + math.cos(math.pi * min(done, 1.0)))
    return rate * (settings.final_rate + (1 - settings.final_rate) * falling)


class Average:
    """Exponential mean of all numbers of a network, statistics of BatchNorm included."""

    def __init__(self, network: "nn.Module", decay: float) -> None:
        self.decay = decay
        self.steps = 0
        self.mean = {key: value.detach().clone() for key, value in network.state_dict().items()}

    def update(self, network: "nn.Module") -> None:
        """Take the weights of one more step in; whole numbers are taken as they are."""
        import torch

        self.steps += 1
        decay = min(self.decay, self.steps / (self.steps + _WARM))
        with torch.no_grad():
            for key, value in network.state_dict().items():
                if value.is_floating_point():
                    self.mean[key].lerp_(value, 1 - decay)
                else:
                    self.mean[key].copy_(value)

    def state_dict(self) -> dict[str, Any]:
        """What a checkpoint keeps of it."""
        return {"steps": self.steps, "mean": self.mean}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Go on from a checkpoint."""
        self.steps = state["steps"]
        for key, value in state["mean"].items():
            self.mean[key].copy_(value)


@contextlib.contextmanager
def averaged(network: "nn.Module", average: Average | None) -> Iterator[None]:
    """Give `network` the mean weights for a while, and evaluation mode; then all as it was."""
    own = {key: value.detach().clone() for key, value in network.state_dict().items()}
    modes = [(module, module.training) for module in network.modules()]
    if average is not None:
        network.load_state_dict(average.mean)
    network.eval()
    try:
        yield
    finally:
        network.load_state_dict(own)
        for module, mode in modes:
            module.training = mode
