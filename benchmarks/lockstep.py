"""Sequences in one forward, beside one at a time: `nat-bench run --batch`.

    python benchmarks/lockstep.py [--device cpu|cuda] [--batches 1,2,4,8] [--json]
        [--jpeg | --updates] [--profile]

runs siamrpnpp (AlexNet, official size) with ldenhancer, both with fresh weights, over rendered
frames of 960x540 through the engine's own loop, and prints the frames a second of all sequences
together for each batch: two for each lane, of lengths from the half of `--frames` to the whole.
Sizes take turns, and the best turn counts. With `--jpeg` frames are decoded from JPEG in reader
threads, as in a run; without, they lie in memory. With `--updates` only the tracker's updates are
timed, all of them on one frame: what the device allows. `--profile` shows which functions the
largest batch spends its time in.
"""

import argparse
import cProfile
import functools
import itertools
import json
import pstats
import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from side_by_side import machine

from nat2024 import types
from nat2024.engine.lockstep import Reading, track_together
from nat2024.engine.plan import Combination, PluginSpec
from nat2024.engine.workers import computing_threads
from nat2024.interfaces import Tracker
from nat2024.store import Track

RENDERED = 4
"""How many different sequences are rendered."""

KEPT = 8
"""How many frames of each; a longer sequence goes to and fro in them."""

ROUNDS = 2
"""Sequences for each lane."""


class ToAndFro:
    """A few frames as a sequence of any length, the last one followed by the one before it."""

    reads_in_parallel = True

    def __init__(self, frames: Any, count: int) -> None:
        self.frame_size = (frames[0].shape[1], frames[0].shape[0])
        self._frames, self._count = frames, count

    def __len__(self) -> int:
        return self._count

    def __getitem__(self, index: int) -> types.Image:
        last = len(self._frames) - 1
        image: types.Image = self._frames[last - abs(last - index % (2 * last))]
        return image


class JpegFrames:
    """Frames kept as JPEG, decoded when asked for."""

    def __init__(self, images: Sequence[types.Image]) -> None:
        import cv2

        self.frame_size = (images[0].shape[1], images[0].shape[0])
        self._files = [cv2.imencode(".jpg", image)[1] for image in images]

    def __len__(self) -> int:
        return len(self._files)

    def __getitem__(self, index: int) -> types.Image:
        import cv2

        return np.asarray(cv2.imdecode(self._files[index], cv2.IMREAD_COLOR), dtype=np.uint8)


def render(count: int, frames: int, size: tuple[int, int], *, jpeg: bool) -> list[types.Sequence]:
    """Night sequences, of which a few are rendered and the others the same under other names.

    The first has all `frames`, and each is a little shorter than the one before it, down to half.
    """
    rendered = []
    for seed in range(min(count, RENDERED)):
        images, box = render_one(seed, min(frames, KEPT), size)
        rendered.append((JpegFrames(images) if jpeg else images, box))
    sequences = []
    for number, (source, box) in zip(range(count), itertools.cycle(rendered), strict=False):
        length = frames - frames * number // (2 * count)
        boxes = np.tile(np.asarray(box), (length, 1))
        sequences.append(types.Sequence(f"s{number}", ToAndFro(source, length), boxes))
    return sequences


@functools.cache
def render_one(
    seed: int, frames: int, size: tuple[int, int]
) -> tuple[Sequence[types.Image], types.Box]:
    """Frames of a clip, and the box in the first."""
    from nat2024.night import Clip, render_clip

    clip = Clip(f"s{seed}", frames=frames, size=size, target_size=(40, 30), seed=seed)
    images, boxes = zip(*render_clip(clip), strict=True)
    return images, boxes[0]


def create(device: str, enhancer: str) -> Tracker:
    """The tracker with the enhancer, the same fresh weights each time."""
    import torch

    torch.manual_seed(0)
    combination = Combination(
        PluginSpec("siamrpnpp", options={"variant": "alex"}, weights=False),
        None if enhancer == "none" else PluginSpec(enhancer, weights=False),
        device,
    )
    return combination.create()[0]


def track(tracker: Tracker, sequences: list[types.Sequence], batch: int) -> list[types.Boxes]:
    """Boxes of all sequences, `batch` of them at a time."""
    boxes: dict[int, types.Boxes] = {}
    for finish in track_together([tracker], sequences, Reading(), lanes=batch):
        assert isinstance(finish.result, Track), finish.result
        boxes[finish.sequence] = finish.result.boxes
    return [boxes[number] for number in range(len(sequences))]


def measure_updates(given: argparse.Namespace) -> list[dict[str, Any]]:
    """Rows of the table for updates of one frame, without an engine around them."""
    width, height = (int(side) for side in given.size.split("x"))
    [sequence] = render(1, 2, (width, height), jpeg=False)
    image = sequence.image(1)
    tracker: Any = create(given.device, given.enhancer)
    first, target = tracker.begin(sequence.image(0), sequence.boxes[0])
    rows: list[dict[str, Any]] = []
    for batch in (int(batch) for batch in given.batches.split(",")):

        def update(batch: int = batch) -> Any:
            return tracker.update_many([image] * batch, [first] * batch, [target] * batch)

        with computing_threads(given.threads):
            for _ in range(4):  # allocations and choices of kernels
                steps = update()
            start = time.perf_counter()
            for _ in range(given.frames):  # boxes come to the CPU, which waits for the device
                update()
            seconds = (time.perf_counter() - start) / given.frames / batch
        rows.append(
            {
                "batch": batch,
                "frames_per_second": 1 / seconds,
                "ms_per_frame": 1000 * seconds,
                "ratio": rows[0]["ms_per_frame"] / 1000 / seconds if rows else 1.0,
                "largest_difference_px": float(np.ptp([step.box for step in steps], axis=0).max()),
            }
        )
    return rows


def measure(given: argparse.Namespace) -> list[dict[str, Any]]:
    """Rows of the table."""
    width, height = (int(side) for side in given.size.split("x"))
    batches = [int(batch) for batch in given.batches.split(",")]
    every = {
        batch: render(ROUNDS * batch, given.frames, (width, height), jpeg=given.jpeg)
        for batch in batches
    }
    tracker = create(given.device, given.enhancer)
    best = dict.fromkeys(batches, float("inf"))
    with computing_threads(given.threads):
        for batch in batches:  # allocations and choices of kernels
            track(tracker, render(batch, 2 * KEPT, (width, height), jpeg=given.jpeg), batch)
        for _ in range(given.turns):
            for batch in batches:
                start = time.perf_counter()
                track(tracker, every[batch], batch)
                best[batch] = min(best[batch], time.perf_counter() - start)
        apart = compare(tracker, batches, (width, height))
        if given.profile:
            profile(tracker, every[batches[-1]], batches[-1])
    frames = {batch: sum(map(len, every[batch])) for batch in batches}
    seconds = {batch: best[batch] / frames[batch] for batch in batches}
    return [
        {
            "batch": batch,
            "frames_per_second": 1 / seconds[batch],
            "ms_per_frame": 1000 * seconds[batch],
            "ratio": seconds[batches[0]] / seconds[batch],
            "largest_difference_px": apart[batch],
        }
        for batch in batches
    ]


def compare(tracker: Tracker, batches: list[int], size: tuple[int, int]) -> dict[int, float]:
    """The largest difference of boxes between each batch and the first of them."""
    short = render(max(batches), 2 * KEPT, size, jpeg=False)
    found = {batch: np.concatenate(track(tracker, short, batch)) for batch in batches}
    return {batch: float(np.abs(found[batch] - found[batches[0]]).max()) for batch in batches}


def profile(tracker: Tracker, sequences: list[types.Sequence], batch: int) -> None:
    """Print where the thread that tracks spends its time; it is slower for that."""
    watched = cProfile.Profile()
    watched.enable()
    track(tracker, sequences, batch)
    watched.disable()
    pstats.Stats(watched).sort_stats("tottime").print_stats(25)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--batches", default="1,2,4,8")
    parser.add_argument("--enhancer", default="ldenhancer")
    parser.add_argument("--frames", type=int, default=10)
    parser.add_argument("--turns", type=int, default=3)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--size", default="960x540")
    parser.add_argument("--jpeg", action="store_true")
    parser.add_argument("--updates", action="store_true")
    parser.add_argument("--profile", action="store_true")
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    rows = measure_updates(given) if given.updates else measure(given)
    where = machine()
    if given.device.startswith("cuda"):
        import torch

        where = f"Measured on {torch.cuda.get_device_name()}, PyTorch {torch.__version__}."
    if given.json:
        print(json.dumps({"machine": where, "device": given.device, "rows": rows}))
        return
    print(f"{where}\n")
    print("| batch | device | frames/s | ms a frame | against one | largest difference, px |")
    print("| ---: | --- | ---: | ---: | ---: | ---: |")
    for row in rows:
        print(
            f"| {row['batch']} | {given.device} | {row['frames_per_second']:.1f} "
            f"| {row['ms_per_frame']:.2f} | {row['ratio']:.2f} "
            f"| {row['largest_difference_px']:.1e} |"
        )


if __name__ == "__main__":
    main()
