"""`nat-bench track`, on files and on a stream."""

import json
import subprocess
import sys

import cv2
import numpy as np
import pytest

from nat2024 import read_boxes, write_boxes
from nat2024.cli import options


@pytest.fixture
def footage(tmp_path):
    """A folder of 8 frames with a square that moves, and its boxes."""
    random = np.random.default_rng(0)
    patch = random.integers(100, 256, (20, 20, 3), dtype=np.uint8)
    folder, boxes = tmp_path / "footage", []
    folder.mkdir()
    for number in range(8):
        image = random.integers(0, 30, (96, 128, 3), dtype=np.uint8)
        x, y = 30 + 4 * number, 30 + 2 * number
        image[y : y + 20, x : x + 20] = patch
        cv2.imwrite(str(folder / f"{number:03}.png"), image)
        boxes.append([x, y, 20, 20])
    write_boxes(tmp_path / "truth.txt", np.array(boxes, dtype=np.float64))
    return folder


def test_track_writes_everything(cli, footage, tmp_path):
    out = tmp_path / "out"
    words = ["--tracker", "mil", "--enhancer", "gamma", "--reference", tmp_path / "truth.txt"]
    status, text, err = cli("track", footage, *words, "--out", out, "--json")
    assert status == 0, err
    document = json.loads(text)
    assert document["run"] == "mil+gamma"
    assert document["frames"] == document["compared"] == 8
    assert document == json.loads((out / "summary.json").read_text())
    assert len(read_boxes(out / "boxes.txt")) == 8
    names = {path.name for path in out.iterdir()}
    assert names >= {"overlay.webm", "frames.csv", "center_error.csv", "center_error.png"}
    rows = (out / "frames.csv").read_text().splitlines()[1:]
    seconds = np.array([line.split(",")[3:] for line in rows], dtype=float)
    assert (seconds[:, 1:] > 0).all()


def test_the_plain_table(cli, footage, tmp_path):
    words = ["--tracker", "mil", "--box", "30,30,20,20", "--no-video", "--max-frames", 4]
    status, text, _ = cli("track", footage, *words, "--out", tmp_path / "out")
    assert status == 0
    assert "mil" in text
    assert "footage" in text
    assert not (tmp_path / "out" / "overlay.webm").exists()
    assert len(read_boxes(tmp_path / "out" / "boxes.txt")) == 4


def test_control_c_keeps_what_there_is(cli, footage, tmp_path, monkeypatch):
    import nat2024.live

    original = nat2024.live.follow

    def interrupted(*words, **more):
        for number, frame in enumerate(original(*words, **more)):
            if number == 3:
                raise KeyboardInterrupt
            yield frame

    monkeypatch.setattr(nat2024.live, "follow", interrupted)
    out = tmp_path / "out"
    words = ["--tracker", "mil", "--box", "30,30,20,20", "--out", out]
    status, _, err = cli("track", footage, *words)
    assert status == 0
    assert "stopped after 3 frames" in err
    assert len(read_boxes(out / "boxes.txt")) == 3
    capture = cv2.VideoCapture(str(out / "overlay.webm"))
    assert sum(1 for _ in iter(capture.grab, False)) == 3
    assert json.loads((out / "summary.json").read_text())["frames"] == 3


def test_a_bad_frame_keeps_what_came_before(cli, footage, tmp_path):
    (footage / "005.png").write_bytes(b"\x89PNG\r\n\x1a\n")
    out = tmp_path / "out"
    words = ["--tracker", "mil", "--box", "30,30,20,20", "--out", out]
    status, _, err = cli("track", footage, *words)
    assert status == 2
    assert "005.png" in err
    assert len(read_boxes(out / "boxes.txt")) == 5
    capture = cv2.VideoCapture(str(out / "overlay.webm"))
    assert sum(1 for _ in iter(capture.grab, False)) == 5


def test_a_tracker_that_fails_is_named_with_its_frame(cli, footage, tmp_path, monkeypatch):
    from nat2024_trackers.correlation.mosse import MOSSE

    original = MOSSE.advance

    def fails_late(self, image):
        self.count = getattr(self, "count", 0) + 1
        if self.count == 5:  # one of them warmed it up
            msg = "no\nway"
            raise ZeroDivisionError(msg)
        return original(self, image)

    monkeypatch.setattr(MOSSE, "advance", fails_late)
    out = tmp_path / "out"
    words = ["--tracker", "mosse", "--box", "30,30,20,20", "--out", out]
    status, _, err = cli("track", footage, *words)
    assert status == 2
    assert err.splitlines()[-1].endswith(f"{footage.name}, frame 4: ZeroDivisionError: no way")
    assert len(read_boxes(out / "boxes.txt")) == 4


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        ([], "--box X,Y,W,H is needed"),
        (["--box", "1,2,3"], "expected X,Y,W,H"),
        (["--box", "1,2,x,4"], "expected X,Y,W,H"),
        (["--box", "1,2,0,4"], "has no area"),
        (["--box", "900,2,4,4"], "lies outside"),
        (["--box", "1,2,4,4", "--start", "99"], "ends before frame 99"),
        (["--box", "1,2,4,4", "--enhancer", "gama"], "unknown enhancer 'gama'"),
    ],
)
def test_bad_words_are_one_line(cli, footage, tmp_path, words, complaint):
    given = ["track", footage, "--tracker", "mil", "--out", tmp_path / "out", *words]
    status, out, err = cli(*given)
    assert (status, out) == (2, "")
    assert complaint in err
    assert len(err.splitlines()) == 1


def test_the_default_tracker_is_said(cli, footage, tmp_path, monkeypatch):
    monkeypatch.setattr(options, "DEFAULT_TRACKER", "mil")
    words = ["--box", "30,30,20,20", "--out", tmp_path / "out", "--no-video"]
    status, _, err = cli("track", footage, *words)
    assert status == 0
    assert "no --tracker given, taking mil" in err


def test_a_refused_stream_is_one_line(tmp_path):
    words = ["track", "http://127.0.0.1:9/live", "--box", "1,2,3,4", "--out", str(tmp_path)]
    done = subprocess.run(
        [sys.executable, "-m", "nat2024", *words], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1].endswith("/live: cannot be opened as a stream")
    assert all(line.startswith("nat-bench: ") for line in done.stderr.splitlines())


def test_files_of_an_earlier_run_do_not_stay_beside_a_new_one(cli, footage, tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    for name in ("center_error.png", "center_error.csv", "overlay.webm", "my.txt"):
        (out / name).write_text("old")
    words = ["--tracker", "mosse", "--box", "30,30,20,20", "--no-video", "--out", out]
    assert cli("track", footage, *words)[0] == 0
    found = {path.name for path in out.iterdir()}
    assert found == {"boxes.txt", "frames.csv", "summary.json", "my.txt"}
