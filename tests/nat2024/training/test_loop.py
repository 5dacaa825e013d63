"""The loop: it learns, the seed decides, and it stops clearly where it must."""

import pytest
import torch

from nat2024.errors import InvalidOption, TrainingFailed
from nat2024.training import TrainingSettings, train
from nat2024.training.checkpoints import list_checkpoints, read_checkpoint
from nat2024.training.curves import read_curve


def test_it_learns_and_writes_curves_and_checkpoints(tmp_path, run, settings):
    chosen = settings(steps=120, learning_rate="3e-2", checkpoint_every=30)
    problem, report = run(tmp_path, chosen)
    curve = read_curve(tmp_path / "curve.csv")
    assert [int(row["step"]) for row in curve] == list(range(4, 121, 4))
    assert float(curve[-1]["error"]) < 0.5 * float(curve[0]["error"])
    row = curve[-1]
    total = float(row["error"]) + float(row["size"])
    assert float(row["loss"]) == pytest.approx(total, rel=1e-5)
    assert report.stopped == "done"
    assert report.steps == report.wanted == 120
    assert report.numbers == pytest.approx(problem.validate(problem.network))
    assert len(list_checkpoints(tmp_path / "checkpoints")) == 4
    assert len(read_curve(tmp_path / "validation.csv")) == 4


def test_seeds_decide_and_random_numbers_of_others_do_not(tmp_path, run, settings, assert_same):
    torch.manual_seed(5)
    first, _ = run(tmp_path / "a")
    after = torch.rand(1)
    torch.manual_seed(5)
    assert torch.equal(after, torch.rand(1))
    second, _ = run(tmp_path / "b")
    assert_same(first.network, second.network)
    other, _ = run(tmp_path / "c", settings(seed=1))
    assert not torch.equal(first.network[0].weight, other.network[0].weight)


def test_epochs_follow_the_source(tmp_path, run):
    _, report = run(tmp_path, TrainingSettings(epochs=2, learning_rate=1e-3))
    assert report.wanted == 16
    assert len(list_checkpoints(tmp_path / "checkpoints")) == 2


def test_minutes_leave_a_checkpoint_to_go_on_from(tmp_path, run, settings, assert_same):
    endless = {"checkpoint_every": 10**6, "schedule": "constant"}
    _, report = run(tmp_path / "a", settings(steps=10**6, **endless), minutes=0.0005)
    assert report.stopped == "minutes"
    (path,) = list_checkpoints(tmp_path / "a" / "checkpoints")
    assert read_checkpoint(path)["step"] == report.steps > 0
    more = settings(steps=report.steps + 3, **endless)
    resumed, again = run(tmp_path / "a", more)
    assert again.resumed_from == report.steps
    assert_same(resumed.network, run(tmp_path / "b", more)[0].network)


def test_a_term_that_is_not_a_number_stops_it_by_name(tmp_path, run):
    with pytest.raises(TrainingFailed, match=r"step 14: loss term 'size' is nan; .*step-00000012"):
        run(tmp_path, problem={"breaks_at": 14})
    state = read_checkpoint(list_checkpoints(tmp_path / "checkpoints")[-1])["network"]
    assert all(bool(value.isfinite().all()) for value in state.values())
    _, report = run(tmp_path)
    assert report.resumed_from == 12
    with pytest.raises(TrainingFailed, match="there is no checkpoint yet"):
        run(tmp_path / "other", problem={"breaks_at": 1})


def test_the_best_step_is_chosen_by_the_validation(tmp_path, settings, make_problem):
    problem = make_problem()
    left = iter([1.0, 5.0, 2.0, 3.0])
    seen = []

    def validate(network):
        seen.append({key: value.clone() for key, value in network.state_dict().items()})
        return {"score": next(left)}

    chosen = settings(best="score")
    report = train(
        problem.network, problem.loss, problem.source, chosen, tmp_path, validate=validate
    )
    assert report.best_step == 12
    assert report.numbers == {"score": 5.0}
    for key, value in problem.network.state_dict().items():
        assert torch.equal(value, seen[1][key])


def test_patience_stops_it_and_unknown_numbers_are_named(tmp_path, run, settings):
    chosen = settings(best="-error", patience=1, learning_rate=0)
    _, report = run(tmp_path / "a", chosen)
    assert (report.stopped, report.best_step) == ("patience", 6)
    wrong = settings(best="eror")
    with pytest.raises(InvalidOption, match="no number 'eror'; closest: error; it has error"):
        run(tmp_path / "b", wrong)
