"""Frames on their way to a tracker: read ahead, skipped by policy, from folder, zip or video."""

import json
import pickle
import shutil
import threading
import zipfile
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

import nat2024
from nat2024.cards import Card
from nat2024.cli import run as nat_bench
from nat2024.engine import combine, run_benchmark, track_sequence
from nat2024.errors import FrameUnreadable, NatBenchError, ResultConflict, UsageError
from nat2024.store import RunFolder, Track

pytestmark = pytest.mark.usefixtures("small_plugins")


def run(folder: Path, results: Path, trackers: str = "still", **settings: Any) -> Any:
    dataset = nat2024.load_dataset(folder)
    return run_benchmark(combine(trackers.split(), ["none"]), dataset, results, **settings)


def box_files(results: Path) -> dict[str, bytes]:
    return {str(p.relative_to(results)): p.read_bytes() for p in sorted(results.rglob("*.txt"))}


def manifest(results: Path, name: str = "still") -> Any:
    return json.loads((results / name / "still" / "run.json").read_text())


@pytest.fixture
def damaged(night_clip: Path, tmp_path: Path) -> Path:
    """The clip with frames 3 and 4 of `tall` and frame 8 of `wide` damaged, counted from 1."""
    copy = tmp_path / "damaged"
    shutil.copytree(night_clip, copy)
    for name, number in (("tall", 3), ("tall", 4), ("wide", 8)):
        path = copy / "data_seq" / name / f"{number:05d}.png"
        path.write_bytes(path.read_bytes()[:200])
    return copy


@pytest.mark.parametrize("workers", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_results_are_the_same_bytes_with_and_without_reading_ahead(
    night_clip: Path, tmp_path: Path, small_plugins: str, workers: int
) -> None:
    settings: dict[str, Any] = {"workers": workers, "plugins": (small_plugins,)}
    found = []
    for ahead in (0, 4) if workers > 1 else (0, 1, 4, 100):
        run(night_clip, tmp_path / str(ahead), read_ahead=ahead, **settings)
        found.append(box_files(tmp_path / str(ahead)))
        (session,) = manifest(tmp_path / str(ahead), "night_clip")["sessions"]
        assert session["read_ahead"] == ahead
    assert len(found[0]) == 3
    assert all(files == found[0] for files in found)


def test_skipped_frames_repeat_the_box_and_are_recorded(
    damaged: Path, night_clip: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    results = tmp_path / "results"
    report = run(damaged, results, on_bad_frame="skip")
    assert report.failures == ()
    stored = manifest(results, "damaged")
    assert stored["on_bad_frame"] == "skip"
    assert stored["skipped_frames"] == {"tall": [2, 3], "wide": [7]}
    assert "still, tall: 2 frames cannot be read, the last box is repeated: 2, 3" in caplog.text
    folder = RunFolder(results / "damaged" / "still")
    boxes, seconds = folder.boxes("tall"), folder.seconds("tall")
    assert (boxes[2] == boxes[1]).all()
    assert (boxes[3] == boxes[1]).all()
    assert (seconds[2:4, 1:] == 0).all()
    run(night_clip, tmp_path / "whole")
    whole = RunFolder(tmp_path / "whole" / "night_clip" / "still").boxes("tall")
    # `still` depends on one frame at a time, so the frames after the gap are as ever
    assert (boxes[[0, 1, 4, 5, 6, 7]] == whole[[0, 1, 4, 5, 6, 7]]).all()


def test_the_tracker_is_left_alone_on_a_skipped_frame(damaged: Path, tmp_path: Path) -> None:
    combinations = combine(["still"], ["none"], options={"still": {"step": 5}})
    dataset = nat2024.load_dataset(damaged)
    track = track_sequence(combinations[0].create()[0], dataset["tall"], on_bad_frame="skip")
    assert track.skipped == (2, 3)
    start = dataset["tall"].boxes[0, 1]
    np.testing.assert_allclose(track.boxes[:, 1] - start, [0, 5, 5, 5, 10, 15, 20, 25])


def test_by_default_the_sequence_fails_and_the_frame_is_named(
    damaged: Path, tmp_path: Path
) -> None:
    for ahead in (0, 4):
        report = run(damaged, tmp_path / str(ahead), read_ahead=ahead)
        assert {f.sequence for f in report.failures} == {"tall", "wide"}
        reason = next(f.reason for f in report.failures if f.sequence == "tall")
        assert "00003.png (frame 2, counted from 0): truncated" in reason
        assert manifest(tmp_path / str(ahead), "damaged")["skipped_frames"] == {}


def test_the_first_frame_is_never_skipped(damaged: Path, tmp_path: Path) -> None:
    (damaged / "data_seq" / "narrow" / "00001.png").write_bytes(b"")
    report = run(damaged, tmp_path / "results", on_bad_frame="skip")
    (failure,) = report.failures
    assert failure.sequence == "narrow"
    assert "00001.png (frame 0, counted from 0): the file is empty" in failure.reason


def test_the_policy_belongs_to_the_run_folder(damaged: Path, tmp_path: Path) -> None:
    run(damaged, tmp_path / "results", on_bad_frame="skip")
    with pytest.raises(ResultConflict, match=r"on_bad_frame skip \(now error\)"):
        run(damaged, tmp_path / "results")


def test_what_was_skipped_is_known_after_a_kill_and_a_second_try(
    damaged: Path, tmp_path: Path
) -> None:
    results = tmp_path / "results"
    run(damaged, results, on_bad_frame="skip")
    folder = RunFolder(results / "damaged" / "still")
    stored = folder.manifest()
    assert stored is not None
    stored.skipped_frames = {}  # as a run that was killed before its end leaves it
    folder.write_manifest(stored)
    folder.box_file("narrow").unlink()
    run(damaged, results, on_bad_frame="skip")
    assert manifest(results, "damaged")["skipped_frames"] == {"tall": [2, 3], "wide": [7]}
    folder.write("wide", Track(np.ones((8, 4)), np.ones((8, 3))))
    assert folder.skipped_frames() == {"tall": [2, 3]}
    folder.box_file("tall").unlink()
    assert folder.skipped_frames() == {}


def test_skipped_frames_do_not_make_a_tracker_fast(tmp_path: Path) -> None:
    folder = RunFolder(tmp_path)
    seconds = np.full((6, 3), 0.5)
    seconds[2:4, 1:] = 0
    folder.write("a", Track(np.ones((6, 4)), seconds, (2, 3)))
    times = folder.stage_times()
    assert times is not None
    assert (times.frames, times.frames_per_second) == (4, 1.0)
    folder.skipped_file("a").write_text("two\n")
    with pytest.raises(ResultConflict, match=r"a\.csv: expected one frame number a line"):
        folder.skipped_frames()


def test_results_do_not_depend_on_how_the_frames_are_kept(night_clip: Path, tmp_path: Path) -> None:
    archive = tmp_path / "night_clip.zip"
    with zipfile.ZipFile(archive, "w") as file:
        for path in sorted(night_clip.rglob("*.*")):
            file.write(path, path.relative_to(night_clip))
    run(night_clip, tmp_path / "folder")
    run(archive, tmp_path / "archive")
    assert box_files(tmp_path / "folder") == box_files(tmp_path / "archive")


@pytest.mark.parametrize("workers", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_a_video_is_tracked_in_any_process(
    tmp_path: Path, small_plugins: str, workers: int
) -> None:
    for name in ("a", "b"):
        (tmp_path / "clips").mkdir(exist_ok=True)
        code = cv2.VideoWriter_fourcc(*"VP90")
        path = tmp_path / "clips" / f"{name}.webm"
        writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, code, 25, (64, 48))
        for number in range(9):
            writer.write(np.full((48, 64, 3), 20 * number, np.uint8))
        writer.release()
        (tmp_path / "clips" / f"{name}.txt").write_text("10,10,9,9\n" * 9)
    report = run(
        tmp_path / "clips", tmp_path / "results", workers=workers, plugins=(small_plugins,)
    )
    assert (report.tracked, report.failures) == (2, ())
    boxes = RunFolder(tmp_path / "results" / "clips" / "still").boxes("b")
    np.testing.assert_allclose(boxes[:, 0] - 10, 0.2 * np.arange(9), atol=0.06)
    sequence = nat2024.load_dataset(tmp_path / "clips")["b"]
    sent = pickle.loads(pickle.dumps(sequence))  # as workers get it
    np.testing.assert_array_equal(sent.image(5), sequence.image(5))


class Picky(nat2024.Tracker):
    """Fails on a frame of another size than the first."""

    card = Card(title="Picky", summary="For tests.", scopes=("frame", "patch"))

    def start(self, image: Any, box: Any) -> Any:
        self._shape = image.shape
        return box

    def advance(self, image: Any) -> Any:
        if image.shape != self._shape:
            message = "shapes differ"
            raise ValueError(message)
        return np.ones(4), 1.0


def test_a_tracker_that_fails_on_another_size_says_which(night_clip: Path, tmp_path: Path) -> None:
    copy = tmp_path / "mixed"
    shutil.copytree(night_clip, copy)
    cv2.imwrite(str(copy / "data_seq" / "wide" / "00005.png"), np.zeros((50, 70, 3), np.uint8))
    sequence = nat2024.load_dataset(copy)["wide"]
    expected = (
        r"frame 5 of 8: ValueError: shapes differ \(this frame is 70x50, the first one 160x96\)"
    )
    with pytest.raises(NatBenchError, match=expected):
        track_sequence(Picky(), sequence)
    report = run(copy, tmp_path / "results")
    assert report.failures == ()  # `still` takes what is there


def test_no_thread_outlives_its_sequence(damaged: Path) -> None:
    sequence = nat2024.load_dataset(damaged)["tall"]
    tracker = combine(["still"], ["none"])[0].create()[0]
    with pytest.raises(FrameUnreadable):
        track_sequence(tracker, sequence)

    def stop() -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        track_sequence(tracker, sequence, stop)
    assert all(thread.name != "nat2024 prefetch" for thread in threading.enumerate())


def test_the_time_for_reading_is_what_the_loop_waited(night_clip: Path) -> None:
    import time
    from dataclasses import replace

    class Slow:
        frame_size = (160, 96)

        def __len__(self) -> int:
            return 8

        def __getitem__(self, index: int) -> Any:
            time.sleep(0.004)
            return sequence.image(index)

    class Busy(Picky):
        def advance(self, image: Any) -> Any:
            time.sleep(0.012)
            return super().advance(image)

    sequence = nat2024.load_dataset(night_clip)["wide"]
    slow = replace(sequence, frames=Slow())
    waited = {ahead: track_sequence(Busy(), slow, ahead=ahead).seconds for ahead in (0, 4)}
    assert waited[0][1:, 0].min() > 0.004
    assert np.median(waited[4][1:, 0]) < 0.002
    assert waited[4][1:, 2].min() > 0.012


def test_unknown_words_and_numbers(night_clip: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="on_bad_frame 'repeat' is none of error, skip"):
        run(night_clip, tmp_path, on_bad_frame="repeat")
    with pytest.raises(UsageError, match="read_ahead must be 0 or more, not -1"):
        run(night_clip, tmp_path, read_ahead=-1)


def test_from_the_command_line(
    damaged: Path, tmp_path: Path, small_plugins: str, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["run", "--tracker", "still", "--dataset", str(damaged), "--plugin", small_plugins]
    words += ["--device", "cpu", "--read-ahead", "2"]
    skip = ["--results", str(tmp_path / "skip"), "--on-bad-frame", "skip"]
    assert nat_bench([*words, *skip]) == 0
    assert "wide: 1 frames cannot be read, the last box is repeated: 7" in capsys.readouterr().err
    assert nat_bench([*words, "--results", str(tmp_path / "error")]) == 1
    assert "00003.png (frame 2" in capsys.readouterr().err
