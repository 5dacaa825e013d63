"""The loop: it learns, goes on bit for bit after a kill, and stops clearly where it must."""

import itertools
import json
import math
import os
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest
import torch
from torch import nn

from nat2024.errors import (
    InvalidOption,
    ResultConflict,
    TrainingFailed,
    Unwritable,
    WeightsMismatch,
)
from nat2024.files import write_atomic
from nat2024.training import TrainingSettings, set_values, train, write_weights
from nat2024.training.checkpoints import list_checkpoints, read_checkpoint
from nat2024.training.curves import CurveFile, open_tensorboard, read_curve
from nat2024.training.optimising import learning_rate
from nat2024.zoo import read_checkpoint as read_weights

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


def run(folder: Path, settings: TrainingSettings = SETTINGS, **changes):
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


def assert_same(first: nn.Module, second: nn.Module) -> None:
    for key, value in first.state_dict().items():
        assert torch.equal(value, second.state_dict()[key]), key


def test_it_learns_and_writes_curves_and_checkpoints(tmp_path):
    settings = set_values(
        [SETTINGS], {"steps": 120, "learning_rate": "3e-2", "checkpoint_every": 30}
    )[0]
    problem, report = run(tmp_path, settings)
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


def test_seeds_decide_and_random_numbers_of_others_do_not(tmp_path):
    torch.manual_seed(5)
    first, _ = run(tmp_path / "a")
    after = torch.rand(1)
    torch.manual_seed(5)
    assert torch.equal(after, torch.rand(1))
    second, _ = run(tmp_path / "b")
    assert_same(first.network, second.network)
    other, _ = run(tmp_path / "c", set_values([SETTINGS], {"seed": 1})[0])
    assert not torch.equal(first.network[0].weight, other.network[0].weight)


KILLED = """
import os, signal, sys
from pathlib import Path
sys.path.insert(0, {tests!r})
from test_loop import SETTINGS, Problem
from nat2024.training import train

problem = Problem()
def die(done, what, steps=iter(range(100))):
    if next(steps) == 15:
        os.kill(os.getpid(), signal.SIGKILL)
train(problem.network, problem.loss, problem.source, SETTINGS, Path({folder!r}),
      validate=problem.validate, on_progress=die)
"""


def test_killed_it_goes_on_to_the_same_bits(tmp_path):
    folder = tmp_path / "killed"
    code = textwrap.dedent(KILLED).format(tests=str(Path(__file__).parent), folder=str(folder))
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, check=False)
    assert done.returncode == -signal.SIGKILL, done.stderr
    assert [path.name for path in list_checkpoints(folder / "checkpoints")] == [
        "step-00000006.pt",
        "step-00000012.pt",
    ]
    resumed, report = run(folder)
    whole, _ = run(tmp_path / "whole")
    assert report.resumed_from == 12
    assert_same(resumed.network, whole.network)
    assert (folder / "curve.csv").read_text() == (tmp_path / "whole" / "curve.csv").read_text()


def test_minutes_leave_a_checkpoint_to_go_on_from(tmp_path):
    values = {"checkpoint_every": 10**6, "steps": 10**6, "schedule": "constant"}
    settings = set_values([SETTINGS], values)[0]
    _, report = run(tmp_path / "a", settings, minutes=0.0005)
    assert report.stopped == "minutes"
    (path,) = list_checkpoints(tmp_path / "a" / "checkpoints")
    assert read_checkpoint(path)["step"] == report.steps > 0
    more = set_values([settings], {"steps": report.steps + 3})[0]
    resumed, again = run(tmp_path / "a", more)
    assert again.resumed_from == report.steps
    assert_same(resumed.network, run(tmp_path / "b", more)[0].network)


def test_a_term_that_is_not_a_number_stops_it_by_name(tmp_path):
    with pytest.raises(TrainingFailed, match=r"step 14: loss term 'size' is nan; .*step-00000012"):
        run(tmp_path, problem={"breaks_at": 14})
    state = read_checkpoint(list_checkpoints(tmp_path / "checkpoints")[-1])["network"]
    assert all(bool(value.isfinite().all()) for value in state.values())
    _, report = run(tmp_path)
    assert report.resumed_from == 12
    with pytest.raises(TrainingFailed, match="there is no checkpoint yet"):
        run(tmp_path / "other", problem={"breaks_at": 1})


def test_a_checkpoint_of_another_configuration_is_refused(tmp_path):
    run(tmp_path)
    other = set_values([SETTINGS], {"learning_rate": 0.5, "clip": 2})[0]
    with pytest.raises(ResultConflict, match=r"settings.clip 1.0 there, 2.0 now, settings.learn"):
        run(tmp_path, other)
    with pytest.raises(ResultConflict, match="data None there, x now"):
        run(tmp_path, identity={"data": "x"})
    longer = set_values([SETTINGS], {"validate_every": 5, "log_every": 8, "keep": 2})[0]
    assert run(tmp_path, longer)[1].steps == 24


def test_a_longer_constant_schedule_goes_on(tmp_path):
    constant = set_values([SETTINGS], {"schedule": "constant"})[0]
    run(tmp_path / "a", constant)
    more = set_values([constant], {"steps": 30})[0]
    resumed, report = run(tmp_path / "a", more)
    assert report.resumed_from == 24
    assert_same(resumed.network, run(tmp_path / "b", more)[0].network)


def test_a_damaged_checkpoint_says_so(tmp_path):
    run(tmp_path)
    last = list_checkpoints(tmp_path / "checkpoints")[-1]
    last.write_bytes(last.read_bytes()[:100])
    with pytest.raises(WeightsMismatch, match=r"step-00000024\.pt: not a readable checkpoint"):
        run(tmp_path)
    last.unlink()
    assert run(tmp_path)[1].resumed_from == 18


def test_no_disk_space_loses_nothing(tmp_path, monkeypatch):
    written = []

    def full(path, data):
        if "step-00000012" in str(path):
            msg = f"{path}: cannot be written (No space left on device)"
            raise Unwritable(msg)
        written.append(path)
        write_atomic(path, data)

    monkeypatch.setattr("nat2024.training.checkpoints.write_atomic", full)
    with pytest.raises(Unwritable, match="No space left"):
        run(tmp_path)
    monkeypatch.undo()
    resumed, report = run(tmp_path)
    assert report.resumed_from == 6
    assert_same(resumed.network, run(tmp_path / "whole")[0].network)


@pytest.mark.skipif(os.name == "nt", reason="limits of file sizes are POSIX's")
def test_a_file_system_that_refuses_loses_nothing(tmp_path):
    """Files may not pass 8 kB for a while, which the network's checkpoints do."""
    import resource

    _, before = run(tmp_path, set_values([SETTINGS], {"schedule": "constant", "steps": 6})[0])
    assert before.steps == 6
    constant = set_values([SETTINGS], {"schedule": "constant"})[0]
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (8192, limits[1]))
    try:
        with pytest.raises(Unwritable, match=r"step-00000012\.pt: cannot be written \(File too l"):
            run(tmp_path, constant)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    names = [path.name for path in (tmp_path / "checkpoints").iterdir()]
    assert names == ["step-00000006.pt"]
    resumed, report = run(tmp_path, constant)
    assert report.resumed_from == 6
    assert_same(resumed.network, run(tmp_path / "whole", constant)[0].network)


def test_the_best_step_is_chosen_by_the_validation(tmp_path):
    problem = Problem()
    left = iter([1.0, 5.0, 2.0, 3.0])
    seen = []

    def validate(network):
        seen.append({key: value.clone() for key, value in network.state_dict().items()})
        return {"score": next(left)}

    settings = set_values([SETTINGS], {"best": "score"})[0]
    report = train(
        problem.network, problem.loss, problem.source, settings, tmp_path, validate=validate
    )
    assert report.best_step == 12
    assert report.numbers == {"score": 5.0}
    for key, value in problem.network.state_dict().items():
        assert torch.equal(value, seen[1][key])


def test_patience_stops_it_and_unknown_numbers_are_named(tmp_path):
    settings = set_values([SETTINGS], {"best": "-error", "patience": 1, "learning_rate": 0})[0]
    _, report = run(tmp_path / "a", settings)
    assert (report.stopped, report.best_step) == ("patience", 6)
    wrong = set_values([SETTINGS], {"best": "eror"})[0]
    with pytest.raises(InvalidOption, match="no number 'eror'; closest: error; it has error"):
        run(tmp_path / "b", wrong)


def test_old_checkpoints_are_forgotten(tmp_path):
    run(tmp_path, set_values([SETTINGS], {"keep": 2})[0])
    names = [path.name for path in list_checkpoints(tmp_path / "checkpoints")]
    assert names == ["step-00000018.pt", "step-00000024.pt"]


def test_epochs_follow_the_source(tmp_path):
    settings = TrainingSettings(epochs=2, learning_rate=1e-3)
    _, report = run(tmp_path, settings)
    assert report.wanted == 16
    assert len(list_checkpoints(tmp_path / "checkpoints")) == 2


def test_learning_rates():
    rates = [learning_rate(SETTINGS, step, 24) for step in range(24)]
    assert rates[:3] == pytest.approx([1e-2 / 3, 2e-2 / 3, 1e-2])
    assert rates[3] == 1e-2
    assert all(a > b for a, b in itertools.pairwise(rates[3:]))
    falling = TrainingSettings(schedule="cosine", final_rate=0.02, learning_rate=1.0)
    assert learning_rate(falling, 100, 100) == pytest.approx(0.02)
    assert learning_rate(TrainingSettings(learning_rate=0.3), 999, 1000) == 0.3


@pytest.mark.parametrize("optimiser", ["adamw", "adam", "sgd"])
def test_optimisers_learn(tmp_path, optimiser):
    settings = TrainingSettings(steps=60, optimiser=optimiser, learning_rate=1e-2, log_every=20)
    run(tmp_path, settings)
    curve = read_curve(tmp_path / "curve.csv")
    assert float(curve[-1]["error"]) < float(curve[0]["error"])


def test_settings_are_read_from_texts():
    changed = set_values([SETTINGS], {"betas": "0.8,0.9", "steps": "7", "mixed_precision": "true"})
    assert (changed[0].betas, changed[0].steps, changed[0].mixed_precision) == ((0.8, 0.9), 7, True)
    assert SETTINGS.steps == 24
    with pytest.raises(InvalidOption, match="no setting 'learning_rat'; closest: learning_rate"):
        set_values([SETTINGS], {"learning_rat": 1})
    with pytest.raises(InvalidOption, match="training setting steps=0: expected `int` >= 1"):
        set_values([SETTINGS], {"steps": "0"})
    with pytest.raises(InvalidOption, match="schedule=step: invalid enum value 'step'"):
        set_values([SETTINGS], {"schedule": "step"})


def test_mixed_precision_is_for_cuda(tmp_path):
    with pytest.raises(InvalidOption, match="for CUDA, not cpu"):
        run(tmp_path, set_values([SETTINGS], {"mixed_precision": True})[0])


def test_curves_survive_a_cut_and_new_columns(tmp_path):
    path = tmp_path / "curve.csv"
    curve = CurveFile(path, 0)
    curve.add(1, {"a": 1.5})
    curve.add(2, {"a": 2.5})
    with path.open("a") as file:
        file.write("3,9")  # cut by a kill
    again = CurveFile(path, 1)
    again.add(2, {"a": 0.1, "b": 7})
    assert read_curve(path) == [
        {"step": "1", "a": "1.5", "b": ""},
        {"step": "2", "a": "0.1", "b": "7"},
    ]


def test_tensorboard_is_optional(tmp_path, monkeypatch, caplog):
    monkeypatch.setitem(sys.modules, "torch.utils.tensorboard", None)
    with caplog.at_level("INFO"):
        assert open_tensorboard(tmp_path, 0) is None
    assert "pip install 'nat-bench[train]'" in caplog.text


def test_tensorboard_shows_the_curves_and_no_step_twice(tmp_path):
    """What its own reader finds is what the CSV files have, also after a kill and a resume."""
    accumulator = pytest.importorskip("tensorboard.backend.event_processing.event_accumulator")
    run(tmp_path, set_values([SETTINGS], {"schedule": "constant", "steps": 14})[0])
    (tmp_path / "checkpoints" / "step-00000014.pt").unlink()  # as if killed before it was there
    _, report = run(tmp_path, set_values([SETTINGS], {"schedule": "constant"})[0])
    assert report.resumed_from == 12
    events = accumulator.EventAccumulator(str(tmp_path / "tensorboard")).Reload()
    curve = read_curve(tmp_path / "curve.csv")
    columns = set(curve[0]) - {"step"}
    assert set(events.Tags()["scalars"]) == {f"train/{name}" for name in columns} | {
        "validation/error"
    }
    for name in columns:
        shown = [(one.step, one.value) for one in events.Scalars(f"train/{name}")]
        assert [step for step, _ in shown] == [4, 8, 12, 16, 20, 24]
        assert [value for _, value in shown] == pytest.approx(
            [float(row[name]) for row in curve], rel=1e-6
        )
    assert [one.step for one in events.Scalars("validation/error")] == [6, 12, 18, 24]


@pytest.fixture
def cuda() -> str:
    if not torch.cuda.is_available():
        pytest.skip("there is no CUDA device")
    return "cuda"


@pytest.mark.gpu
@pytest.mark.parametrize("mixed", [False, True])
def test_it_learns_on_cuda_and_goes_on(tmp_path, cuda, mixed):
    def on_cuda(folder, settings, **problem):
        made = Problem()
        made.network.to(cuda)
        made.breaks_at = problem.get("breaks_at", -1)
        return made, train(
            made.network, made.loss, made.source, settings, folder, validate=None, device=cuda
        )

    values = {"steps": 60, "learning_rate": 1e-2, "mixed_precision": mixed, "schedule": "constant"}
    settings = set_values([SETTINGS], values)[0]
    with pytest.raises(TrainingFailed, match=r"step 44: loss term 'size' is nan"):
        on_cuda(tmp_path, settings, breaks_at=44)
    made, report = on_cuda(tmp_path, settings)
    assert report.resumed_from == 42
    assert made.network[0].weight.is_cuda
    curve = read_curve(tmp_path / "curve.csv")
    assert [int(row["step"]) for row in curve] == list(range(4, 61, 4))
    assert float(curve[-1]["error"]) < 0.8 * float(curve[0]["error"])
    assert all(math.isfinite(float(value)) for row in curve for value in row.values())
    stored = read_checkpoint(list_checkpoints(tmp_path / "checkpoints")[-1])
    assert bool(stored["scaler"]) == mixed
    whole, _ = on_cuda(tmp_path / "whole", settings)
    for key, value in whole.network.state_dict().items():
        torch.testing.assert_close(
            made.network.state_dict()[key], value, rtol=0.02, atol=0.02, msg=key
        )


@pytest.mark.gpu
def test_gradients_that_stay_infinite_stop_mixed_precision(tmp_path, cuda):
    problem = Problem()
    problem.network.to(cuda)

    def loss(batch):
        x = problem.network(batch["x"])
        return {"root": torch.sqrt((0 * x).abs()).sum()}  # finite, its gradient is not

    settings = set_values([SETTINGS], {"mixed_precision": True, "steps": 60})[0]
    with pytest.raises(TrainingFailed, match="the gradient's norm is nan"):
        train(problem.network, loss, problem.source, settings, tmp_path, device=cuda)


def test_weights_are_safetensors_that_the_zoo_reads(tmp_path):
    problem = Problem()
    note = {"steps": "3", "name": "network", "a": "b", "c": "d"}
    write_weights(tmp_path / "w.safetensors", problem.network, note)
    state = read_weights(tmp_path / "w.safetensors")
    assert state.keys() == problem.network.state_dict().keys()
    header = (tmp_path / "w.safetensors").read_bytes()
    length = int.from_bytes(header[:8], "little")
    assert json.loads(header[8 : 8 + length])["__metadata__"] == note
    written = (tmp_path / "w.safetensors").read_bytes()
    backwards = dict(reversed(note.items()))
    write_weights(tmp_path / "again.safetensors", problem.network, backwards)
    assert (tmp_path / "again.safetensors").read_bytes() == written
    assert (8 + length) % 8 == 0
