"""The best step: told at the start where it cannot be, and never mixed with another number's."""

import pytest
import torch
from torch import nn

from nat2024.errors import InvalidOption
from nat2024.training import TrainingSettings, train
from nat2024.training.choice import BestStep
from nat2024.training.curves import read_curve


class Points:
    steps_per_epoch = 2

    def draw(self, step):
        random = torch.Generator().manual_seed(step)
        return {"x": torch.randn(8, 2, generator=random)}


class Scores:
    """Numbers that a list gives, and their names beforehand."""

    names = ("score", "error")

    def __init__(self, scores=(), errors=()):
        self.left = iter(zip(scores, errors, strict=True))

    def __call__(self, _network):
        return dict(zip(self.names, next(self.left), strict=True))


def run(folder, validate, **settings):
    with torch.random.fork_rng():
        torch.manual_seed(0)
        network = nn.Linear(2, 1)
    drawn = []

    def loss(batch):
        drawn.append(1)
        return {"error": network(batch["x"]).square().mean()}

    chosen = TrainingSettings(learning_rate=0.1, **settings)
    report = None
    try:
        report = train(network, loss, Points(), chosen, folder, validate=validate)
    finally:
        run.steps = len(drawn)
    return report


@pytest.mark.parametrize(
    ("validate", "settings", "message"),
    [
        (
            Scores(),
            {"best": "scor"},
            "no number 'scor'; closest: score, error; it has error, score",
        ),
        (Scores(), {"best": "-eror"}, "best=-eror: .* no number 'eror'; closest: error"),
        (None, {"best": "score"}, "best=score: there is no validation to choose by"),
        (Scores(), {"patience": 3}, "patience=3 needs best"),
    ],
)
def test_what_cannot_be_chosen_by_is_told_before_the_first_step(
    tmp_path, validate, settings, message
):
    with pytest.raises(InvalidOption, match=message):
        run(tmp_path / "run", validate, steps=4, **settings)
    assert run.steps == 0
    assert not (tmp_path / "run").exists()


def test_another_number_begins_anew(tmp_path):
    """Gone on with by another number, the best of the old one is no rival."""
    first = run(tmp_path, Scores([9.0, 8.0], [0.5, 0.4]), steps=4, best="score")
    assert (first.best_step, first.numbers["score"]) == (2, 9.0)
    second = run(tmp_path, Scores([1.0, 1.0], [0.3, 0.6]), steps=8, best="-error")
    assert (second.resumed_from, second.best_step, second.numbers["error"]) == (4, 6, 0.3)
    last = run(tmp_path, Scores([2.0], [0.7]), steps=10)
    assert (last.best_step, last.numbers) == (None, {"score": 2.0, "error": 0.7})
    assert len(read_curve(tmp_path / "validation.csv")) == 5


def test_nothing_better_wears_patience_out_and_nan_is_not_better():
    best = BestStep(TrainingSettings(best="score", patience=2), Scores())
    assert not best.has_lost_patience
    assert best.take(1, {"score": 1.0})
    assert not best.take(2, {"score": float("nan")})
    again = BestStep(TrainingSettings(best="score", patience=2), Scores())
    again.load_state_dict(best.state_dict())
    assert not again.take(3, {"score": 1.0})
    assert (again.step, again.has_lost_patience) == (1, True)
