"""The measurements of `growth.py`, each made in a fresh process so that its memory is its own."""

import contextlib
import functools
import multiprocessing
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from nat2024.engine import Combination
from nat2024.types import Dataset, Image
from nat2024.types import Sequence as Track

PLUGINS = str(Path(__file__).with_name("growth_plugins.py"))
RENDERED = 12  # frames on disk; longer sequences go through them to and fro
Job = Mapping[str, Any]


def peak_mb(process: str | int = "self") -> float:
    """Most memory that a process has held, in MB; 0 where that cannot be told."""
    with contextlib.suppress(OSError, StopIteration):
        lines = Path(f"/proc/{process}/status").read_text().splitlines()
        line = next(line for line in lines if line.startswith("VmHWM"))
        return float(line.split()[1]) * 1024 / 1e6
    if process == "self":  # begins at the peak of the parent, so an upper bound
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6
    return 0.0


def processor_seconds() -> float:
    """Of this process and of those it has waited for."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def to_and_fro(count: int) -> list[int]:
    """Numbers of rendered frames, so that the target never jumps."""
    period = 2 * RENDERED - 2
    return [min(n % period, period - n % period) for n in range(count)]


def render(job: Job) -> dict[str, float]:
    """A few JPEG frames in each size, all of one rendered clip; gives kilobytes a frame."""
    import cv2

    from nat2024.datasets import write_sequence
    from nat2024.night import Clip, render_clip

    clip = Clip("clip", frames=RENDERED, size=(960, 540), target_size=(60, 34))
    frames = list(render_clip(clip))
    kilobytes = {}
    for width, height in job["sizes"]:
        folder = size_folder(job["folder"], (width, height))
        scaled = [
            (np.asarray(cv2.resize(image, (width, height)), np.uint8), box * width / 960)
            for image, box in frames
        ]
        write_sequence(folder, "clip", scaled, ".jpg")
        files = list((folder / "data_seq" / "clip").iterdir())
        total = sum(path.stat().st_size for path in files)
        kilobytes[f"{width}x{height}"] = total / len(files) / 1000
    return kilobytes


def size_folder(folder: str, size: Sequence[int]) -> Path:
    """Where frames of a size are."""
    return Path(folder) / f"{size[0]}x{size[1]}"


def rendered_dataset(folder: Path, sequences: int, frames: int) -> Dataset:
    """Sequences of any number and length over the rendered files."""
    from nat2024.datasets.frames import FolderFrames

    boxes = np.loadtxt(folder / "anno" / "clip.txt", delimiter=",", ndmin=2)
    images = folder / "data_seq" / "clip"
    files = sorted(path.name for path in images.iterdir())
    order = to_and_fro(frames)
    source = FolderFrames(images, tuple(files[n] for n in order))
    names = [f"clip{number:05}" for number in range(sequences)]
    return Dataset("rendered", tuple(Track(name, source, boxes[order]) for name in names))


def plain_combinations(job: Job) -> list[Combination]:
    """So many trackers under names of their own, each with the enhancer."""
    from nat2024.engine import combine

    titles = [f"{job['tracker']}@{number}" for number in range(job.get("combinations", 1))]
    return list(combine(titles, [job.get("enhancer", "none")]))


@dataclass(slots=True)
class Watch:
    """Progress of a run: when tracking began, and the memory of its workers."""

    begun: float = field(default_factory=time.perf_counter)
    first: float = 0.0
    used_before: float = 0.0
    workers: dict[int, float] = field(default_factory=dict)

    def __call__(self, _frames: int, _what: str) -> None:
        """Called by the engine."""
        if not self.first:
            self.first, self.used_before = time.perf_counter(), processor_seconds()
        for child in multiprocessing.active_children():
            if child.pid:
                self.workers[child.pid] = peak_mb(child.pid)


def run(job: Job) -> dict[str, float]:
    """`run_benchmark` over rendered JPEG frames; least times of the repeats."""
    from nat2024.engine import run_benchmark
    from nat2024.registry import load_plugin_file

    load_plugin_file(PLUGINS)
    dataset = rendered_dataset(
        size_folder(job["folder"], job["size"]), job["sequences"], job["frames"]
    )
    combinations = plain_combinations(job)
    rows = []
    for _ in range(job["repeats"]):
        watch, used = Watch(), processor_seconds()
        with tempfile.TemporaryDirectory() as results:
            run_benchmark(
                combinations,
                dataset,
                results,
                workers=job.get("workers", 1),
                batch=job.get("batch", 1),
                plugins=(PLUGINS,),
                progress=watch,
            )
            end, finished = time.perf_counter(), processor_seconds()
        rows.append(
            {
                "seconds": end - watch.begun,
                "processor_seconds": finished - used,
                "tracking_processor_seconds": finished - watch.used_before,
                "start_seconds": watch.first - watch.begun,
                "tracking_seconds": end - watch.first,
                "workers_mb": sum(watch.workers.values()),
            }
        )
    least = {key: min(row[key] for row in rows) for key in rows[0]}
    tracked = job["frames"] * job["sequences"] * job.get("combinations", 1)
    return {**least, "peak_mb": peak_mb(), "tracked": tracked}


@dataclass(frozen=True, slots=True)
class SameFrame:
    """One small frame over and over, in memory; a `FrameSource`."""

    count: int

    @property
    def frame_size(self) -> tuple[int, int]:
        """(width, height) in pixels."""
        return (32, 24)

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, index: int) -> Image:
        return np.zeros((24, 32, 3), np.uint8)


def plain_dataset(lengths: Sequence[int]) -> Dataset:
    """Sequences of these lengths without anything to see."""
    return Dataset(
        "plain",
        tuple(
            Track(f"s{number:05}", SameFrame(n), np.tile([4.0, 4.0, 8.0, 8.0], (n, 1)))
            for number, n in enumerate(lengths)
        ),
    )


def evaluate(job: Job) -> dict[str, float]:
    """`evaluate` over many result files, first with nothing kept and then once more."""
    import nat2024

    rng = np.random.default_rng(0)
    dataset = plain_dataset([job["rows"]] * job["sequences"])
    with tempfile.TemporaryDirectory() as name, own_cache(name):
        folder = Path(name) / "results" / dataset.name
        noisy = rng.uniform(3, 9, size=(job["rows"], 4)).round(3)
        rest = "\n".join(",".join(map(str, row)) for row in noisy[1:])
        for run_number in range(job["runs"]):
            (folder / f"run{run_number}").mkdir(parents=True)
            for number, sequence in enumerate(dataset):
                first = f"4,4,8.{run_number:04}{number:04},8\n"  # no two files are equal
                path = folder / f"run{run_number}" / f"{sequence.name}.txt"
                path.write_text(f"{first}{rest}\n")
        before = peak_mb()
        seconds = []
        for _ in range(2):
            begin = time.process_time()
            nat2024.evaluate(Path(name) / "results", dataset).summary()
            seconds.append(time.process_time() - begin)
    return {
        "files": job["runs"] * job["sequences"],
        "first_seconds": seconds[0],
        "again_seconds": seconds[1],
        "added_mb": peak_mb() - before,
    }


@contextlib.contextmanager
def own_cache(folder: str) -> Iterator[None]:
    """Keep what is kept in a cache of its own, so that it begins empty."""
    before = os.environ.get("NAT2024_CACHE")
    os.environ["NAT2024_CACHE"] = str(Path(folder) / "cache")
    try:
        yield
    finally:
        if before is None:
            del os.environ["NAT2024_CACHE"]
        else:
            os.environ["NAT2024_CACHE"] = before


def report(job: Job) -> dict[str, float]:
    """The command `nat-bench report` over tracked results, first and once more."""
    from nat2024.engine import combine, run_benchmark

    with tempfile.TemporaryDirectory() as name, own_cache(name):
        folder = Path(name) / "rendered"
        synthesize = [
            *("dataset", "synthesize", str(folder), "--size", "320x180"),
            *("--sequences", str(job["sequences"]), "--frames", str(job["frames"])),
            *("--target", "car"),
        ]
        command(synthesize, name)
        import nat2024

        titles = [f"mosse@{number}" for number in range(job["runs"])]
        dataset = nat2024.load_dataset(folder)
        run_benchmark(combine(titles, ["none"]), dataset, Path(name) / "results")
        page = Path(name) / "page"
        words = ["report", "--results", str(Path(name) / "results"), "--out", str(page)]
        first, first_mb = command(words, name)
        again, _ = command(words, name)
        size = (page / "index.html").stat().st_size / 1e6
    files = job["sequences"] * job["runs"]
    return {
        "files": files,
        "first_seconds": first,
        "again_seconds": again,
        "peak_mb": first_mb,
        "page_mb": size,
    }


def command(words: Sequence[str], folder: str) -> tuple[float, float]:
    """Processor seconds and most memory in MB of a `nat-bench` command."""
    # a small process between, because a child's peak begins at that of its parent
    code = (
        "import os, subprocess, sys; child = subprocess.Popen(sys.argv[1:],"
        " stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL);"
        " status, used = os.wait4(child.pid, 0)[1:];"
        " print(status, used.ru_utime + used.ru_stime, used.ru_maxrss)"
    )
    whole = [sys.executable, "-c", code, sys.executable, "-m", "nat2024", *words]
    done = subprocess.run(whole, cwd=folder, stdout=subprocess.PIPE, check=True, text=True)
    status, seconds, kilobytes = done.stdout.split()
    if status != "0":
        msg = f"nat-bench {' '.join(words)} ends with {status}"
        raise RuntimeError(msg)
    return float(seconds), float(kilobytes) * 1024 / 1e6


def cluster(job: Job) -> dict[str, dict[str, float]]:
    """Several works of sleeping trackers on so many threaded Dask workers in this process."""
    import distributed

    from nat2024.registry import load_plugin_file

    load_plugin_file(PLUGINS)
    settings: Any = {
        "processes": False,
        "threads_per_worker": 1,
        "dashboard_address": ":0",
        "memory_limit": 0,  # of the machine, each would get its share and stop beyond it
    }
    local: Any = distributed.LocalCluster
    connect: Any = distributed.Client
    with local(n_workers=job["threads"], **settings) as workers, connect(workers) as client:
        on_cluster(client, [2] * job["threads"], 0.0)  # threads build their trackers
        return {
            name: on_cluster(client, work["lengths"], work["sleep"])
            for name, work in job["works"].items()
        }


def on_cluster(client: Any, lengths: Sequence[int], sleep: float) -> dict[str, float]:
    """Wall clock and processor seconds of one work, and the longest sleep that there is in it."""
    from nat2024.engine import combine, run_benchmark

    dataset = plain_dataset(lengths)
    options = {"sleeping": {"seconds": sleep}}
    with tempfile.TemporaryDirectory() as results:
        begin, used = time.perf_counter(), processor_seconds()
        report = run_benchmark(
            combine(["sleeping"], ["none"], options=options),
            dataset,
            results,
            cluster=client,
            read_ahead=0,  # nothing is decoded
        )
        seconds, used = time.perf_counter() - begin, processor_seconds() - used
    if report.failures:
        msg = f"{len(report.failures)} units failed: {report.failures[0].reason}"
        raise RuntimeError(msg)
    return {
        "seconds": seconds,
        "processor_seconds": used,
        "units": len(lengths),
        "frames": sum(lengths),
        "longest_seconds": max(lengths) * sleep,
        "asleep_seconds": sum(lengths) * sleep,
    }


@functools.cache
def jobs() -> dict[str, Callable[[Job], Any]]:
    """Measurements by name."""
    return {
        "render": render,
        "run": run,
        "evaluate": evaluate,
        "report": report,
        "cluster": cluster,
    }
