"""Curves where the disk is full or a file is damaged."""

import errno

import pytest

from nat2024.errors import ResultConflict
from nat2024.training.curves import Board, CurveFile, open_tensorboard


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
