"""Time the evaluation of published results against a per-threshold loop in pysot's form.

    python benchmarks/evaluate_speed.py PATH [--repeats N] [--json]

PATH is a zip or a folder that holds `anno/SEQUENCE.txt` and `results/TRACKER/SEQUENCE.txt`. All
files are read into memory first; both sides then start from the same bytes, in one process, and
end with the success, precision and normalised precision curves of every sequence. The curves are
checked to be equal before any time is printed; the two sides take turns.
"""

import argparse
import json
import statistics
import sys
import time
import zipfile
from pathlib import Path, PurePosixPath

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "benchmarks")]

from peers import pysot_form  # noqa: E402

from nat2024.boxes import parse_boxes  # noqa: E402
from nat2024.metrics import SequenceScores, evaluate_boxes, summarize  # noqa: E402

Texts = dict[str, bytes]


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


def main() -> None:
    """Check, measure, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("path", type=Path, help="zip or folder with anno/ and results/")
    parser.add_argument("--repeats", type=int, default=7)
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    arguments = parser.parse_args()
    truths, results = load(arguments.path)
    if not truths or not results:
        sys.exit(f"{arguments.path}: holds no anno/*.txt or no results/TRACKER/*.txt")
    check_equal(truths, results)
    sides = {"nat-bench": evaluate, "pysot form": pysot_form.evaluate}
    seconds: dict[str, list[float]] = {name: [] for name in sides}
    for _ in range(arguments.repeats):
        for name, side in sides.items():
            start = time.perf_counter()
            side(truths, results)
            seconds[name].append(time.perf_counter() - start)
    report(arguments.json, truths, results, seconds)


def report(
    as_json: bool, truths: Texts, results: dict[str, Texts], seconds: dict[str, list[float]]
) -> None:
    """Print best and median of each side and their ratio."""
    best = {name: min(times) for name, times in seconds.items()}
    median = {name: statistics.median(times) for name, times in seconds.items()}
    ratios = {
        "best": best["pysot form"] / best["nat-bench"],
        "median": median["pysot form"] / median["nat-bench"],
    }
    scores = {
        tracker: summarize(each.values()).as_dict()
        for tracker, each in evaluate(truths, results).items()
    }
    if as_json:
        print(json.dumps({"best_s": best, "median_s": median, "ratio": ratios}))
        return
    print(f"{len(truths)} sequences, {len(results)} trackers, equal in every value")
    for tracker, one in scores.items():
        print(f"  {tracker:24} {one['success_auc']:.4f} {one['precision_20']:.4f}")
    for name in seconds:
        print(f"{name:12} best {best[name]:7.3f} s   median {median[name]:7.3f} s")
    print(f"{'ratio':12} best {ratios['best']:7.1f}     median {ratios['median']:7.1f}")


if __name__ == "__main__":
    main()
