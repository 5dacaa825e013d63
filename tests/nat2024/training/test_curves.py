"""Curves as CSV and in TensorBoard: cut by a kill, on a full disk, from a damaged file."""

import errno
import sys

import pytest

from nat2024.errors import ResultConflict
from nat2024.training.curves import Board, CurveFile, open_tensorboard, read_curve


class FullDisk:
    """A writer whose disk gets full, as TensorBoard's threads tell it: at any later call."""

    def __init__(self):
        self.points = []

    def add_scalar(self, *point):
        if self.points:
            raise OSError(errno.ENOSPC, "No space left on device")
        self.points.append(point)

    def close(self):
        raise OSError(errno.ENOSPC, "No space left on device")


def test_a_full_disk_ends_tensorboard_not_the_training(caplog):
    writer = FullDisk()
    board = Board(writer)
    board.add("train", 1, {"loss": 0.5})
    board.add("train", 2, {"loss": 0.4})
    board.add("train", 3, {"loss": 0.3})
    board.close()
    assert writer.points == [("train/loss", 0.5, 1)]
    assert caplog.text.count("No space left on device); curves are written as CSV only") == 1
    caplog.clear()
    Board(FullDisk()).close()
    assert "No space left" in caplog.text


def test_a_folder_that_tensorboard_cannot_have_is_told(tmp_path, caplog):
    pytest.importorskip("tensorboard")
    (tmp_path / "tensorboard").write_text("a file")
    assert open_tensorboard(tmp_path / "tensorboard", 0) is None
    assert "curves are written as CSV only" in caplog.text


@pytest.mark.parametrize(
    "damage", [b"step,a\none,2\n", b"a,b\n1,2\n", b"step,a\n1,2,3\n", b"\xff\xfe\n\xff,1\n"]
)
def test_a_damaged_curve_is_one_line(damage, tmp_path):
    path = tmp_path / "curve.csv"
    path.write_bytes(damage)
    with pytest.raises(ResultConflict, match=r"curve\.csv: not a curve of a training, or damaged"):
        CurveFile(path, 5)
    assert path.read_bytes() == damage


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


def test_tensorboard_shows_the_curves_and_no_step_twice(tmp_path, run, settings):
    """What its own reader finds is what the CSV files have, also after a kill and a resume."""
    accumulator = pytest.importorskip("tensorboard.backend.event_processing.event_accumulator")
    run(tmp_path, settings(schedule="constant", steps=14))
    (tmp_path / "checkpoints" / "step-00000014.pt").unlink()  # as if killed before it was there
    _, report = run(tmp_path, settings(schedule="constant"))
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
