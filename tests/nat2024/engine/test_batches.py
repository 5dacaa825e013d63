"""Sequences that advance in one forward: the boxes of each as if it were alone."""

import shutil
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

import nat2024
from nat2024 import Tracker, register_tracker
from nat2024.cards import Card
from nat2024.cli import run as nat_bench
from nat2024.engine import combine, run_benchmark
from nat2024.engine.methods import BatchMethod
from nat2024.engine.plan import Combination, PluginSpec
from nat2024.errors import NatBenchError, ResultConflict
from nat2024.store import RunFolder
from nat2024.types import Dataset

pytestmark = pytest.mark.usefixtures("small_plugins")


def unequal(folder: Path, lengths: tuple[int, ...] = (4, 2, 3)) -> Dataset:
    """The sequences of a dataset, cut to these lengths."""
    dataset = nat2024.load_dataset(folder)
    cut = [
        replace(s, frames=s.frames.cut(n), boxes=s.boxes[:n])  # type: ignore[attr-defined]
        for s, n in zip(dataset, lengths, strict=True)
    ]
    return replace(dataset, sequences=tuple(cut))


@pytest.mark.parametrize(
    ("tracker", "enhancer", "scope"),
    [
        (PluginSpec("siamrpnpp"), PluginSpec("ldenhancer"), "patch"),
        (PluginSpec("siamrpnpp"), PluginSpec("dcepp"), "frame"),
        (PluginSpec("nanotrack", weights=False), PluginSpec("clahe"), "patch"),
        pytest.param(PluginSpec("hift", weights=False), None, "patch", marks=pytest.mark.slow),
        pytest.param(PluginSpec("siamapnpp", weights=False), None, "patch", marks=pytest.mark.slow),
    ],
    ids=lambda value: getattr(value, "name", str(value)),
)
def test_the_same_boxes_as_alone(
    night_clip: Path, tmp_path: Path, tracker: PluginSpec, enhancer: Any, scope: str
) -> None:
    dataset = unequal(night_clip)
    chosen = replace(tracker, options={**tracker.options, "scope": scope})
    for batch in (1, 3):
        torch.manual_seed(0)  # of the networks that are drawn at random
        one = Combination(chosen, enhancer)
        report = run_benchmark([one], dataset, tmp_path / str(batch), batch=batch)
        assert report.failures == ()
    for sequence in dataset:
        alone, together = (
            RunFolder(tmp_path / str(batch) / "night_clip" / one.run) for batch in (1, 3)
        )
        boxes = together.boxes(sequence.name)
        np.testing.assert_allclose(boxes, alone.boxes(sequence.name), rtol=0, atol=1e-3)
        assert len(boxes) == len(sequence)
        assert together.seconds(sequence.name)[1:, 2].min() > 0
        if enhancer:
            assert together.seconds(sequence.name)[:, 1].min() > 0
    manifest = together.manifest()
    assert manifest is not None
    assert manifest.batch == 3


@dataclass(frozen=True)
class Step:
    target: Any
    score: float

    @property
    def box(self) -> Any:
        return self.target


class Together(Tracker):
    """Moves by the brightness of its frame; fails in the fifth frame of a wide target."""

    card = Card(title="Together", summary="For tests.", scopes=("frame",))
    widths: list[int]
    wide = 20.0

    def start(self, image: Any, box: Any) -> Any:
        self._state = self.begin(image, box)
        return self._state[1]

    def advance(self, image: Any) -> Any:
        [step] = self.update_many([image], [self._state[0]], [self._state[1]])
        self._state = self._state[0], step.target
        return step.box, step.score

    def begin(self, image: Any, box: Any) -> Any:
        return float(image.mean()), np.array(box)

    def update_many(self, images: Any, firsts: Any, targets: Any) -> Any:
        type(self).widths.append(len(images))
        moved = [
            target + [image.mean() - first, 0, 0, 0]
            for image, first, target in zip(images, firsts, targets, strict=True)
        ]
        if any(box[2] > self.wide and len(type(self).widths) > 4 for box in moved):
            message = "lost its mind"
            raise ValueError(message)
        return [Step(box, 1.0) for box in moved]


@pytest.fixture
def together() -> type[Together]:
    cls: type[Together] = register_tracker("together", override=True)(
        type("Fresh", (Together,), {"widths": []})
    )
    return cls


def test_a_failure_costs_only_its_own_sequence(
    night_clip: Path, tmp_path: Path, together: type[Together]
) -> None:
    dataset = nat2024.load_dataset(night_clip)
    report = run_benchmark(combine(["together"], ["none"]), dataset, tmp_path, batch=3)
    [failure] = report.failures
    assert (failure.sequence, failure.reason) == ("wide", "frame 6 of 8: ValueError: lost its mind")
    # four frames of three; the fifth fails and is done one by one; three frames of two
    assert together.widths == [3, 3, 3, 3, 3, 1, 1, 1, 2, 2]
    plain = combine(["together@alone"], ["none"])
    run_benchmark(plain, dataset.select(["narrow", "tall"]), tmp_path)
    for name in ("narrow", "tall"):
        alone = RunFolder(tmp_path / "night_clip" / "together@alone").box_file(name)
        batched = RunFolder(tmp_path / "night_clip" / "together").box_file(name)
        assert alone.read_bytes() == batched.read_bytes()


def various(folder: Path, lengths: tuple[int, ...]) -> Dataset:
    """A sequence for each length, cut out of those of a dataset."""
    dataset = nat2024.load_dataset(folder)
    cut = []
    for number, length in enumerate(lengths):
        whole = dataset.sequences[number % len(dataset)]
        frames = whole.frames.cut(length)  # type: ignore[attr-defined]
        cut.append(replace(whole, name=f"s{number}", frames=frames, boxes=whole.boxes[:length]))
    return replace(dataset, sequences=tuple(cut))


def test_a_lane_that_is_free_takes_the_next_sequence(
    night_clip: Path, tmp_path: Path, together: type[Together]
) -> None:
    together.wide = 1000  # none fails
    dataset = various(night_clip, (2, 8, 1, 5, 2, 7, 1))
    combinations = combine(["together", "together@b"], ["none", "invert"], scope="frame")
    for batch in (1, 3):
        together.widths.clear()
        report = run_benchmark(combinations, dataset, tmp_path / str(batch), batch=batch)
        assert (report.tracked, report.failures) == (28, ())
    # the longest first: 8, 7 and 5 frames; then 2, 2, 1 and 1 follow the one of 5, later the others
    moves = [width for width in together.widths for _ in range(width)]
    assert len(moves) == 4 * sum(len(s) - 1 for s in dataset)
    assert together.widths[::4] == [3, 3, 3, 3, 3, 3, 1]
    for run in (one.run for one in combinations):
        folders = [RunFolder(tmp_path / f"{batch}/night_clip/{run}") for batch in (1, 3)]
        for sequence in dataset:
            alone, batched = (folder.box_file(sequence.name) for folder in folders)
            assert alone.read_bytes() == batched.read_bytes()
            assert len(folders[1].seconds(sequence.name)) == len(sequence)


def test_one_that_cannot_start_leaves_its_lane_at_once(
    night_clip: Path, tmp_path: Path, together: type[Together]
) -> None:
    together.wide = 1000
    dataset = various(night_clip, (8, 7, 6, 5))
    broken = replace(dataset.sequences[1], boxes=np.full((7, 4), np.nan))
    dataset = replace(dataset, sequences=(dataset.sequences[0], broken, *dataset.sequences[2:]))
    report = run_benchmark(combine(["together"], ["none"]), dataset, tmp_path, batch=2)
    [failure] = report.failures
    assert failure.sequence == "s1"
    assert "frame 1 of 7" in failure.reason
    assert together.widths == [2] * 7 + [1] * 2


def test_what_ended_is_forgotten(together: type[Together]) -> None:
    method, image = BatchMethod(together()), np.zeros((9, 9, 3), np.uint8)
    method.start({number: (image, np.array([1.0, 2, 3, 4])) for number in range(2)})
    method.end(0)
    method.end(0)
    assert set(method.advance({1: image})) == {1}
    assert isinstance(method.advance({0: image})[0], NatBenchError)


def test_a_resumed_run_fills_its_lanes_with_what_is_missing(
    night_clip: Path, tmp_path: Path, together: type[Together]
) -> None:
    together.wide = 1000
    dataset = various(night_clip, (2, 8, 4, 6))
    combinations = combine(["together"], ["none"])
    run_benchmark(combinations, dataset, tmp_path, batch=2)
    folder = RunFolder(tmp_path / "night_clip" / "together")
    before = {name: folder.box_file(name).read_bytes() for name in folder.finished()}
    for name in ("s0", "s2", "s3"):
        folder.box_file(name).unlink()
    together.widths.clear()
    assert run_benchmark(combinations, dataset, tmp_path, batch=2).tracked == 3
    assert together.widths == [2] * 4 + [1]
    assert {name: folder.box_file(name).read_bytes() for name in folder.finished()} == before


def test_bad_frames_in_a_batch(night_clip: Path, tmp_path: Path, together: type[Together]) -> None:
    copy = tmp_path / "copy"
    shutil.copytree(night_clip, copy)
    (copy / "data_seq" / "tall" / "00003.png").write_bytes(b"no image")
    dataset = nat2024.load_dataset(copy).select(["narrow", "tall"])
    combinations = combine(["together"], ["none"])
    report = run_benchmark(combinations, dataset, tmp_path / "error", batch=2)
    [failure] = report.failures
    assert failure.sequence == "tall"
    assert "00003.png" in failure.reason
    assert together.widths == [2] + [1] * 6
    for batch in (1, 2):
        results = tmp_path / f"skip{batch}"
        run_benchmark(combinations, dataset, results, batch=batch, on_bad_frame="skip")
        folder = RunFolder(results / "copy" / "together")
        assert folder.skipped_frames() == {"tall": [2]}
    files = [(tmp_path / f"skip{b}/copy/together/tall.txt").read_bytes() for b in (1, 2)]
    assert files[0] == files[1]


def test_who_cannot_goes_alone_and_it_is_said(
    night_clip: Path, tmp_path: Path, together: type[Together], caplog: pytest.LogCaptureFixture
) -> None:
    dataset = unequal(night_clip)
    caplog.set_level("INFO", "nat2024")
    report = run_benchmark(combine(["together", "still"], ["none"]), dataset, tmp_path, batch=2)
    assert report.tracked == 6
    assert "still takes one sequence at a time, whatever --batch says" in caplog.messages
    manifests = [RunFolder(report.folder / run).manifest() for run in ("together", "still")]
    assert [m.batch for m in manifests if m] == [2, 1]
    assert run_benchmark(combine(["still"], ["none"]), dataset, tmp_path).skipped == 3
    with pytest.raises(ResultConflict, match=r"batch 2 \(now 1\)"):
        run_benchmark(combine(["together"], ["none"]), dataset, tmp_path)


def test_from_the_command_line(night_clip: Path, tmp_path: Path) -> None:
    words = ["run", "--tracker", "siamrpnpp", "--dataset", str(night_clip), "--device", "cpu"]
    words += ["--results", str(tmp_path), "--sequences", "tall,wide", "--batch", "2"]
    words += ["--backend", "torch"]
    assert nat_bench(words) == 0
    folder = RunFolder(tmp_path / "night_clip" / "siamrpnpp")
    manifest = folder.manifest()
    assert manifest is not None
    assert manifest.batch == 2
    assert folder.finished() == ["tall", "wide"]
