"""Learning rates over the steps, and optimisers that learn."""

import itertools

import pytest

from nat2024.training import TrainingSettings
from nat2024.training.curves import read_curve
from nat2024.training.optimising import learning_rate


def test_learning_rates(settings):
    base = settings()
    rates = [learning_rate(base, step, 24) for step in range(24)]
    assert rates[:3] == pytest.approx([1e-2 / 3, 2e-2 / 3, 1e-2])
    assert rates[3] == 1e-2
    assert all(a > b for a, b in itertools.pairwise(rates[3:]))
    falling = TrainingSettings(schedule="cosine", final_rate=0.02, learning_rate=1.0)
    assert learning_rate(falling, 100, 100) == pytest.approx(0.02)
    assert learning_rate(TrainingSettings(learning_rate=0.3), 999, 1000) == 0.3


@pytest.mark.parametrize("optimiser", ["adamw", "adam", "sgd"])
def test_optimisers_learn(tmp_path, optimiser, run):
    settings = TrainingSettings(steps=60, optimiser=optimiser, learning_rate=1e-2, log_every=20)
    run(tmp_path, settings)
    curve = read_curve(tmp_path / "curve.csv")
    assert float(curve[-1]["error"]) < float(curve[0]["error"])
