"""Time of networks in each backend against the same networks written plainly (`peers/`).

    python benchmarks/backend_speed.py [--networks ldenhancer@287x287,siamrpnpp] [--threads 1,2]
        [--repeats 15] [--seconds 60] [--limit 600] [--memory] [--json] [--update docs/backends.md]

An enhancer is measured on one dark frame of the size after its `@`; a tracker on the maps of one
search crop, template features kept; TRACKER+ENHANCER@WxH on whole updates with frames of that size,
cropping, enhancing the search crop, the network and decoding together. All sides get fresh weights
and the same noise and take turns, each in a process of its own: ours set up as `nat-bench` sets
itself up, the plain form as Python begins. Times are medians. "Plain sum at most" is how many
times as fast as the plain form a network could be that takes every product of its convolutions, at
the rate at which the processor multiplies matrices. "Away" is the largest difference from our own
form in torch, in shares of its largest output (of 1 for images, of the box for updates). With
`--memory` the megabytes (10^6) that a first frame adds to the peak of a fresh
process are told too, the loading of the runtime included.
"""

import argparse
import contextlib
import importlib
import json
import math
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from enhancer_speed import peak_resident_mb
from side_by_side import Side, in_fresh_process, report, serve, shown, shown_ms, take_turns

HERE = Path(__file__).resolve()
MARKERS = ("<!-- backend table: begin -->", "<!-- backend table: end -->")
OURS = {
    "torch": ("torch", "float32"),
    "onnxruntime": ("onnxruntime", "float32"),
    "openvino": ("openvino", "float32"),
    "auto": ("auto", "float32"),
    "bfloat16": ("auto", "bfloat16"),
}
"""Backend and precision of each side that is ours."""

DEFAULT = (
    "ldenhancer@287x287,ldenhancer@1920x1080,darklighter@287x287,highlightnet@287x287,"
    "sct@287x287,dcepp@287x287,ruas@287x287,llve@287x287,enlightengan@287x287,"
    "siamrpnpp,siamapn,siamapnpp,hift,lpat,nanotrack,siamrpnpp+ldenhancer@960x540"
)
HEADER = """\
| network | threads | plain, ms | torch | onnxruntime | openvino | auto | auto, bfloat16 | \
plain sum at most | away, float32 | away, bfloat16 |
| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |"""


@dataclass(frozen=True)
class Measured:
    """One line; NaN where a backend is not installed, took too long or died."""

    network: str
    threads: int
    ms: dict[str, float]
    away: dict[str, float]
    mb: dict[str, float]
    sum_ms: float
    """What the multiply-accumulates of the network take at the rate of a product of matrices."""

    def row(self) -> str:
        """The line in Markdown: milliseconds of the plain form, and how many times as fast."""
        plain = self.ms["peer"]
        ratios = [shown(plain / self.ms.get(side, math.nan), ".2f") for side in OURS]
        float32 = max((v for s, v in self.away.items() if s != "bfloat16"), default=math.nan)
        fields = [
            f"`{self.network}`",
            str(self.threads),
            shown_ms(plain),
            *ratios,
            shown(plain / self.sum_ms, ".2f"),
            shown(float32, ".0e"),
            shown(self.away.get("bfloat16", math.nan), ".0e"),
        ]
        return "| " + " | ".join(fields) + " |"

    def memory(self) -> str:
        """The megabytes of each side, in words."""
        told = ", ".join(f"{side} {shown(mb, ',.0f')}" for side, mb in self.mb.items())
        return f"Memory of `{self.network}` in MB, {self.threads} threads: {told}."


def sides_of(network: str, threads: int, only: str = "") -> dict[str, Callable[[], Any]]:
    """What each side computes, as calls without arguments; one side alone where `only` says."""
    import torch

    torch.set_num_threads(threads)
    name, _, size = network.partition("@")
    make = _update_call if "+" in name else _enhancer_call if size else _tracker_call
    peer = None if "+" in name else plain_form(name)
    sides = {"peer": lambda: make(name, size, peer, None)}
    for side, (backend, precision) in OURS.items():
        options = {"backend": backend, "precision": precision}
        sides[side] = lambda options=options: make(name, size, None, options)
    return {side: made() for side, made in sides.items() if only in ("", side)}


def plain_form(name: str) -> Any:
    """The network of `peers/`, with fresh weights."""
    import torch

    torch.manual_seed(0)
    return importlib.import_module(f"peers.{name}").build()


def _noise(*shape: int) -> Any:
    import torch

    return torch.rand(shape, generator=torch.Generator().manual_seed(0)) ** 2


def _enhancer_call(
    name: str, size: str, peer: Any, options: dict[str, str] | None
) -> Callable[[], Any]:
    import torch

    from nat2024 import create_enhancer

    width, height = map(int, size.split("x"))
    batch = _noise(1, 3, height, width)
    if options is None:
        return lambda: peer(batch)
    torch.manual_seed(0)
    enhancer = create_enhancer(name, weights=False, **options)
    return lambda: enhancer.enhance_batch(batch)


def _tracker_call(
    name: str, _size: str, peer: Any, options: dict[str, str] | None
) -> Callable[[], Any]:
    import torch

    from nat2024 import create_tracker

    torch.manual_seed(0)
    tracker = create_tracker(name, weights=False, **(options or {}))
    sides = (tracker.constants.exemplar_size, tracker.constants.instance_size)
    template, search = (255 * _noise(1, 3, side, side) for side in sides)
    network = peer if options is None else tracker.network
    with torch.no_grad():
        features = network.embed(template)
    return lambda: network.match(features, search)


@dataclass(frozen=True)
class _PlainEnhancer:
    """A plain network as trackers ask for an enhancer."""

    network: Callable[[Any], Any]

    def enhance_batch(self, batch: Any, /) -> Any:
        """The network's own size rule holds: crops are padded to 16 and cut back."""
        import torch.nn.functional as F

        height, width = batch.shape[-2:]
        padded = F.pad(batch, (0, -width % 16, 0, -height % 16), mode="reflect")
        return self.network(padded)[..., :height, :width].clamp(0, 1)


@dataclass(frozen=True)
class _PlainNetwork:
    """A plain network as the loop of trackers asks for it."""

    network: Any

    def embed(self, template: Any) -> tuple[Any, ...]:
        """What the plain network keeps of a template, as a tuple."""
        return _as_tuple(self.network.embed(template))

    def match(self, features: tuple[Any, ...], search: Any) -> tuple[Any, ...]:
        """Its maps of a search crop."""
        found: tuple[Any, ...] = self.network.match(
            features[0] if len(features) == 1 else features, search
        )
        return found


def _update_call(
    name: str, size: str, _peer: Any, options: dict[str, str] | None
) -> Callable[[], Any]:
    import torch

    from nat2024 import create_enhancer, create_tracker

    tracker_name, _, enhancer_name = name.partition("+")
    width, height = map(int, size.split("x"))
    frame = (60 * _noise(height, width, 3)).byte().numpy()
    if options is None:
        enhancer: Any = _PlainEnhancer(plain_form(enhancer_name))
        tracker = create_tracker(tracker_name, weights=False, enhancer=enhancer)
        tracker.model = _PlainNetwork(plain_form(tracker_name))
    else:
        torch.manual_seed(0)
        enhancer = create_enhancer(enhancer_name, weights=False, **options)
        torch.manual_seed(0)
        tracker = create_tracker(tracker_name, weights=False, enhancer=enhancer, **options)
    tracker.init(frame, (width / 2, height / 2, 60, 40))
    start = tracker.target

    def update() -> Any:
        tracker.target = start  # every update looks at the same crop
        return torch.from_numpy(tracker.update(frame)[0])

    return update


def installed() -> list[str]:
    """The sides that can run here."""
    from nat2024.backends import is_installed

    has_openvino = is_installed("openvino", "cpu")
    return [
        side
        for side, (backend, precision) in OURS.items()
        if (precision == "float32" or has_openvino)
        and (backend == "auto" or is_installed(backend, "cpu"))
    ]


def answers_of(network: str, threads: int, side: str, folder: str) -> Iterator[dict[str, Any]]:
    """First what one side gives, kept in `folder`, and what it costs; then milliseconds, endlessly.

    Ours are set up as `nat-bench` sets itself up, and the plain form as nothing at all.
    """
    import torch

    from nat2024.memory import keep_freed_memory
    from nat2024.networks.macs import count_macs

    if side != "peer":
        keep_freed_memory()
    with torch.no_grad():
        [call] = sides_of(network, threads, side).values()
        torch.save(_as_tuple(call()), Path(folder) / side)
        yield (
            {"macs": count_macs(call), "rate": product_rate()} if side == "torch" else {"ready": 1}
        )
        while True:
            start = time.perf_counter()
            call()
            yield {"ms": 1000 * (time.perf_counter() - start)}


def time_all(
    network: str, threads: int, *, repeats: int, seconds: float, limit: float
) -> dict[str, Any]:
    """Median milliseconds of all sides, and how far they are from ours in torch."""
    job = {"network": network, "threads": threads}
    with contextlib.ExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory())
        sides = {}
        for name in ["peer", *installed()]:
            side = Side(HERE, {**job, "side": name, "folder": folder}, threads=threads)
            stack.callback(side.end)
            sides[name] = side
        ready = {name: side.ask(limit) for name, side in sides.items()}
        sides = {name: side for name, side in sides.items() if ready[name]}
        times = _turns(sides, repeats, seconds, limit)
        away = _differences(Path(folder), [name for name in sides if name != "peer"])
    cost = ready["torch"]
    sum_ms = cost["macs"] / cost["rate"] if cost else math.nan
    return {"ms": times, "away": away, "sum_ms": sum_ms}


def _turns(sides: dict[str, Side], repeats: int, seconds: float, limit: float) -> dict[str, float]:
    """Median milliseconds; the first round warms up, and counts only where there is no other."""
    times: dict[str, list[float]] = {name: [] for name in sides}
    begin = time.perf_counter()
    for round_ in range(repeats + 1):
        if round_ and time.perf_counter() - begin > seconds:
            break
        for name, side in sides.items():
            times[name].append(side.ask(limit).get("ms", math.nan))
    return {name: statistics.median(all_[1:] or all_) for name, all_ in times.items()}


def _differences(folder: Path, names: Sequence[str]) -> dict[str, float]:
    import torch

    kept = {name: torch.load(folder / name, weights_only=True) for name in names}
    return {name: _away(found, kept["torch"]) for name, found in kept.items() if "torch" in kept}


def product_rate() -> float:
    """Multiply-accumulates that a large product of matrices takes in a millisecond."""
    import torch

    side = 1024
    matrix = torch.rand(side, side)
    times = take_turns({"product": lambda: matrix @ matrix}, repeats=15, seconds=5)
    return float(side**3 / times["product"])


def _as_tuple(found: Any) -> tuple[Any, ...]:
    return found if isinstance(found, tuple) else (found,)


def _away(found: Sequence[Any], wanted: Sequence[Any]) -> float:
    pairs = zip(found, wanted, strict=False)
    return max(float((a - b).abs().max()) / max(float(b.abs().max()), 1.0) for a, b in pairs)


def added_memory(network: str, threads: int, side: str) -> dict[str, float]:
    """MB that the first frame adds to the peak; run in a process of its own."""
    import torch

    before = peak_resident_mb()
    with torch.no_grad():
        [call] = sides_of(network, threads, side).values()
        call()
    return {"mb": peak_resident_mb() - before}


def measure(
    network: str, threads: int, *, repeats: int, seconds: float, limit: float, memory: bool
) -> Measured:
    """One line, each side of it in the same fresh process; memory in one a side."""
    job = {"network": network, "threads": threads}
    found = time_all(network, threads, repeats=repeats, seconds=seconds, limit=limit)
    megabytes = {}
    for side in ["peer", *installed()] if memory else []:
        told = in_fresh_process(HERE, {**job, "side": side}, threads=threads, limit=limit)
        megabytes[side] = told.get("mb", math.nan)
    return Measured(
        network,
        threads,
        ms={"peer": math.nan, **found["ms"]},
        away=found["away"],
        mb=megabytes,
        sum_ms=found["sum_ms"],
    )


def main() -> None:
    """Measure, print, and update a page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--networks", default=DEFAULT, help="ENHANCER@WxH or TRACKER, with commas")
    parser.add_argument("--threads", default="1", help="numbers, with commas")
    parser.add_argument("--repeats", type=int, default=15)
    parser.add_argument("--seconds", type=float, default=60, help="time for the repeats of a line")
    parser.add_argument("--limit", type=float, default=600, help="seconds a process may take")
    parser.add_argument("--memory", action="store_true", help="measure memory too")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--update", type=Path, help="page whose table to replace")
    parser.add_argument("--job", type=json.loads, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.job:
        if "folder" in given.job:
            serve(answers_of(**given.job))
        else:
            print(json.dumps(added_memory(**given.job)))
        return
    results = []
    for network in given.networks.split(","):
        for threads in map(int, given.threads.split(",")):
            result = measure(
                network,
                threads,
                repeats=given.repeats,
                seconds=given.seconds,
                limit=given.limit,
                memory=given.memory,
            )
            print(result.row(), file=sys.stderr)
            results.append(result)
    lines = [result.row() for result in results]
    if given.memory:
        lines += ["", *[result.memory() for result in results]]
    rows = [asdict(result) for result in results]
    report(HEADER, lines, rows, as_json=given.json, page=given.update, markers=MARKERS)


if __name__ == "__main__":
    main()
