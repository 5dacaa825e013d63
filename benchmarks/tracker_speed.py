"""Time of the trackers' networks against the same networks written plainly (`peers/`).

    python benchmarks/tracker_speed.py [--threads 1,2] [--only a,b] [--repeats 15] [--seconds 60]
        [--limit 600] [--json] [--update docs/speed.md]

Measured is what a network does in every frame: the maps of one search crop, with what it keeps of
the template. Both sides get fresh weights and the same dark noise, and take turns in one process,
`repeats` times or until `seconds` are over; times are medians. A process that takes longer than
`limit` seconds or dies leaves a dash. The table goes to standard output, and with `--update`
between the markers of a page.
"""

import argparse
import importlib
import json
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
MARKERS = ("<!-- tracker speed table: begin -->", "<!-- tracker speed table: end -->")
HEADER = """\
| tracker | search crop | threads | plain, ms | nat-bench, ms | times as fast |
| --- | ---: | ---: | ---: | ---: | ---: |"""


@dataclass(frozen=True)
class Measured:
    """One line of the table; NaN where a process took too long or died."""

    tracker: str
    side: int
    threads: int
    peer_ms: float
    ours_ms: float

    def row(self) -> str:
        """The line in Markdown."""
        fields = [
            f"`{self.tracker}`",
            f"{self.side}x{self.side}",
            str(self.threads),
            shown_ms(self.peer_ms),
            shown_ms(self.ours_ms),
            shown(self.peer_ms / self.ours_ms, ".2f"),
        ]
        return "| " + " | ".join(fields) + " |"


def trackers_with_peers() -> list[str]:
    """Names of registered trackers that are written plainly in `peers/` as well."""
    from nat2024.registry import list_trackers

    return written_plainly(list_trackers())


def noise(side: int) -> Any:
    """A float32 crop (1, 3, side, side) in 0..255, mostly dark."""
    import torch

    generator = torch.Generator().manual_seed(0)
    return 255 * torch.rand(1, 3, side, side, generator=generator) ** 2


def network_of(name: str, side: str) -> Any:
    """The plain network or the tracker's, with fresh weights."""
    import torch

    torch.manual_seed(0)
    if side == "peer":
        return importlib.import_module(f"peers.{name}").build()
    from nat2024.registry import create_tracker

    return create_tracker(name, weights=False).model


def constants_of(name: str) -> Any:
    """The tracker's constants, which tell the sizes of its crops."""
    from nat2024.registry import create_tracker

    return create_tracker(name, weights=False).constants


def time_both(name: str, threads: int, repeats: int, seconds: float) -> dict[str, float]:
    """Median milliseconds of both sides and the crop's side; run in a process of its own."""
    import torch

    torch.set_num_threads(threads)
    constants = constants_of(name)
    template, search = noise(constants.exemplar_size), noise(constants.instance_size)
    # Weights are made outside: in inference mode they could not tell whether they have changed.
    networks = {side: network_of(name, side) for side in SIDES}
    with torch.inference_mode():
        calls: dict[str, Callable[[], Any]] = {
            side: partial(network.match, network.embed(template), search)
            for side, network in networks.items()
        }
        times = take_turns(calls, repeats, seconds)
    return {**times, "side": constants.instance_size}


def measure(
    names: Sequence[str],
    threads: Sequence[int],
    *,
    repeats: int = 15,
    seconds: float = 60,
    limit: float = 600,
) -> Iterator[Measured]:
    """Measure all combinations, one line after the other."""
    for name in names:
        for count in threads:
            job = {"name": name, "threads": count, "repeats": repeats, "seconds": seconds}
            found = in_fresh_process(HERE, job, threads=count, limit=limit)
            side = int(found.get("side", 0)) or constants_of(name).instance_size
            yield Measured(name, side, count, found["peer"], found["ours"])


def main() -> None:
    """Measure, print, and update a page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--threads", default="1,2")
    parser.add_argument("--only", default="", help="names of trackers, with commas")
    parser.add_argument("--repeats", type=int, default=15)
    parser.add_argument("--seconds", type=float, default=60, help="time for the repeats of a line")
    parser.add_argument("--limit", type=float, default=600, help="seconds a process may take")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--update", type=Path, help="page whose table to replace")
    parser.add_argument("--job", type=json.loads, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.job:
        print(json.dumps(time_both(**given.job)))
        return
    names = chosen(given.only, trackers_with_peers(), "tracker")
    try:
        threads = [int(count) for count in given.threads.split(",")]
    except ValueError:
        sys.exit("--threads takes numbers, with commas between them")
    settings = {"repeats": given.repeats, "seconds": given.seconds, "limit": given.limit}
    results = []
    for result in measure(names, threads, **settings):
        print(result.row(), file=sys.stderr)
        results.append(result)
    rows = [asdict(result) for result in results]
    lines = [result.row() for result in results]
    report(HEADER, lines, rows, as_json=given.json, page=given.update, markers=MARKERS)


if __name__ == "__main__":
    main()
