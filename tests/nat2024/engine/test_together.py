"""Combinations that share frames: decoded once, enhanced once, the same bytes as alone."""

import time
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import nat2024
from nat2024 import Enhancer, Tracker, register_enhancer, register_tracker
from nat2024.cards import Card
from nat2024.engine import combine, run_benchmark, track_sequence
from nat2024.engine.lockstep import Reading, track_together
from nat2024.engine.sharing import SharedFrames
from nat2024.engine.timing import TimedEnhancer
from nat2024.engine.units import Trackers
from nat2024.errors import TimedOut
from nat2024.store import RunFolder, Track

pytestmark = pytest.mark.usefixtures("small_plugins")


def box_files(results: Path) -> dict[str, bytes]:
    return {str(p.relative_to(results)): p.read_bytes() for p in sorted(results.rglob("*.txt"))}


class Counted:
    """Frames that count how often each is decoded."""

    def __init__(self, frames: Any) -> None:
        self.frames, self.decoded = frames, Counter[int]()

    @property
    def frame_size(self) -> tuple[int, int]:
        size: tuple[int, int] = self.frames.frame_size
        return size

    def __len__(self) -> int:
        return len(self.frames)

    def __getitem__(self, index: int) -> Any:
        self.decoded[index] += 1
        return self.frames[index]


def counted(folder: Path) -> nat2024.Dataset:
    dataset = nat2024.load_dataset(folder)
    sequences = tuple(replace(s, frames=Counted(s.frames)) for s in dataset)
    return replace(dataset, sequences=sequences)


def test_the_same_bytes_as_one_combination_at_a_time(night_clip: Path, tmp_path: Path) -> None:
    dataset = nat2024.load_dataset(night_clip).select(["tall", "wide"])
    frame = combine(["still", "fdsst"], ["none", "clahe", "invert"], scope="frame")
    patch = combine(["fdsst@p", "kcf@p"], ["clahe"], scope="patch")
    run_benchmark([*frame, *patch], dataset, tmp_path / "together")
    for one in (*frame, *patch):
        run_benchmark([one], dataset, tmp_path / "alone")
    assert box_files(tmp_path / "together") == box_files(tmp_path / "alone")
    assert len(box_files(tmp_path / "together")) == 8 * 2


def test_a_frame_is_decoded_once_for_all_combinations(night_clip: Path, tmp_path: Path) -> None:
    dataset = counted(night_clip)
    run_benchmark(combine(["still", "kcf"], ["none", "clahe", "gamma"]), dataset, tmp_path)
    for sequence in dataset:
        assert sequence.frames.decoded == Counter(range(len(sequence)))  # type: ignore[attr-defined]


def test_what_is_missing_is_tracked_and_no_more(night_clip: Path, tmp_path: Path) -> None:
    combinations = combine(["still", "kcf"], ["none", "clahe"])
    run_benchmark(combinations, nat2024.load_dataset(night_clip), tmp_path)
    before = box_files(tmp_path)
    for run, name in (("still", "wide"), ("kcf+clahe", "wide"), ("kcf", "tall")):
        (tmp_path / "night_clip" / run / f"{name}.txt").unlink()
    dataset = counted(night_clip)
    report = run_benchmark(combinations, dataset, tmp_path)
    assert (report.tracked, report.skipped) == (3, 9)
    assert box_files(tmp_path) == before
    decoded = {s.name: sum(s.frames.decoded.values()) for s in dataset}  # type: ignore[attr-defined]
    assert decoded == {"narrow": 0, "tall": 8, "wide": 8}


def test_an_enhanced_frame_is_made_once_and_its_cost_counts_for_each(
    night_clip: Path, tmp_path: Path
) -> None:
    calls = []

    @register_enhancer("slow_invert", override=True)
    class SlowInvert(Enhancer):
        card = Card(title="Slow", summary="For tests.")

        def enhance_batch(self, batch: Any) -> Any:
            calls.append(batch.shape)
            time.sleep(0.04)
            return 1 - batch

    trackers = ["still", "still@b", "still@c"]
    dataset = nat2024.load_dataset(night_clip).select(["wide"])
    run_benchmark(combine(trackers, ["slow_invert"], scope="frame"), dataset, tmp_path)
    assert len(calls) == 8
    folder = tmp_path / "night_clip"
    seconds = [RunFolder(folder / f"{t}+slow_invert").seconds("wide") for t in trackers]
    for one in seconds:
        np.testing.assert_array_equal(one[:, 1], seconds[0][:, 1])
        assert one[:, 1].min() > 0.04
        assert one.min() >= 0
        assert np.median(one[:, 2]) < 0.04  # what was enhanced for another is no tracking


def test_one_network_serves_a_tracker_with_every_enhancer(night_clip: Path, tmp_path: Path) -> None:
    trackers = Trackers()
    combinations = combine(
        ["siamrpnpp", "siamrpnpp@label", "siamrpnpp@openly"],
        ["none", "gamma", "clahe"],
        options={"siamrpnpp@openly": {"enhance_template": False}},
    )
    made: list[Any] = [trackers.get(one) for one in combinations]
    assert len({id(one) for one in made}) == 9
    assert [made.index(first) for first in made if first.model is made[0].model] == list(range(6))
    assert len({id(one.model) for one in made}) == 2
    [first] = [s for s in nat2024.load_dataset(night_clip) if s.name == "wide"]
    box = first.boxes[0]
    for one in made[:6]:  # all on their way at once
        one.init(first.frames[0], box)
    steps = [[one.update(first.frames[i])[0] for one in made[:6]] for i in range(1, 4)]
    for number in (0, 2, 4):
        alone, _ = combinations[number].create()
        alone.init(first.frames[0], box)
        for i in range(1, 4):
            np.testing.assert_array_equal(alone.update(first.frames[i])[0], steps[i - 1][number])


def test_crops_are_never_shared(night_clip: Path, tmp_path: Path) -> None:
    calls = []

    @register_enhancer("counting", override=True)
    class Counting(Enhancer):
        card = Card(title="Counting", summary="For tests.")

        def enhance_batch(self, batch: Any) -> Any:
            calls.append(batch.shape)
            return batch

    dataset = nat2024.load_dataset(night_clip).select(["wide"])
    run_benchmark(combine(["kcf", "kcf@b"], ["counting"], scope="patch"), dataset, tmp_path)
    assert len(calls) == 2 * (1 + 2 * 7)


class Painter(Tracker):
    """Writes into the frames that it is given, which nobody should."""

    card = Card(title="Painter", summary="For tests.", scopes=("frame",))

    def start(self, image: Any, box: Any) -> Any:
        self._box = box
        return self._seen(image)

    def advance(self, image: Any) -> Any:
        return self._seen(image), 1.0

    def _seen(self, image: Any) -> Any:
        mean = float(image.mean())
        image[: len(image) // 2] = 255
        return self._box + np.array([mean, 0, 0, 0])


@pytest.mark.parametrize("enhancer", ["none", "invert"])
def test_who_writes_into_frames_harms_nobody(
    night_clip: Path, tmp_path: Path, enhancer: str
) -> None:
    register_tracker("painter", override=True)(Painter)
    register_tracker("zebra", override=True)(type("Zebra", (Painter,), {}))
    trackers = ["painter", "still", "zebra"]
    dataset = nat2024.load_dataset(night_clip)
    run_benchmark(combine(trackers, [enhancer], scope="frame"), dataset, tmp_path / "together")
    for one in combine(trackers, [enhancer], scope="frame"):
        run_benchmark([one], dataset, tmp_path / "alone")
    assert box_files(tmp_path / "together") == box_files(tmp_path / "alone")


class Sleeper(Tracker):
    """Takes its time."""

    card = Card(title="Sleeper", summary="For tests.")

    def start(self, image: Any, box: Any) -> Any:
        return box

    def advance(self, image: Any) -> Any:
        time.sleep(0.03)
        return np.ones(4), 1.0


def test_who_takes_too_long_is_given_up_and_nobody_else(night_clip: Path) -> None:
    sequence = nat2024.load_dataset(night_clip)["wide"]
    still = combine(["still"], ["none"])[0].create()[0]
    slow, quick = track_together([Sleeper(), still], [sequence], Reading(timeout=0.1))
    assert isinstance(slow.result, TimedOut)
    assert "of 8: took longer than 0.1 s" in str(slow.result)
    assert isinstance(quick.result, Track)
    np.testing.assert_array_equal(quick.result.boxes, track_sequence(still, sequence).boxes)


def test_an_unreadable_frame_fails_all_or_is_skipped_by_all(
    night_clip: Path, tmp_path: Path
) -> None:
    import shutil

    copy = tmp_path / "copy"
    shutil.copytree(night_clip, copy)
    (copy / "data_seq" / "tall" / "00004.png").write_bytes(b"no image")
    dataset = nat2024.load_dataset(copy)
    combinations = combine(["still", "kcf"], ["none", "clahe"])
    report = run_benchmark(combinations, dataset, tmp_path / "error")
    assert sorted(f.run for f in report.failures) == ["kcf", "kcf+clahe", "still", "still+clahe"]
    assert {f.sequence for f in report.failures} == {"tall"}
    report = run_benchmark(combinations, dataset, tmp_path / "skip", on_bad_frame="skip")
    assert report.failures == ()
    for run in report.runs:
        folder = RunFolder(report.folder / run)
        assert folder.skipped_frames() == {"tall": [3]}
        boxes = folder.boxes("tall")
        np.testing.assert_array_equal(boxes[3], boxes[2])


def test_one_enhancer_serves_all_its_trackers(night_clip: Path, tmp_path: Path) -> None:
    made = []

    @register_enhancer("costly", override=True)
    class Costly(Enhancer):
        card = Card(title="Costly", summary="For tests.")

        def __init__(self, **common: Any) -> None:
            super().__init__(**common)
            made.append(self)

        def enhance_batch(self, batch: Any) -> Any:
            return batch

    dataset = nat2024.load_dataset(night_clip)
    run_benchmark(combine(["still", "kcf", "mosse"], ["costly"]), dataset, tmp_path)
    assert len(made) == 1


def test_shared_frames_are_few_and_belong_to_nobody() -> None:
    shared, made = SharedFrames(2), []

    def enhance() -> Any:
        made.append(1)
        return np.zeros((2, 2, 3), np.uint8), 0.5

    frames = [np.full((2, 2, 3), n, np.uint8) for n in range(3)]
    first, seconds = shared.get(frames[0], enhance)
    first[:] = 9
    again, told = shared.get(frames[0], enhance)
    assert (again.max(), told, seconds, len(made)) == (0, 0.5, 0.5, 1)
    for frame in frames[1:]:
        shared.get(frame, enhance)
    shared.get(frames[1], enhance)
    assert len(made) == 3
    shared.get(frames[0], enhance)  # was the one used longest ago
    assert len(made) == 4


def test_a_timed_enhancer_tells_cost_and_what_passed_here() -> None:
    class Slow(Enhancer):
        card = Card(title="Slow", summary="For tests.")

        def enhance_batch(self, batch: Any) -> Any:
            time.sleep(0.02)
            return batch

    shared = SharedFrames()
    one, two = (TimedEnhancer(Slow(), "cpu", shared) for _ in range(2))
    frame = np.zeros((8, 8, 3), np.uint8)
    one.enhance_frame(frame)
    two.enhance_frame(frame)
    made, found = one.take(), two.take()
    assert made.cost == found.cost
    assert made.here >= made.cost > 0.02 > found.here
    assert one.take() == (0.0, 0.0)
