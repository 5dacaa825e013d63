"""Time and memory of the enhancers against the same networks written plainly (`peers/`).

    python benchmarks/enhancer_speed.py [--sizes 287x287,1920x1080] [--threads 1,2] [--only a,b]
        [--repeats 9] [--seconds 60] [--limit 600] [--json] [--update docs/speed.md]

Both sides get fresh weights and the same dark noise, and take turns in one process, `repeats`
times or until `seconds` are over; times are medians. What a frame adds to the memory is measured
once a side in a process of its own. A process that takes longer than `limit` seconds or dies, for
want of memory say, leaves a dash. The table goes to standard output, and with `--update` between
the markers of a page.
"""

import argparse
import importlib
import json
import math
import resource
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

from side_by_side import (
    SIDES,
    chosen,
    in_fresh_process,
    report,
    shown,
    shown_ms,
    take_turns,
    written_plainly,
)

HERE = Path(__file__).resolve()
MARKERS = ("<!-- speed table: begin -->", "<!-- speed table: end -->")


@dataclass(frozen=True)
class Case:
    """One line of the table."""

    enhancer: str
    width: int
    height: int
    threads: int


@dataclass(frozen=True)
class Measured:
    """What was measured; NaN where a process took too long or died."""

    case: Case
    peer_ms: float
    ours_ms: float
    peer_mb: float
    ours_mb: float

    def row(self) -> str:
        """The line in Markdown."""
        case = self.case
        fields = [
            f"`{case.enhancer}`",
            f"{case.width}x{case.height}",
            str(case.threads),
            shown_ms(self.peer_ms),
            shown_ms(self.ours_ms),
            shown(self.peer_ms / self.ours_ms, ".2f"),
            shown(self.peer_mb, ",.0f"),
            shown(self.ours_mb, ",.0f"),
            shown(self.ours_mb / self.peer_mb if self.peer_mb else math.nan, ".2f"),
        ]
        return "| " + " | ".join(fields) + " |"


HEADER = """\
| enhancer | frame | threads | plain, ms | nat-bench, ms | times as fast | plain, MB | \
nat-bench, MB | share of memory |
| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |"""


def enhancers_with_peers() -> list[str]:
    """Names of registered enhancers that are written plainly in `peers/` as well."""
    from nat2024.registry import list_enhancers

    return written_plainly(list_enhancers())


def side_of(name: str, side: str) -> Callable[[Any], Any]:
    """What enhances a batch: the plain network or the plugin, with fresh weights."""
    import torch

    torch.manual_seed(0)
    if side == "peer":
        network: Callable[[Any], Any] = importlib.import_module(f"peers.{name}").build()
        return network
    from nat2024.registry import create_enhancer

    return create_enhancer(name, weights=False).enhance_batch


def noise(case: Case) -> Any:
    """A float32 batch (1, 3, height, width), mostly dark."""
    import torch

    generator = torch.Generator().manual_seed(0)
    return torch.rand(1, 3, case.height, case.width, generator=generator) ** 2


def time_both(case: Case, repeats: int, seconds: float) -> dict[str, float]:
    """Median milliseconds of both sides, which take turns; run in a process of its own."""
    import torch

    torch.set_num_threads(case.threads)
    batch = noise(case)
    sides = {side: partial(side_of(case.enhancer, side), batch) for side in SIDES}
    with torch.no_grad():
        return take_turns(sides, repeats, seconds)


def added_memory(case: Case, side: str) -> dict[str, float]:
    """MB (10^6 bytes) that one frame adds to the peak; run in a process of its own."""
    import torch

    torch.set_num_threads(case.threads)
    batch = noise(case)
    enhance = side_of(case.enhancer, side)
    before = peak_resident_mb()
    with torch.no_grad():
        enhance(batch)
    return {side: peak_resident_mb() - before}


def peak_resident_mb() -> float:
    """Highest resident memory of this process so far, in MB."""
    status = Path("/proc/self/status")
    if status.exists():
        # ru_maxrss survives exec on Linux: it would begin at the peak of whoever started us.
        for line in status.read_text().splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) * 1024 / 1e6
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e6


def in_own_process(case: Case, limit: float, **job: Any) -> dict[str, float]:
    """`time_both` or `added_memory` in a fresh process; NaN where it took too long or died."""
    asked = {"case": asdict(case), **job}
    return in_fresh_process(HERE, asked, threads=case.threads, limit=limit)


def run_job(job: dict[str, Any]) -> dict[str, float]:
    """In the fresh process: measure what `in_own_process` asked for."""
    case = Case(**job.pop("case"))
    return added_memory(case, **job) if "side" in job else time_both(case, **job)


def measure(
    names: Sequence[str],
    sizes: Sequence[tuple[int, int]],
    threads: Sequence[int],
    *,
    repeats: int = 9,
    seconds: float = 60,
    limit: float = 600,
) -> Iterator[Measured]:
    """Measure all combinations, one line after the other."""
    for name in names:
        for width, height in sizes:
            memory = {
                side: in_own_process(Case(name, width, height, threads[0]), limit, side=side)
                for side in SIDES
            }
            for count in threads:
                case = Case(name, width, height, count)
                times = in_own_process(case, limit, repeats=repeats, seconds=seconds)
                yield Measured(
                    case,
                    times["peer"],
                    times["ours"],
                    memory["peer"]["peer"],
                    memory["ours"]["ours"],
                )


def main() -> None:
    """Measure, print, and update a page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sizes", default="287x287,1920x1080", help="WIDTHxHEIGHT, with commas")
    parser.add_argument("--threads", default="1,2")
    parser.add_argument("--only", default="", help="names of enhancers, with commas")
    parser.add_argument("--repeats", type=int, default=9)
    parser.add_argument("--seconds", type=float, default=60, help="time for the repeats of a line")
    parser.add_argument("--limit", type=float, default=600, help="seconds a process may take")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--update", type=Path, help="page whose table to replace")
    parser.add_argument("--job", type=json.loads, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.job:
        print(json.dumps(run_job(given.job)))
        return
    names = chosen(given.only, enhancers_with_peers(), "enhancer")
    try:
        sizes = [(int(w), int(h)) for w, h in (s.split("x") for s in given.sizes.split(","))]
        threads = [int(count) for count in given.threads.split(",")]
    except ValueError:
        sys.exit("--sizes takes WIDTHxHEIGHT and --threads numbers, with commas between them")
    settings = {"repeats": given.repeats, "seconds": given.seconds, "limit": given.limit}
    results = []
    for result in measure(names, sizes, threads, **settings):
        print(result.row(), file=sys.stderr)
        results.append(result)
    rows = [{**asdict(result), **asdict(result.case)} for result in results]
    for row in rows:
        del row["case"]
    lines = [result.row() for result in results]
    report(HEADER, lines, rows, as_json=given.json, page=given.update, markers=MARKERS)


if __name__ == "__main__":
    main()
