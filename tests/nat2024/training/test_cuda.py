"""The loop on a GPU, in full and in mixed precision."""

import math

import pytest
import torch

from nat2024.errors import TrainingFailed
from nat2024.training import train
from nat2024.training.checkpoints import list_checkpoints, read_checkpoint
from nat2024.training.curves import read_curve


@pytest.fixture
def cuda() -> str:
    if not torch.cuda.is_available():
        pytest.skip("there is no CUDA device")
    return "cuda"


@pytest.mark.gpu
@pytest.mark.parametrize("mixed", [False, True])
def test_it_learns_on_cuda_and_goes_on(tmp_path, cuda, mixed, settings, make_problem):
    def on_cuda(folder, **problem):
        made = make_problem()
        made.network.to(cuda)
        made.breaks_at = problem.get("breaks_at", -1)
        return made, train(
            made.network, made.loss, made.source, chosen, folder, validate=None, device=cuda
        )

    chosen = settings(steps=60, mixed_precision=mixed, schedule="constant")
    with pytest.raises(TrainingFailed, match=r"step 44: loss term 'size' is nan"):
        on_cuda(tmp_path, breaks_at=44)
    made, report = on_cuda(tmp_path)
    assert report.resumed_from == 42
    assert made.network[0].weight.is_cuda
    curve = read_curve(tmp_path / "curve.csv")
    assert [int(row["step"]) for row in curve] == list(range(4, 61, 4))
    assert float(curve[-1]["error"]) < 0.8 * float(curve[0]["error"])
    assert all(math.isfinite(float(value)) for row in curve for value in row.values())
    stored = read_checkpoint(list_checkpoints(tmp_path / "checkpoints")[-1])
    assert bool(stored["scaler"]) == mixed
    whole, _ = on_cuda(tmp_path / "whole")
    for key, value in whole.network.state_dict().items():
        torch.testing.assert_close(
            made.network.state_dict()[key], value, rtol=0.02, atol=0.02, msg=key
        )


@pytest.mark.gpu
def test_gradients_that_stay_infinite_stop_mixed_precision(tmp_path, cuda, settings, make_problem):
    problem = make_problem()
    problem.network.to(cuda)

    def loss(batch):
        x = problem.network(batch["x"])
        return {"root": torch.sqrt((0 * x).abs()).sum()}  # finite, its gradient is not

    chosen = settings(mixed_precision=True, steps=60)
    with pytest.raises(TrainingFailed, match="the gradient's norm is nan"):
        train(problem.network, loss, problem.source, chosen, tmp_path, device=cuda)
