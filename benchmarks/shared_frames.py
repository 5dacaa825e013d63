"""Combinations on one decoded stream, beside each on a stream of its own.

    python benchmarks/shared_frames.py [--sizes 960x540,1920x1080] [--tracker mosse] [--json]

tracks one rendered JPEG sequence by the trackers named with the enhancers named, all combinations
frame by frame together as `nat-bench run` does, and one after another as separate commands would,
and prints the seconds of both and their ratio. Both ways take turns, and the best turn counts.
Boxes must agree to the last bit.
"""

import argparse
import json
import time
from typing import Any

import numpy as np
from lockstep import render
from side_by_side import machine

from nat2024 import types
from nat2024.engine import combine
from nat2024.engine.lockstep import Reading, track_together
from nat2024.engine.units import Trackers
from nat2024.engine.workers import computing_threads
from nat2024.interfaces import Tracker
from nat2024.store import Track


def track(trackers: list[Tracker], sequence: types.Sequence) -> list[Any]:
    """Boxes of each tracker, all on one stream."""
    results = [one.result for one in track_together(trackers, [sequence], Reading())]
    assert all(isinstance(one, Track) for one in results), results
    return [one.boxes for one in results if isinstance(one, Track)]


def measure(given: argparse.Namespace, size: str, count: int) -> dict[str, Any]:
    """A row of the table: `count` trackers of the same kind, with each enhancer."""
    width, height = (int(side) for side in size.split("x"))
    [sequence] = render(1, given.frames, (width, height), jpeg=True)
    titles = [f"{given.tracker}@{number}" for number in range(count)]
    made = Trackers()
    combinations = combine(titles, given.enhancers.split(","), scope=given.scope)
    trackers = [made.create(one)[0] for one in combinations]
    together = alone = float("inf")
    with computing_threads(1):
        for _ in range(given.turns):
            start = time.perf_counter()
            shared = track(trackers, sequence)
            middle = time.perf_counter()
            single = [track([one], sequence)[0] for one in trackers]
            together = min(together, middle - start)
            alone = min(alone, time.perf_counter() - middle)
    assert all(np.array_equal(a, b) for a, b in zip(shared, single, strict=True))
    return {
        "size": size,
        "combinations": len(trackers),
        "together_ms": 1000 * together / given.frames,
        "alone_ms": 1000 * alone / given.frames,
        "ratio": alone / together,
    }


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--tracker", default="mosse")
    parser.add_argument("--enhancers", default="none,clahe")
    parser.add_argument("--counts", default="1,2,5")
    parser.add_argument("--sizes", default="960x540,1920x1080")
    parser.add_argument("--scope", default="frame")
    parser.add_argument("--frames", type=int, default=12)
    parser.add_argument("--turns", type=int, default=3)
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    rows = [
        measure(given, size, int(count))
        for size in given.sizes.split(",")
        for count in given.counts.split(",")
    ]
    if given.json:
        print(json.dumps({"machine": machine(), "rows": rows}))
        return
    print(f"{machine()}\n")
    print("| frame | combinations | together, ms a frame | one by one, ms | ratio |")
    print("| --- | ---: | ---: | ---: | ---: |")
    for row in rows:
        print(
            f"| {row['size']} | {row['combinations']} | {row['together_ms']:.1f} "
            f"| {row['alone_ms']:.1f} | {row['ratio']:.2f} |"
        )


if __name__ == "__main__":
    main()
