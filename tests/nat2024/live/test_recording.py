"""What is kept of a run, and what it comes to."""

import subprocess
import sys

import numpy as np
import pytest

from nat2024 import read_boxes
from nat2024.errors import Unwritable
from nat2024.live import Film, LiveFrame, Recorder, center_errors, summarise

FRAMES = [
    LiveFrame(3, np.array([0.0, 0, 10, 10]), float("nan"), np.array([0.5, 0.5, 0.5])),
    LiveFrame(4, np.array([3.0, 4, 10, 10]), 0.25, np.array([0.01, 0.02, 0.03])),
    LiveFrame(5, np.array([3.0, 4, 10, 10]), float("nan"), np.zeros(3), is_skipped=True),
    LiveFrame(6, np.array([30.5, 0, 10, 10]), 0.5, np.array([0.03, 0.02, 0.01])),
]
REFERENCE = np.array([[9.0, 9, 9, 9]] * 3 + [[0.0, 0, 10, 10]] * 3)


def test_lines_are_there_before_the_end(tmp_path):
    with Recorder(tmp_path / "out") as recorder:
        for frame in FRAMES:
            recorder.write(frame)
        boxes = read_boxes(tmp_path / "out" / "boxes.txt")
        np.testing.assert_array_equal(boxes, [frame.box for frame in FRAMES])
        lines = (tmp_path / "out" / "frames.csv").read_text().splitlines()
    assert lines[0] == "frame,skipped,score,read,enhance,track"
    assert lines[1] == "3,0,,0.500000,0.500000,0.500000"
    assert lines[2] == "4,0,0.25,0.010000,0.020000,0.030000"
    assert lines[3] == "5,1,,0.000000,0.000000,0.000000"


def test_the_sum_of_a_run():
    summary = summarise(FRAMES, REFERENCE)
    assert (summary.frames, summary.skipped, summary.compared) == (4, 1, 3)
    assert summary.frames_per_second == pytest.approx(2 / 0.12)
    assert summary.method_frames_per_second == pytest.approx(2 / 0.08)
    assert summary.read_ms == pytest.approx(20)
    assert summary.precision_20 == 1.0
    assert summary.mean_center_error == pytest.approx((0 + 5 + 5) / 3)


def test_errors_are_known_where_the_reference_is():
    errors = center_errors(FRAMES, REFERENCE)
    np.testing.assert_allclose(errors, [0, 5, 5, np.nan])
    assert np.isnan(center_errors(FRAMES, None)).all()
    summary = summarise(FRAMES[:1])
    assert np.isnan(summary.precision_20)
    assert np.isnan(summary.frames_per_second)


def test_a_folder_that_cannot_be_made(tmp_path):
    (tmp_path / "file").write_text("mine")
    with pytest.raises(Unwritable, match="cannot be written"), Recorder(tmp_path / "file"):
        pass


def test_a_film_holds_the_last_frame_and_has_even_sides(tmp_path):
    import cv2

    with Film(tmp_path / "film.webm", 10.0) as film:
        film.write(None)  # nothing to hold yet
        film.write(np.full((49, 65, 3), 200, np.uint8))
        film.write(None)
        film.write(np.full((30, 40, 3), 50, np.uint8))
    capture = cv2.VideoCapture(str(tmp_path / "film.webm"))
    means, shapes = [], set()
    while True:
        ok, image = capture.read()
        if not ok:
            break
        means.append(float(image.mean()))
        shapes.add(image.shape)
    assert shapes == {(48, 64, 3)}
    np.testing.assert_allclose(means, [200, 200, 50], atol=8)


def test_a_film_without_frames_is_none(tmp_path):
    with Film(tmp_path / "film.webm", 10.0):
        pass
    assert not list(tmp_path.iterdir())


def test_the_video_of_a_killed_run_goes_away_and_no_other(tmp_path):
    begin = (
        "import os, sys; from pathlib import Path; import numpy as np\n"
        "from nat2024.live import Film\n"
        "film = Film(Path(sys.argv[1]) / 'overlay.webm', 10).__enter__()\n"
        "film.write(np.zeros((32, 32, 3), np.uint8))\n"
        "print(flush=True); sys.stdin.read(); os._exit(9)"
    )
    command = [sys.executable, "-c", begin, str(tmp_path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdout.readline() == b"\n"
        [begun] = tmp_path.iterdir()
        assert begun.name.startswith(".overlay.webm.")
        with Recorder(tmp_path):
            assert begun.exists()  # its process is alive
        process.kill()
    with Recorder(tmp_path):
        assert not begun.exists()
