"""What a combination costs: parameters, multiply-accumulates, time of each stage, memory.

Each combination is measured in a process of its own, so that its memory is its own, with the
frames read before the clock starts and the first frames, which warm it up, left out.
"""

import multiprocessing
import resource
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from nat2024 import types
from nat2024.backends import all_in_torch
from nat2024.engine import Combination, track_frame
from nat2024.engine.timing import TimedEnhancer, now
from nat2024.engine.workers import computing_threads
from nat2024.errors import NatBenchError, UsageError
from nat2024.interfaces import Enhancer, Tracker
from nat2024.registry import load_plugin_file
from nat2024.types import Box, Image

if TYPE_CHECKING:
    import torch

FEWEST_FRAMES = 30
"""From fewer measured frames no throughput is told: one hiccup would decide it."""


@dataclass(frozen=True, slots=True)
class Profile:
    """What one combination costs. Times are medians over the measured frames.

    Attributes:
        run: name of the combination.
        device: where networks ran.
        threads: computing threads.
        frame_size: (width, height) in pixels.
        frames: measured, those of the warm-up left out.
        parameters: trainable numbers of both networks, 0 where there is none.
        macs: multiply-accumulates of both networks for one frame; None where a network runs
            outside PyTorch and cannot be counted.
        enhancer_macs: those of the enhancer.
        start_ms: the first frame, with all that is done once.
        enhance_ms: of one frame.
        track_ms: of one frame, without enhancing.
        frames_per_second: frames in each second of enhancing and tracking; None for fewer
            measured frames than `FEWEST_FRAMES`.
        peak_memory_mb: most memory the process held (on CUDA: that torch held there).
        added_memory_mb: of it, what was added since before the combination was created.
    """

    run: str
    device: str
    threads: int
    frame_size: tuple[int, int]
    frames: int
    parameters: int
    macs: int | None
    enhancer_macs: int
    start_ms: float
    enhance_ms: float
    track_ms: float
    frames_per_second: float | None
    peak_memory_mb: float
    added_memory_mb: float


def profile(
    combinations: Sequence[Combination],
    sequence: types.Sequence,
    *,
    frames: int = 60,
    warm_up: int = 5,
    size: tuple[int, int] | None = None,
    threads: int = 1,
    plugins: tuple[str, ...] = (),
) -> list[Profile]:
    """Measure combinations one after the other on the same frames.

    A sequence shorter than `frames` is played to and fro.

    Args:
        combinations: what is measured.
        sequence: whose frames and first box are taken.
        frames: measured in each.
        warm_up: frames before them that are not measured.
        size: (width, height) to which frames are scaled; None leaves them.
        threads: computing threads.
        plugins: plugin files to load.

    Raises:
        UsageError: a number below 1.
        NatBenchError: a combination fails; names it.
    """
    if min(frames, warm_up, threads) < 1:
        msg = f"frames, warm_up and threads must be 1 or more, not {frames}, {warm_up}, {threads}"
        raise UsageError(msg)
    context = multiprocessing.get_context("spawn")
    profiles = []
    for combination in combinations:
        with ProcessPoolExecutor(1, mp_context=context) as pool:
            task = pool.submit(
                _measure, combination, sequence, frames, warm_up, size, threads, plugins
            )
            try:
                profiles.append(task.result())
            except BrokenProcessPool:
                msg = f"{combination.run}: its process died (out of memory or a crashed library)"
                raise NatBenchError(msg) from None
            except NatBenchError as error:
                msg = f"{combination.run}: {error}"
                raise type(error)(msg) from None
            except Exception as error:  # a plugin may fail in any way
                msg = f"{combination.run}: {type(error).__name__}: {error}"
                raise NatBenchError(msg) from error
    return profiles


def _measure(
    combination: Combination,
    sequence: types.Sequence,
    frames: int,
    warm_up: int,
    size: tuple[int, int] | None,
    threads: int,
    plugins: tuple[str, ...],
) -> Profile:
    for source in plugins:
        load_plugin_file(source)
    device = combination.device
    with computing_threads(threads):
        images, box = _frames(sequence, min(len(sequence), frames + warm_up + 1), size)
        before = _peak_memory_mb(device)
        tracker, enhancer = combination.create()
        _, _, start = track_frame(tracker, images[0], box)
        order = _to_and_fro(len(images), frames + warm_up)
        seconds = np.array([track_frame(tracker, images[i])[2] for i in order])[warm_up:]
        peak = _peak_memory_mb(device)
        macs, enhancer_macs = _macs(tracker, enhancer, images[0])
    total = float(seconds.sum())
    return Profile(
        run=combination.run,
        device=device,
        threads=threads,
        frame_size=(images[0].shape[1], images[0].shape[0]),
        frames=frames,
        parameters=_parameters(tracker) + _parameters(enhancer),
        macs=macs,
        enhancer_macs=enhancer_macs,
        start_ms=1000 * float(start.sum()),
        enhance_ms=1000 * float(np.median(seconds[:, 0])),
        track_ms=1000 * float(np.median(seconds[:, 1])),
        frames_per_second=frames / total if frames >= FEWEST_FRAMES and total > 0 else None,
        peak_memory_mb=peak,
        added_memory_mb=peak - before,
    )


def _frames(
    sequence: types.Sequence, count: int, size: tuple[int, int] | None
) -> tuple[list[Image], Box]:
    import cv2

    images = [sequence.image(index) for index in range(count)]
    box = np.array(sequence.boxes[0], dtype=np.float64)
    if size is None:
        return images, box
    height, width = images[0].shape[:2]
    scale = np.array([size[0] / width, size[1] / height])
    scaled = [cv2.resize(image, size, interpolation=cv2.INTER_AREA) for image in images]
    return [np.asarray(image, dtype=np.uint8) for image in scaled], box * np.tile(scale, 2)


def _to_and_fro(count: int, wanted: int) -> list[int]:
    """Numbers of the frames after the first, turning round at both ends."""
    circle = [*range(1, count), *range(count - 2, -1, -1)] or [0]
    return [circle[step % len(circle)] for step in range(wanted)]


def _parameters(plugin: Tracker | Enhancer | None) -> int:
    from nat2024.networks.macs import count_parameters

    model = getattr(plugin, "model", None)
    return 0 if model is None else count_parameters(model)


def _macs(tracker: Tracker, enhancer: Enhancer | None, image: Image) -> tuple[int | None, int]:
    """Of one update, and of the enhancer in it; None for a network that PyTorch does not run."""
    from nat2024.networks.macs import count_macs

    seen = _Counts(tracker.enhancer)
    with all_in_torch():
        whole = count_macs(tracker.update, image)
        if enhancer is not None:
            tracker.enhancer = seen
            tracker.update(image)
    foreign = tracker.card.needs_weights and getattr(tracker, "model", None) is None
    return (None if foreign else whole), seen.macs


class _Counts:
    """Passes batches on to an enhancer and adds up what they cost."""

    def __init__(self, enhancer: Any) -> None:
        self.enhancer = enhancer.enhancer if isinstance(enhancer, TimedEnhancer) else enhancer
        self.macs = 0

    def enhance_batch(self, batch: "torch.Tensor") -> "torch.Tensor":
        from nat2024.networks.macs import count_macs

        self.macs += count_macs(self.enhancer.enhance_batch, batch)
        enhanced: torch.Tensor = self.enhancer.enhance_batch(batch)
        return enhanced


def _peak_memory_mb(device: str) -> float:
    now(device)  # what is still under way counts too
    if device.startswith("cuda"):
        import torch

        return torch.cuda.max_memory_allocated(device) / 1e6
    status = Path("/proc/self/status")
    if status.is_file():  # ru_maxrss would begin at the peak of whoever started this process
        for line in status.read_text().splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) * 1024 / 1e6
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e6
