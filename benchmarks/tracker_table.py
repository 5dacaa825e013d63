"""Success and speed of the weight-free trackers and of NanoTrack on a folder of sequences.

    python benchmarks/tracker_table.py DATASET [--nanotrack FOLDER] [--sequences A,B] [--only a,b]
        [--times 3] [--json] [--update docs/trackers-measured.md]

Every tracker runs alone, on one thread, over all sequences that have ground truth, `--times` times
where it is not repeatable. Success is the area under the curve under the protocol `pysot`; frames
a second are all frames but the first of each sequence over the processor time that the tracker took
for them, which on one thread is the time of the clock where nothing else runs; reading is left out.
FOLDER holds the published files of NanoTrack: `nanotrackv1.pth` and the like, and
both ONNX files of each version. The table goes to standard output, and with `--update` between the
markers of a page.
"""

import argparse
import statistics
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from side_by_side import report

MARKERS = ("<!-- tracker table: begin -->", "<!-- tracker table: end -->")
WEIGHT_FREE = ("fdsst", "kcf", "mosse", "mil")
NAMES = {
    **{f"nanotrack {v}": ("nanotrack", {"variant": v}) for v in ("v1", "v2", "v3")},
    **{
        f"nanotrack {v}, runtime=opencv": ("nanotrack", {"variant": v, "runtime": "opencv"})
        for v in ("v1", "v2", "v3")
    },
    **{f"opencv_nano {v}": ("opencv_nano", {"variant": v}) for v in ("v1", "v2")},
}


@dataclass(frozen=True)
class Measured:
    """One line of the table.

    Attributes:
        tracker: its name, with what it was created with.
        times: how often it ran over all sequences.
        success_auc: mean over times of each sequence, in the order of the dataset.
        frames_per_second: median over times.
    """

    tracker: str
    times: int
    success_auc: tuple[float, ...]
    frames_per_second: float

    @property
    def mean(self) -> float:
        """Mean success over the sequences."""
        return statistics.mean(self.success_auc)

    def row(self, reference: float) -> str:
        """The line in Markdown; speed also as a multiple of `reference` frames a second."""
        fields = [
            f"`{self.tracker}`" + (f", mean of {self.times} runs" if self.times > 1 else ""),
            *(f"{value:.3f}" for value in self.success_auc),
            f"**{self.mean:.3f}**",
            f"{self.frames_per_second:,.0f}",
            f"{self.frames_per_second / reference:.2f}",
        ]
        return "| " + " | ".join(fields) + " |"


def header(sequences: Sequence[str]) -> str:
    """The head of the table."""
    names = ["tracker", *sequences, "mean", "frames/s", "times `kcf`"]
    ruler = ["---", *["---:"] * (len(names) - 1)]
    return "\n".join("| " + " | ".join(fields) + " |" for fields in (names, ruler))


def create(title: str, folder: Path | None) -> Any:
    """The tracker of a line; None where it needs files and no folder is given."""
    from nat2024.registry import create_tracker

    if title in WEIGHT_FREE:
        return create_tracker(title)
    if folder is None:
        return None
    name, options = NAMES[title]
    weights = folder
    if name == "nanotrack" and "runtime" not in options:
        weights = folder / f"nanotrack{options['variant']}.pth"
    return create_tracker(name, weights=weights, **options)


def run_once(tracker: Any, sequences: Sequence[Any]) -> tuple[list[float], float]:
    """Success on each sequence, and frames a second over all."""
    from nat2024 import evaluate_boxes

    scores, frames, seconds = [], 0, 0.0
    for sequence in sequences:
        rows = [tracker.init(sequence.image(0), sequence.boxes[0])]
        for number in range(1, len(sequence)):
            image = sequence.image(number)
            start = time.process_time()
            row, _ = tracker.update(image)
            seconds += time.process_time() - start
            rows.append(row)
        scores.append(evaluate_boxes(rows, sequence.boxes).success_auc)
        frames += len(rows) - 1
    return scores, frames / seconds


def measure(
    titles: Sequence[str], sequences: Sequence[Any], folder: Path | None, times: int
) -> Iterator[Measured]:
    """Measure one tracker after the other, each on one thread."""
    from nat2024.engine.workers import computing_threads

    with computing_threads(1):
        for title in titles:
            tracker = create(title, folder)
            if tracker is None:
                print(f"{title}: left out, it needs --nanotrack FOLDER", file=sys.stderr)
                continue
            count = 1 if tracker.card.repeatable else times
            runs = [run_once(tracker, sequences) for _ in range(count)]
            columns = zip(*(scores for scores, _ in runs), strict=True)
            yield Measured(
                title,
                count,
                tuple(statistics.mean(column) for column in columns),
                statistics.median(rate for _, rate in runs),
            )


def chosen_titles(only: str) -> list[str]:
    """All lines, or those that begin with one of the names in `only`."""
    known = [*WEIGHT_FREE, *NAMES]
    if not only:
        return known
    found = [title for title in known if title.split()[0] in only.split(",")]
    if not found:
        sys.exit(f"--only {only}: no such tracker; there are {', '.join(known)}")
    return found


def main() -> None:
    """Measure, print, and update a page."""
    from nat2024 import NatBenchError, load_dataset

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("dataset", help="a folder of sequences with ground truth, or a name")
    parser.add_argument("--nanotrack", type=Path, help="folder of the published files")
    parser.add_argument("--sequences", default="", help="names, with commas; all where left out")
    parser.add_argument("--only", default="", help="names of trackers, with commas")
    parser.add_argument("--times", type=int, default=3, help="runs of what is not repeatable")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--update", type=Path, help="page whose table to replace")
    given = parser.parse_args()
    titles = chosen_titles(given.only)
    try:
        dataset = load_dataset(given.dataset)
        names = given.sequences.split(",") if given.sequences else [s.name for s in dataset]
        sequences = [dataset[name] for name in names]
        results = []
        for result in measure(titles, sequences, given.nanotrack, given.times):
            print(f"{result.tracker}: {result.mean:.3f}", file=sys.stderr)
            results.append(result)
    except NatBenchError as error:
        sys.exit(str(error))
    by_name = {result.tracker: result for result in results}
    reference = by_name.get("kcf", results[0]).frames_per_second
    report(
        header(names),
        [result.row(reference) for result in results],
        [{**asdict(result), "mean": result.mean} for result in results],
        as_json=given.json,
        page=given.update,
        markers=MARKERS,
    )


if __name__ == "__main__":
    main()
