"""Checkpoints: training goes on bit for bit after a kill, and nothing that fails loses them."""

import json
import os
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from nat2024.errors import ResultConflict, Unwritable, WeightsMismatch
from nat2024.files import write_atomic
from nat2024.training import write_weights
from nat2024.training.checkpoints import list_checkpoints
from nat2024.zoo import read_checkpoint as read_weights

KILLED = """
import os, signal, sys
from pathlib import Path
sys.path.insert(0, {tests!r})
from conftest import SETTINGS, Problem
from nat2024.training import train

problem = Problem()
def die(done, what, steps=iter(range(100))):
    if next(steps) == 15:
        os.kill(os.getpid(), signal.SIGKILL)
train(problem.network, problem.loss, problem.source, SETTINGS, Path({folder!r}),
      validate=problem.validate, on_progress=die)
"""


def test_killed_it_goes_on_to_the_same_bits(tmp_path, run, assert_same):
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


def test_a_checkpoint_of_another_configuration_is_refused(tmp_path, run, settings):
    run(tmp_path)
    other = settings(learning_rate=0.5, clip=2)
    with pytest.raises(ResultConflict, match=r"settings.clip 1.0 there, 2.0 now, settings.learn"):
        run(tmp_path, other)
    with pytest.raises(ResultConflict, match="data None there, x now"):
        run(tmp_path, identity={"data": "x"})
    longer = settings(validate_every=5, log_every=8, keep=2)
    assert run(tmp_path, longer)[1].steps == 24


def test_a_longer_constant_schedule_goes_on(tmp_path, run, settings, assert_same):
    run(tmp_path / "a", settings(schedule="constant"))
    more = settings(schedule="constant", steps=30)
    resumed, report = run(tmp_path / "a", more)
    assert report.resumed_from == 24
    assert_same(resumed.network, run(tmp_path / "b", more)[0].network)


def test_a_damaged_checkpoint_says_so(tmp_path, run):
    run(tmp_path)
    last = list_checkpoints(tmp_path / "checkpoints")[-1]
    last.write_bytes(last.read_bytes()[:100])
    with pytest.raises(WeightsMismatch, match=r"step-00000024\.pt: not a readable checkpoint"):
        run(tmp_path)
    last.unlink()
    assert run(tmp_path)[1].resumed_from == 18


def test_no_disk_space_loses_nothing(tmp_path, monkeypatch, run, assert_same):
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
def test_a_file_system_that_refuses_loses_nothing(tmp_path, run, settings, assert_same):
    """Files may not pass 8 kB for a while, which the network's checkpoints do."""
    import resource

    _, before = run(tmp_path, settings(schedule="constant", steps=6))
    assert before.steps == 6
    constant = settings(schedule="constant")
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


def test_old_checkpoints_are_forgotten(tmp_path, run, settings):
    run(tmp_path, settings(keep=2))
    names = [path.name for path in list_checkpoints(tmp_path / "checkpoints")]
    assert names == ["step-00000018.pt", "step-00000024.pt"]


def test_weights_are_safetensors_that_the_zoo_reads(tmp_path, make_problem):
    problem = make_problem()
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
