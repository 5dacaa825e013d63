"""How time and memory grow with frames, sequences, combinations, frame size and workers.

    python benchmarks/growth.py [--only TABLE,TABLE] [--gpu "NAME=FRAMES_PER_SECOND[xBATCH]"]
        [--cores N] [--storage MB] [--update docs/growth.md] [--json]

prints a table for each question. Every measurement runs in a process of its own on rendered
frames; where one fails, its fields are dashes. `standing` costs nothing, so that the engine is
measured; the work itself is siamrpnpp with ldenhancer and their bundled weights. The last tables
compute the full study from what was measured, and from the rate of a GPU: `--gpu`, as often as
you like, takes frames a second of `benchmarks/lockstep.py --device cuda --jpeg`.
"""

import argparse
import json
import math
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import growth_jobs
import growth_study
from growth_bench import (
    SIZES,
    STUDY_FROM,
    STUDY_SLEEP,
    Bench,
    form,
    small_study,
    table,
    unit_ms,
)
from growth_study import Machine, Rates
from side_by_side import machine, update

THREADS = (1, 2, 4, 8, 16, 32, 64)
GPUS = ("NVIDIA H100=274", "NVIDIA H100=744x8", "NVIDIA H100=864x32")
"""Frames of siamrpnpp with ldenhancer a second, from `lockstep.py --device cuda --jpeg`."""

UNKNOWN = Rates(110.0, 13.0, 0.7, 12.0, 5.0, 5.0)  # where a measurement fails
REAL = {"tracker": "siamrpnpp", "enhancer": "ldenhancer", "size": (960, 540), "repeats": 1}
CHEAP = {"tracker": "standing", "size": (320, 180), "repeats": 2}


def frames(bench: Bench) -> str:
    """One sequence, longer and longer."""
    rows = []
    for count in (100, 1000, 10_000):
        one = bench.run(**CHEAP, sequences=1, frames=count)
        used = one["tracking_processor_seconds"]
        rows.append((count, one["seconds"], used, 1000 * used / count, one["peak_mb"]))
    return table("frames|seconds|processor s|processor ms a frame|peak MB", rows)


def sequences(bench: Bench) -> str:
    """More and more sequences of four frames."""
    rows = []
    for count in (10, 100, 1000):
        one = bench.run(**CHEAP, sequences=count, frames=4)
        each = 1000 / count
        rows.append(
            (
                count,
                one["seconds"],
                one["processor_seconds"],
                each * one["seconds"],
                each * one["processor_seconds"],
                one["peak_mb"],
            )
        )
    header = "sequences|seconds|processor s|ms a sequence|processor ms a sequence|peak MB"
    return table(header, rows)


def combinations(bench: Bench) -> str:
    """More and more combinations on the same frames: nothing but the engine, and networks."""
    cheap = {**CHEAP, "size": (960, 540), "sequences": 1, "frames": 200}
    real = {**REAL, "sequences": 1, "frames": 10}
    rows = []
    for title, job, counts in (
        ("standing", cheap, (1, 4, 12, 24)),
        ("siamrpnpp+ldenhancer", real, (1, 2, 4)),
    ):
        for count in counts:
            one = bench.run(**job, combinations=count)
            used = 1000 * one["tracking_processor_seconds"] / job["frames"]
            rows.append((title, count, used, used / count, one["peak_mb"]))
    header = " combination|how many|processor ms a frame|of each combination|peak MB"
    return table(header, rows)


def sizes(bench: Bench) -> str:
    """The same in larger and larger frames."""
    rows = []
    kilobytes = bench.measure("render", sizes=SIZES)
    for width, height in SIZES:
        one = bench.run(**{**CHEAP, "size": (width, height)}, sequences=1, frames=40)
        used = 1000 * one["tracking_processor_seconds"] / 40
        name = f"{width}x{height}"
        megapixels = width * height / 1e6
        rows.append((name, kilobytes[name], used, used / megapixels, one["peak_mb"]))
    header = " frame|JPEG kB|processor ms a frame|processor ms a megapixel|peak MB"
    return table(header, rows)


def workers(bench: Bench) -> str:
    """One process, then two, for the same work."""
    rows = []
    alone = math.nan
    for count in (1, 2):
        one = bench.run(**REAL, sequences=4, frames=15, workers=count)
        rate = 60 / one["tracking_seconds"]
        alone = rate if count == 1 else alone
        rows.append(
            (
                count,
                one["start_seconds"],
                rate,
                rate / alone,
                one["processor_seconds"],
                one["peak_mb"] + one["workers_mb"],
            )
        )
    header = "workers|s to the first frame|frames/s then|against one|processor s|peak MB, all"
    return table(header, rows)


def batches(bench: Bench) -> str:
    """Several sequences in one forward."""
    rows = []
    for count in (1, 2, 4):
        one = bench.run(**REAL, sequences=4, frames=8, batch=count)
        used = 1000 * one["tracking_processor_seconds"] / 32
        rows.append((count, 1000 * one["tracking_seconds"] / 32, used, one["peak_mb"]))
    return table("batch|ms a frame|processor ms a frame|peak MB", rows)


def scoring(bench: Bench) -> str:
    """`eval` over more and more result files of 200 rows."""
    rows = []
    for runs in (1, 10, 100):
        one = bench.measure("evaluate", sequences=100, runs=runs, rows=200)
        first, again = one["first_seconds"], one["again_seconds"]
        files = 100 * runs
        each = (1000 * first / files, 1000 * again / files)
        rows.append((files, first, again, *each, one["added_mb"]))
    header = "result files|processor s|once more|ms a file|once more, ms a file|added MB"
    return table(header, rows)


def report(bench: Bench) -> str:
    """`nat-bench report` over more and more sequences and runs."""
    rows = []
    for count, runs in ((4, 1), (4, 4), (16, 1), (16, 4)):
        one = bench.measure("report", sequences=count, runs=runs, frames=20)
        times = (one["first_seconds"], one["again_seconds"])
        rows.append((count, runs, *times, one["peak_mb"], one["page_mb"]))
    return table("sequences|runs|processor s|once more|peak MB|page, MB", rows)


def overhead(bench: Bench) -> str:
    """What a unit costs on a cluster, workers being threads of one process."""
    rows = []
    for threads in THREADS:
        few, many = (bench.cluster(threads)[name] for name in ("few", "many"))
        rows.append(
            (
                threads,
                unit_ms(few, many, "seconds"),
                unit_ms(few, many, "processor_seconds"),
                1000 / unit_ms(few, many, "seconds"),
            )
        )
    return table("workers|ms a unit|processor ms a unit|units/s", rows)


def speedup(bench: Bench) -> str:
    """Work that grows with the workers."""
    rows = []
    for threads in THREADS:
        row: list[object] = [threads]
        for name in ("fast", "slow"):
            one = bench.cluster(threads)[name]
            ideal = one["asleep_seconds"] / threads / one["seconds"]
            row += [
                one["frames"] / one["seconds"],
                ideal,
                one["processor_seconds"] / one["seconds"],
            ]
        rows.append(row)
    header = (
        "workers|5 ms a frame: frames/s|of ideal|cores busy"
        "|25 ms a frame: frames/s|of ideal|cores busy"
    )
    return table(header, rows)


def lengths(bench: Bench) -> str:
    """Work of the study's own lengths, measured beside what carrying out its plan gives."""
    rows = []
    seconds = [STUDY_SLEEP * n for n in small_study()]
    for threads in THREADS:
        if threads < STUDY_FROM:
            continue
        works = bench.cluster(threads)
        each = unit_ms(works["few"], works["many"], "seconds") / 1000
        alone = sum(seconds)
        forecast = alone / growth_study.carry_out(seconds, threads, [each] * len(seconds))
        best = alone / growth_study.carry_out(seconds, threads)
        rows.append((threads, alone / works["study"]["seconds"], forecast, best))
    return table("workers|speed-up|forecast|without handing out", rows)


def rates(bench: Bench) -> Rates:
    """What the study is computed from, measured; `UNKNOWN` where that fails."""
    work = bench.run(**REAL, sequences=4, frames=15, workers=1)
    large = bench.run(**{**CHEAP, "size": (1920, 1080)}, sequences=1, frames=40)
    few, many = (bench.run(**CHEAP, sequences=count, frames=4) for count in (100, 1000))
    units = bench.cluster(8)  # with more, threads wait for the interpreter
    found = Rates(
        frame_ms=1000 * work["tracking_processor_seconds"] / 60,
        decode_ms=1000 * large["tracking_processor_seconds"] / 40,
        jpeg_mb=bench.measure("render", sizes=SIZES)["1920x1080"] / 1000,
        unit_ms=unit_ms(units["few"], units["many"], "seconds"),
        result_ms=1000 * (many["seconds"] - few["seconds"]) / 900,
        start_seconds=bench.run(**REAL, sequences=4, frames=15, workers=2)["start_seconds"],
    )
    known = {
        name: value if value > 0 else getattr(UNKNOWN, name)  # NaN is not above 0
        for name in Rates.__slots__
        for value in [getattr(found, name)]
    }
    return Rates(**known)


def gpu(text: str) -> Machine:
    """One GPU of `NAME=FRAMES_PER_SECOND[xBATCH]`."""
    name, _, numbers = text.rpartition("=")
    rate, _, batch = numbers.partition("x")
    try:
        found = Machine(name, 1, float(rate), int(batch or 1))
    except ValueError:
        sys.exit(f"--gpu {text!r} is not NAME=FRAMES_PER_SECOND or ...xBATCH")
    if not name or not found.rate > 0 or found.batch < 1:
        sys.exit(f"--gpu {text!r} is not NAME=FRAMES_PER_SECOND or ...xBATCH")
    return found


def study(bench: Bench, given: argparse.Namespace) -> str:
    """The whole study on cores and GPUs."""
    measured = rates(bench)
    rate = 1000 / measured.frame_ms
    machines = [Machine("cores", count, rate) for count in (1, 2, given.cores)]
    for one in map(gpu, given.gpu or GPUS):
        name = f"GPUs, {one.name}"
        machines += [Machine(name, count, one.rate, one.batch) for count in (1, 8, 64)]
    rows = []
    for one in machines:
        seen = growth_study.forecast(one, measured)
        decoding = one.rate / seen.together
        rows.append(
            (
                one.name,
                one.workers,
                one.rate,
                one.batch,
                seen.seconds / 3600,
                f"{100 * seen.busy:.0f} %",
                seen.units,
                seen.together,
                decoding * measured.decode_ms / 1000,
                decoding * measured.jpeg_mb * one.workers,
            )
        )
    header = (
        " workers|how many|frames/s each|batch|hours|tracking|units|combinations a decoded frame"
        "|cores that decode, for each|MB/s read, all"
    )
    factors = [
        ("all eleven", growth_study.dearness(growth_study.ENHANCERS)),
        (
            "without `kindpp`",
            growth_study.dearness([n for n in growth_study.ENHANCERS if n != "kindpp"]),
        ),
        ("`none` alone", growth_study.dearness(["none"])),
    ]
    dear = table(" enhancer settings|arithmetic of the average frame against that", factors)
    return f"{about(measured)}\n\n{table(header, rows)}\n\n{dear}"


def about(measured: Rates) -> str:
    """The rates in words."""
    return (
        f"{growth_study.tracked_frames():,} tracked frames, "
        f"{growth_study.results_of_study():,} results. Measured for it: "
        f"{form(measured.frame_ms)} ms of one core a frame of siamrpnpp (compact) with ldenhancer; "
        f"{form(measured.decode_ms)} ms and {form(measured.jpeg_mb)} MB a JPEG of 1920x1080; "
        f"{form(measured.unit_ms)} ms a unit on a cluster; {form(measured.result_ms)} ms a "
        f"sequence begun and written; {form(measured.start_seconds)} s until workers track."
    )


def saturation(bench: Bench, given: argparse.Namespace) -> str:
    """What there is not enough of first, GPUs being added."""
    measured = rates(bench)
    rows = []
    for one in map(gpu, given.gpu or GPUS):
        for count in (8, 64):
            many = Machine(one.name, count, one.rate, one.batch)
            for limit in growth_study.limits(many, measured, given.gpu_cores, given.storage):
                title = f"{one.name}, {form(one.rate)} frames/s, batch {one.batch}"
                enough = "never" if math.isinf(limit.workers) else form(limit.workers)
                rows.append((title, count, limit.what, limit.cost, enough))
    return table(" GPU|planned for| what| cost|used up at, GPUs", rows)


MEASURED: dict[str, Callable[[Bench], str]] = {
    "frames": frames,
    "sequences": sequences,
    "combinations": combinations,
    "sizes": sizes,
    "workers": workers,
    "batches": batches,
    "scoring": scoring,
    "report": report,
    "overhead": overhead,
    "speedup": speedup,
    "lengths": lengths,
}
COMPUTED: dict[str, Callable[[Bench, argparse.Namespace], str]] = {
    "study": study,
    "saturation": saturation,
}
NAMES = [*MEASURED, *COMPUTED]


def markers(name: str) -> tuple[str, str]:
    """What a table stands between in the page."""
    return f"<!-- growth, {name}: begin -->", f"<!-- growth, {name}: end -->"


def parse() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--only", default=",".join(NAMES), help="tables, with commas")
    parser.add_argument("--gpu", action="append", help="NAME=FRAMES_PER_SECOND[xBATCH]")
    parser.add_argument("--gpu-cores", type=int, default=16, help="cores beside each GPU")
    parser.add_argument("--cores", type=int, default=16, help="of the workstation")
    parser.add_argument("--storage", type=float, default=1000.0, help="MB a second")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--update", type=Path, help="page whose tables to replace")
    parser.add_argument("--job", help=argparse.SUPPRESS)
    given = parser.parse_args()
    unknown = sorted(set(given.only.split(",")) - set(NAMES))
    if unknown:
        sys.exit(f"no table {', '.join(unknown)}; known: {', '.join(NAMES)}")
    for text in given.gpu or ():
        gpu(text)  # what is wrong is told before anything is measured
    return given


def main() -> None:
    """Measure, print, and update a page."""
    given = parse()
    if given.job:
        job = json.loads(given.job)
        print(json.dumps(growth_jobs.jobs()[job["kind"]](job)))
        return
    tables = {}
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(folder)
        for name in given.only.split(","):
            made = MEASURED[name](bench) if name in MEASURED else COMPUTED[name](bench, given)
            tables[name] = f"{machine()}\n\n{made}"
            if not given.json:
                print(f"\n{name}\n\n{made}", flush=True)
            if given.update is not None:  # each at once: what was measured is not lost
                page = given.update.read_text(encoding="utf-8")
                page = update(page, tables[name], markers(name))
                given.update.write_text(page, encoding="utf-8")
        if given.json:
            print(json.dumps({"machine": machine(), "tables": tables, "rows": bench.rows}))


if __name__ == "__main__":
    main()
