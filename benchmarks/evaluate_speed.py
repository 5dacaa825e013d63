"""Time the evaluation of published results against a per-threshold loop in pysot's form.

    python benchmarks/evaluate_speed.py PATH [--repeats N] [--json]
    python benchmarks/evaluate_speed.py --growth 10000

PATH is a zip or a folder that holds `anno/SEQUENCE.txt` and `results/TRACKER/SEQUENCE.txt`. Times
are CPU times of one process; the sides take turns. Measured are

* the curves (success, precision, normalised precision) of every sequence from the texts in memory,
  which are checked to be equal before any time is printed;
* `nat2024.evaluate` of the same files on disk, which scores under `strict` too and gathers its
  notes, with an empty cache, without a cache, and from the cache. All of these are compared with
  the curves alone in pysot's form;
* how much memory each tracker adds to what `nat2024.evaluate` gives.

`--growth N` evaluates up to N short result files, made for it, and prints the time of each file.
"""

import argparse
import json
import os
import statistics
import sys
import tempfile
import time
import tracemalloc
import zipfile
from collections.abc import Callable
from pathlib import Path, PurePosixPath

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "benchmarks")]

from peers import pysot_form  # noqa: E402

import nat2024  # noqa: E402
from nat2024.boxes import format_boxes, parse_boxes  # noqa: E402
from nat2024.evaluation.scorers import FOLDER  # noqa: E402
from nat2024.keeping import cache_folder  # noqa: E402
from nat2024.metrics import SequenceScores, evaluate_boxes, summarize  # noqa: E402
from nat2024.types import Dataset, Sequence  # noqa: E402

Texts = dict[str, bytes]
Times = dict[str, list[float]]

PEER, MEMORY = "pysot form", "curves"
FRESH, PLAIN, CACHED = "evaluate, empty cache", "evaluate, no cache", "evaluate, from cache"


def load(path: Path) -> tuple[Texts, dict[str, Texts]]:
    """Bytes of the annotation by sequence, and of the results by tracker and sequence."""
    if path.is_dir():
        names = sorted(p.relative_to(path).as_posix() for p in path.rglob("*.txt"))
        files = {name: (path / name).read_bytes() for name in names}
    else:
        with zipfile.ZipFile(path) as archive:
            names = sorted(n for n in archive.namelist() if n.endswith(".txt"))
            files = {name: archive.read(name) for name in names}
    truths: Texts = {}
    results: dict[str, Texts] = {}
    for name, data in files.items():
        match PurePosixPath(name).parts:
            case ("anno", _):
                truths[PurePosixPath(name).stem] = data
            case ("results", tracker, _):
                results.setdefault(tracker, {})[PurePosixPath(name).stem] = data
    return truths, results


def evaluate(truths: Texts, results: dict[str, Texts]) -> dict[str, dict[str, SequenceScores]]:
    """Scores by tracker and sequence, from text."""
    boxes = {name: parse_boxes(text, name) for name, text in truths.items()}
    return {
        tracker: {
            name: evaluate_boxes(parse_boxes(text, f"{tracker}/{name}"), boxes[name])
            for name, text in texts.items()
        }
        for tracker, texts in results.items()
    }


def check_equal(truths: Texts, results: dict[str, Texts]) -> None:
    """Leave with a message where any value of any curve differs."""
    ours, theirs = evaluate(truths, results), pysot_form.evaluate(truths, results)
    for tracker, scores in ours.items():
        for name, one in scores.items():
            curves = (one.success_curve, one.precision_curve, one.normalized_precision_curve)
            for mine, other in zip(curves, theirs[tracker][name], strict=True):
                if not np.array_equal(mine, other):
                    sys.exit(f"{tracker}/{name}: the curves differ")


def dataset_of(truths: Texts) -> Dataset:
    """The ground truth; its frames are never looked at."""
    boxes = {name: parse_boxes(text, name) for name, text in truths.items()}
    frames = {name: np.zeros(len(rows)) for name, rows in boxes.items()}
    return Dataset("measured", tuple(Sequence(n, frames[n], boxes[n]) for n in sorted(boxes)))


def store(results: dict[str, Texts], folder: Path) -> Path:
    """Write results as files."""
    for tracker, texts in results.items():
        (folder / tracker).mkdir(parents=True)
        for name, text in texts.items():
            (folder / tracker / f"{name}.txt").write_bytes(text)
    return folder


def forget() -> None:
    """Empty the cache of scores."""
    for file in (cache_folder() / FOLDER).glob("*"):
        file.unlink()


def seconds_of(work: Callable[[], object]) -> float:
    """CPU seconds of this process."""
    start = time.process_time()
    work()
    return time.process_time() - start


def measure(truths: Texts, results: dict[str, Texts], folder: Path, repeats: int) -> Times:
    """CPU seconds of all sides, which take turns."""
    files = store(results, folder / "measured")

    def scored(*, cache: bool = True) -> object:
        # the truth too is parsed each time, as it is on the other sides
        return nat2024.evaluate(files, dataset_of(truths), cache=cache).sequence_curves()

    seconds: Times = {name: [] for name in (PEER, MEMORY, PLAIN, FRESH, CACHED)}
    for _ in range(repeats):
        seconds[PEER].append(seconds_of(lambda: pysot_form.evaluate(truths, results)))
        seconds[MEMORY].append(seconds_of(lambda: evaluate(truths, results)))
        seconds[PLAIN].append(seconds_of(lambda: scored(cache=False)))
        forget()
        seconds[FRESH].append(seconds_of(scored))
        seconds[CACHED].append(seconds_of(scored))
    return seconds


def memory_of_a_run(truths: Texts, folder: Path) -> float:
    """Bytes that each tracker adds to the scores of the first; NaN where there is one only."""
    files, dataset = folder / "measured", dataset_of(truths)
    runs = sorted(path.name for path in files.iterdir())

    def held(some: list[str]) -> int:
        tracemalloc.start()
        kept = nat2024.evaluate(files, dataset, runs=some)
        found, _ = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        assert len(kept.runs) == len(some)
        return found

    held(runs)  # what is looked up once
    return (held(runs) - held(runs[:1])) / (len(runs) - 1) if len(runs) > 1 else float("nan")


def report(
    as_json: bool,
    truths: Texts,
    results: dict[str, Texts],
    seconds: dict[str, list[float]],
    memory: float,
) -> None:
    """Print best and median of each side and how many times as fast as the peer it is."""
    best = {name: min(times) for name, times in seconds.items()}
    median = {name: statistics.median(times) for name, times in seconds.items()}
    ratios = {name: (best[PEER] / best[name], median[PEER] / median[name]) for name in seconds}
    if as_json:
        found = {"best_s": best, "median_s": median, "times_as_fast": ratios}
        print(json.dumps({**found, "bytes_a_tracker": memory}))
        return
    print(f"{len(truths)} sequences, {len(results)} trackers, equal in every value")
    for tracker, each in evaluate(truths, results).items():
        one = summarize(each.values())
        print(f"  {tracker:24} {one.success_auc:.4f} {one.precision_20:.4f}")
    print(f"{'':24} best, ms   median, ms   times as fast: best   median")
    for name, (at_best, at_median) in ratios.items():
        own = f"{1000 * best[name]:8.1f}   {1000 * median[name]:10.1f}"
        print(f"{name:24} {own}   {at_best:19.1f}   {at_median:6.1f}")
    print(f"each tracker adds {memory / 2**20:.2f} MB")


def measure_growth(most: int, folder: Path) -> list[dict[str, float]]:
    """Milliseconds a file for more and more files, 20 sequences a run."""
    rng = np.random.default_rng(0)
    boxes = rng.integers(1, 200, (60, 4)).astype(float)
    names = [f"sequence{number:02}" for number in range(20)]
    truths = {name: format_boxes(boxes).encode() for name in names}
    dataset, rows = dataset_of(truths), []
    for count in (most // 8, most // 4, most // 2, most):
        shifted = [boxes + rng.integers(-9, 9, boxes.shape) for _ in range(max(1, count // 20))]
        texts = [format_boxes(one).encode() for one in shifted]
        runs = {f"run{n:05}": dict.fromkeys(names, text) for n, text in enumerate(texts)}
        files = store(runs, folder / f"growth{count}")
        times = [seconds_of(lambda files=files: nat2024.evaluate(files, dataset)) for _ in "ab"]
        total = len(runs) * len(names)
        each = [1000 * one / total for one in times]
        rows.append({"files": total, "new_ms": each[0], "cached_ms": each[1]})
    return rows


def main() -> None:
    """Check, measure, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("path", type=Path, nargs="?", help="zip or folder with anno/ and results/")
    parser.add_argument("--repeats", type=int, default=7)
    parser.add_argument("--growth", type=int, metavar="N", help="evaluate N made files instead")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    arguments = parser.parse_args()
    if (arguments.path is None) == (arguments.growth is None):
        parser.error("name either PATH or --growth N")
    with tempfile.TemporaryDirectory() as folder:
        os.environ["NAT2024_CACHE"] = str(Path(folder) / "cache")
        if arguments.growth is not None:
            rows = measure_growth(arguments.growth, Path(folder))
            if arguments.json:
                print(json.dumps({"growth": rows}))
                return
            print(f"{'files':>8}   new, ms a file   from cache, ms a file")
            for row in rows:
                print(f"{row['files']:8}   {row['new_ms']:14.3f}   {row['cached_ms']:21.3f}")
            return
        truths, results = load(arguments.path)
        if not truths or not results:
            sys.exit(f"{arguments.path}: holds no anno/*.txt or no results/TRACKER/*.txt")
        check_equal(truths, results)
        seconds = measure(truths, results, Path(folder), arguments.repeats)
        memory = memory_of_a_run(truths, Path(folder))
    report(arguments.json, truths, results, seconds, memory)


if __name__ == "__main__":
    main()
