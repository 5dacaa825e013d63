"""Kept scores are those that would be computed, to the last bit, or are computed anew."""

import shutil
import subprocess
import sys
import tracemalloc
import zipfile
from collections import Counter
from collections.abc import Iterator
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import nat2024
from nat2024.errors import ArrayContract, BoxFileError, LengthMismatch
from nat2024.evaluation import Evaluation, scorers
from nat2024.metrics import SCORE_NAMES, FrameValues, Protocol, list_protocols
from nat2024.metrics.scores import CURVE_LENGTHS, ROW_LENGTH
from nat2024.types import Dataset, Sequence


class Frames:
    """Frames that nobody looks at."""

    frame_size = (100, 80)

    def __init__(self, count: int) -> None:
        self.count = count

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, index: int) -> np.ndarray:
        raise IndexError(index)


def walk(seed: int, count: int = 40) -> np.ndarray:
    """Boxes that move about and come to lie on thresholds, some of them odd."""
    rng = np.random.default_rng(seed)
    boxes = np.concatenate([rng.integers(5, 60, (count, 2)), rng.integers(4, 30, (count, 2))], 1)
    return boxes + rng.choice([0.0, 0.25, 1 / 3], (count, 4))


@pytest.fixture
def dataset() -> Dataset:
    keyed = walk(3)
    keyframes = np.arange(0, 40, 5)
    keyed[np.setdiff1d(np.arange(40), keyframes)] = np.nan
    flagged = Sequence("flagged", Frames(40), walk(2), visible=np.arange(40) % 7 != 3)
    return Dataset(
        "clip",
        (
            flagged,
            Sequence("keyed", Frames(40), keyed, keyframes=keyframes),
            Sequence("plain", Frames(40), walk(1)),
        ),
    )


@pytest.fixture
def results(tmp_path: Path) -> Path:
    folder = tmp_path / "results"
    for number, run in enumerate(("mil", "mil+gamma")):
        for seed, name in enumerate(("plain", "flagged", "keyed"), 1):
            boxes = walk(seed) + np.random.default_rng(number).normal(0, 3, (40, 4)).round(2)
            boxes[:, 2:] = np.maximum(boxes[:, 2:], 1)  # pytracking refuses others
            nat2024.write_boxes(folder / run / f"{name}.txt", boxes)
    return folder


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("NAT2024_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache" / scorers.FOLDER


@pytest.fixture
def computed(monkeypatch: pytest.MonkeyPatch) -> Iterator[Counter[str]]:
    """How many results were really scored, by protocol."""
    found: Counter[str] = Counter()
    really = scorers.measure_rows

    def counted(given: Any, pair: Any) -> Any:
        found[pair.protocol.name] += len(given)
        return really(given, pair)

    monkeypatch.setattr(scorers, "measure_rows", counted)
    return found


def bits(evaluation: Evaluation, *, frames: bool = True) -> dict[tuple[str, ...], Any]:
    """Every number of an evaluation, as bytes."""
    names = (*CURVE_LENGTHS, *SCORE_NAMES)
    more = tuple(one.name for one in fields(FrameValues)) if frames else ()
    plain = ("name", "frames", "rows", "invalid_truth", "bad_results", "length_predicted")
    found: dict[tuple[str, ...], Any] = {}
    for run in evaluation.runs:
        found[run.run, "strict"] = np.float64(run.strict_success).tobytes()
        found[run.run, "first rows"] = repr(run.foreign and run.foreign.first_rows)
        for sequence, scores in run.sequences.items():
            for name in (*names, *more):
                value = np.asarray(getattr(scores, name))
                found[run.run, sequence, name] = (value.dtype.str, value.tobytes())
            for name in plain:
                found[run.run, sequence, name] = getattr(scores, name)
    return found


VARIANTS = [
    *map(Protocol, list_protocols()),
    Protocol("pytracking", label="uav", exclude_invalid=True, invalid_rule="size"),
    Protocol("got10k-ope", invalid_rule="none"),
    Protocol("got10k-ao", frame_size=(50, 40)),
]


@pytest.mark.parametrize("protocol", VARIANTS, ids=lambda one: one.title)
@pytest.mark.parametrize("on_length", [None, "cut"])
def test_equal_in_every_bit(
    results: Path,
    dataset: Dataset,
    cache: Path,
    computed: Counter[str],
    protocol: Protocol,
    on_length: str | None,
) -> None:
    def evaluated(**options: bool) -> Evaluation:
        return nat2024.evaluate(results, dataset, protocol=protocol, on_length=on_length, **options)

    without = evaluated(cache=False)
    assert not cache.exists()
    direct = bits(without)
    first, second = bits(evaluated()), evaluated()
    computed.clear()
    assert bits(evaluated(), frames=False) == bits(second, frames=False)
    assert not computed
    assert direct == first == bits(second)
    assert without.summary().equals(second.summary())
    assert without.runs[0].sequences["plain"].protocol == second.runs[0].sequences["plain"].protocol


@pytest.mark.parametrize("rows", [1, 50, 10**9])
@pytest.mark.parametrize("protocol", VARIANTS, ids=lambda one: one.title)
def test_however_many_are_scored_at_once(
    results: Path, dataset: Dataset, protocol: Protocol, rows: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(scorers, "_MOST_ROWS", rows)
    found = nat2024.evaluate(results, dataset, protocol=protocol, cache=False)
    for run in found.runs:
        assert list(run.sequences) == ["flagged", "keyed", "plain"]
        for name, scores in run.sequences.items():
            sequence = dataset[name]
            kept = slice(None) if sequence.keyframes is None else sequence.keyframes
            direct = nat2024.evaluate_boxes(
                nat2024.read_boxes(results / run.run / f"{name}.txt")[kept],
                sequence.boxes[kept],
                visible=None if sequence.visible is None else sequence.visible[kept],
                protocol=scores.protocol,
            )
            for one in (*SCORE_NAMES, *CURVE_LENGTHS, *FRAME_NAMES):
                np.testing.assert_array_equal(getattr(scores, one), getattr(direct, one))


def test_what_is_refused_among_many_is_named(results: Path, dataset: Dataset) -> None:
    file = results / "mil+gamma" / "keyed.txt"
    boxes = nat2024.read_boxes(file)
    boxes[5, 2] = -1
    nat2024.write_boxes(file, boxes)
    with pytest.raises(ArrayContract, match=r"gamma/keyed\.txt: predicted, row 2: NaN or negative"):
        nat2024.evaluate(results, dataset, protocol="pytracking")


def nan_row(boxes: np.ndarray) -> np.ndarray:
    changed = boxes.copy()
    changed[7] = np.nan
    return changed


def nudged(boxes: np.ndarray) -> np.ndarray:
    changed = boxes.copy()
    changed[7, 2] = np.nextafter(changed[7, 2], np.inf)
    return changed


TRUTHS = {
    "a box": lambda s: replace(s, boxes=nudged(s.boxes)),
    "a NaN": lambda s: replace(s, boxes=nan_row(s.boxes)),
    "flags": lambda s: replace(s, visible=np.ones(40, dtype=bool)),
    "one flag": lambda s: replace(s, visible=np.arange(40) != 9),
    "keyframes": lambda s: replace(s, keyframes=np.arange(0, 40, 2)),
}


@pytest.mark.parametrize("change", TRUTHS.values(), ids=TRUTHS)
def test_another_truth_is_scored_anew(
    results: Path, dataset: Dataset, cache: Path, computed: Counter[str], change: Any
) -> None:
    nat2024.evaluate(results, dataset)
    changed = tuple(change(s) if s.name == "plain" else s for s in dataset.sequences)
    other = replace(dataset, sequences=changed)
    computed.clear()
    found = nat2024.evaluate(results, other)
    assert computed == {"pysot": 2}  # one sequence of two runs
    assert bits(found) == bits(nat2024.evaluate(results, other, cache=False))


def test_another_result_is_scored_anew(
    results: Path, dataset: Dataset, cache: Path, computed: Counter[str]
) -> None:
    nat2024.evaluate(results, dataset)
    file = results / "mil" / "plain.txt"
    for change in (nudged, nan_row):
        old = nat2024.read_boxes(file)
        nat2024.write_boxes(file, change(old))
        computed.clear()
        found = nat2024.evaluate(results, dataset)
        assert computed == {"pysot": 1}
        assert bits(found) == bits(nat2024.evaluate(results, dataset, cache=False))
    computed.clear()
    nat2024.write_boxes(file, old)  # the one before is still known
    nat2024.evaluate(results, dataset)
    assert not computed


def test_other_rules_and_other_code_are_scored_anew(
    results: Path,
    dataset: Dataset,
    cache: Path,
    computed: Counter[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def count(**options: Any) -> int:
        computed.clear()
        nat2024.evaluate(results, dataset, **options)
        return computed.total()

    assert count() == 6
    assert count() == 0
    assert count(protocol="strict") == 6
    assert count(on_length="pad") == 6
    assert count(protocol=Protocol("got10k-ope")) == 6
    assert count(protocol=Protocol("got10k-ope", invalid_rule="none")) == 6
    assert count(protocol="got10k-ao") == 6
    monkeypatch.setattr(Frames, "frame_size", (90, 80))
    assert count(protocol="got10k-ao") == 6
    assert count(protocol="otb") == 6
    monkeypatch.setattr(scorers, "computation", lambda: "another version")
    assert count(protocol="otb") == 6


def test_the_code_is_told_by_its_text(monkeypatch: pytest.MonkeyPatch) -> None:
    scorers.computation.cache_clear()
    before = scorers.computation()
    read = Path.read_bytes

    def edited(path: Path) -> bytes:
        return read(path) + (b"#" if path.name == "toolkits.py" else b"")

    monkeypatch.setattr(Path, "read_bytes", edited)
    scorers.computation.cache_clear()
    assert scorers.computation() != before
    monkeypatch.undo()
    scorers.computation.cache_clear()
    assert scorers.computation() == before


def test_damage_and_deletion_cost_time_only(
    results: Path, dataset: Dataset, cache: Path, computed: Counter[str]
) -> None:
    wanted = bits(nat2024.evaluate(results, dataset))
    kept = sorted(cache.iterdir())
    assert len(kept) == 2  # one a run
    raw = kept[0].read_bytes()
    for damaged in (b"", raw[:-5], raw[:99] + b"?" + raw[100:]):
        kept[0].write_bytes(damaged)
        computed.clear()
        assert bits(nat2024.evaluate(results, dataset), frames=False) == {
            key: value for key, value in wanted.items() if key[-1] not in FRAME_NAMES
        }
        assert computed.total() == 3
    shutil.rmtree(cache.parent)
    assert bits(nat2024.evaluate(results, dataset)) == wanted


FRAME_NAMES = {one.name for one in fields(FrameValues)}


def test_a_cache_that_cannot_be_written(
    results: Path, dataset: Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("NAT2024_CACHE", str(tmp_path / "file"))
    wanted = bits(nat2024.evaluate(results, dataset, cache=False))
    assert bits(nat2024.evaluate(results, dataset)) == wanted


def test_archives_are_kept_too_and_left_as_they_are(
    results: Path, dataset: Dataset, tmp_path: Path, cache: Path, computed: Counter[str]
) -> None:
    archive = tmp_path / "all.zip"
    with zipfile.ZipFile(archive, "w") as opened:
        for file in sorted(results.rglob("*.txt")):
            opened.write(file, file.relative_to(results.parent).as_posix())
    before = archive.read_bytes(), sorted(results.parent.rglob("*.txt"))
    first = nat2024.evaluate(archive, dataset)
    computed.clear()
    again = nat2024.evaluate(archive, dataset)
    assert not computed
    assert bits(first) == bits(again)
    assert before == (archive.read_bytes(), sorted(results.parent.rglob("*.txt")))


def test_refusals_are_never_kept(results: Path, dataset: Dataset, cache: Path) -> None:
    nat2024.evaluate(results, dataset)
    file = results / "mil" / "plain.txt"
    nat2024.write_boxes(file, nat2024.read_boxes(file)[:-1])
    for _ in range(2):
        with pytest.raises(LengthMismatch, match=r"39 rows"):
            nat2024.evaluate(results, dataset)


def test_frames_of_a_file_that_has_changed(results: Path, dataset: Dataset, cache: Path) -> None:
    scores = nat2024.evaluate(results, dataset).runs[0].sequences["plain"]
    assert len(scores.overlap) == scores.rows == 40
    file = results / "mil" / "plain.txt"
    nat2024.write_boxes(file, nudged(nat2024.read_boxes(file)))
    with pytest.raises(BoxFileError, match="has changed since it was evaluated"):
        _ = scores.center_error
    file.unlink()
    with pytest.raises(BoxFileError, match=r"plain\.txt"):
        _ = scores.center_error


OFTEN = """
import sys
import numpy as np
import nat2024
from nat2024.types import Dataset, Sequence

results, count = sys.argv[1], int(sys.argv[2])
truth = nat2024.read_boxes(results + "/mil/plain.txt")
both = [Sequence(name, np.zeros(40), truth) for name in ("flagged", "plain")]
for number in range(count):
    chosen = both[number % 2 :] if number % 3 else both
    frame = nat2024.evaluate(results, Dataset("clip", tuple(chosen))).per_sequence()
    print(frame.to_json(double_precision=15))
"""


def test_processes_do_not_hurt_each_other(results: Path, cache: Path) -> None:
    command = [sys.executable, "-c", OFTEN, str(results), "12"]
    started = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    found = [process.communicate(timeout=60)[0] for process in started]
    assert found[0] == found[1]
    assert len(found[0].splitlines()) == 12
    shutil.rmtree(cache)
    alone = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True, timeout=60)
    assert alone.stdout == found[0]
    assert not list(cache.glob(".*"))


def many_runs(folder: Path, count: int, rows: int) -> Dataset:
    boxes = walk(1, rows)
    for number in range(count):
        nat2024.write_boxes(folder / f"run{number:04}" / "one.txt", boxes + number % 7)
    return Dataset("clip", (Sequence("one", Frames(rows), boxes),))


@pytest.mark.parametrize("use_cache", [False, True])
def test_memory_does_not_grow_with_the_frames_of_all_runs(
    tmp_path: Path, cache: Path, use_cache: bool
) -> None:
    dataset = many_runs(tmp_path / "r", 16, 2500)
    names = [f"run{number:04}" for number in range(16)]

    def measure(runs: list[str]) -> tuple[int, int]:
        tracemalloc.start()
        kept = nat2024.evaluate(tmp_path / "r", dataset, cache=use_cache, runs=runs)
        held, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        assert len(kept.runs) == len(runs)
        return held, peak

    measure(names)  # what is imported and looked up once
    few, many = measure(names[:2]), measure(names)
    values_of_one = 2500 * 3 * 8
    assert many[0] - few[0] < 2 * values_of_one  # 14 if they were held
    assert many[1] - few[1] < 2 * values_of_one


@pytest.mark.parametrize("use_cache", [False, True])
def test_a_run_adds_little_more_than_its_numbers(
    tmp_path: Path, cache: Path, use_cache: bool
) -> None:
    rows, sequences, runs = 300, 30, 12
    boxes = walk(1, rows)
    names = [f"sequence{number:02}" for number in range(sequences)]
    text = nat2024.boxes.format_boxes(boxes + 1)
    for run in range(runs):
        (tmp_path / "r" / f"run{run:02}").mkdir(parents=True)
        for name in names:
            (tmp_path / "r" / f"run{run:02}" / f"{name}.txt").write_text(text)
    dataset = Dataset("clip", tuple(Sequence(name, Frames(rows), boxes) for name in names))
    chosen = [f"run{number:02}" for number in range(runs)]

    def held(some: list[str]) -> int:
        tracemalloc.start()
        kept = nat2024.evaluate(tmp_path / "r", dataset, cache=use_cache, runs=some)
        found, _ = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        assert [run.run for run in kept.runs] == some
        return found

    for _ in "ab":  # what is looked up once, and what is kept
        held(chosen)
    growth = (held(chosen) - held(chosen[:2])) / (runs - 2) / sequences
    assert 8 * ROW_LENGTH < growth < 2 * 8 * ROW_LENGTH  # values of the frames: 7200 bytes more


def test_work_grows_with_the_number_of_files_only(
    tmp_path: Path, cache: Path, computed: Counter[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    reads: Counter[str] = Counter()
    load = scorers.results_of

    def counted(run: Any, sequence: str) -> Any:
        reads["files"] += 1
        return load(run, sequence)

    monkeypatch.setattr("nat2024.evaluation.scoring.results_of", counted)
    for count in (20, 40):
        dataset = many_runs(tmp_path / str(count), count, 3)
        reads.clear()
        computed.clear()
        nat2024.evaluate(tmp_path / str(count), dataset)
        assert reads["files"] == count
        assert computed.total() == count


def test_old_scores_go_where_there_are_too_many(
    results: Path, dataset: Dataset, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    nat2024.evaluate(results, dataset)
    size = next(cache.iterdir()).stat().st_size
    monkeypatch.setattr(scorers, "MOST_BYTES", 5 * size)
    nat2024.evaluate(results, dataset, protocol="otb")
    nat2024.evaluate(results, dataset, protocol="lasot")
    assert sum(one.stat().st_size for one in cache.iterdir()) <= 5 * size
