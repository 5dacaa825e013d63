"""A small problem to train, the settings of most tests, and disks that are not waited for."""

import os

import pytest
import torch
from torch import nn

from nat2024.training import TrainingSettings, set_values, train

SETTINGS = TrainingSettings(
    steps=24,
    learning_rate=1e-2,
    schedule="cosine",
    warm_up=3,
    clip=1.0,
    average=0.9,
    checkpoint_every=6,
    log_every=4,
)


@pytest.fixture(autouse=True)
def no_waiting_for_the_disk(monkeypatch):
    monkeypatch.setattr(os, "fsync", lambda _file: None)


class Numbers:
    """Batches that depend on the step, and a random state that moves on with every batch."""

    steps_per_epoch = 8

    def __init__(self) -> None:
        self.random = torch.Generator().manual_seed(7)

    def draw(self, step: int) -> dict[str, torch.Tensor]:
        assert step >= 0
        return {"x": torch.randn(16, 3, generator=self.random)}

    def state_dict(self) -> dict[str, torch.Tensor]:
        return {"random": self.random.get_state()}

    def load_state_dict(self, state: dict[str, torch.Tensor]) -> None:
        self.random.set_state(state["random"])


class Problem:
    """A small network with BatchNorm and dropout, and its loss."""

    def __init__(self) -> None:
        with torch.random.fork_rng():
            torch.manual_seed(1)
            self.network = nn.Sequential(
                nn.Linear(3, 8), nn.BatchNorm1d(8), nn.ReLU(), nn.Dropout(0.2), nn.Linear(8, 1)
            )
        self.source = Numbers()
        self.breaks_at = -1
        self.steps = 0

    def loss(self, batch: dict[str, torch.Tensor]) -> dict[str, torch.Tensor]:
        self.steps += 1
        x = batch["x"]
        error = (self.network(x) - x.sum(1, keepdim=True)).square().mean()
        bad = float("nan") if self.steps == self.breaks_at else 0.0
        return {"error": error, "size": 1e-3 * self.network[0].weight.square().sum() + bad}

    def validate(self, network: nn.Module) -> dict[str, float]:
        assert not network.training
        torch.rand(5)  # a validation's random numbers must not matter
        points = torch.linspace(-1, 1, 30).view(10, 3)
        with torch.no_grad():
            error = (network(points) - points.sum(1, keepdim=True)).square().mean()
        return {"error": float(error)}


@pytest.fixture
def settings():
    """The settings of most tests, with what a test changes."""
    return lambda **changes: set_values([SETTINGS], changes)[0]


@pytest.fixture
def make_problem():
    return Problem


@pytest.fixture
def run():
    """Trains a fresh problem in a folder; gives it and the report."""

    def run(folder, settings=SETTINGS, **changes):
        problem = Problem()
        for name, value in changes.pop("problem", {}).items():
            setattr(problem, name, value)
        report = train(
            problem.network,
            problem.loss,
            problem.source,
            settings,
            folder,
            validate=problem.validate,
            **changes,
        )
        return problem, report

    return run


@pytest.fixture
def assert_same():
    """Two networks have the same weights, bit for bit."""

    def assert_same(first, second):
        for key, value in first.state_dict().items():
            assert torch.equal(value, second.state_dict()[key]), key

    return assert_same
