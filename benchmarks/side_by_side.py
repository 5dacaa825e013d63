"""What the speed scripts share: two sides that take turns, fresh processes, tables in pages."""

import json
import math
import os
import platform
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
SIDES = ("peer", "ours")


def written_plainly(registered: Sequence[str]) -> list[str]:
    """Those names that are written plainly in `peers/` as well."""
    return sorted({path.stem for path in (HERE / "peers").glob("*.py")} & set(registered))


def take_turns(
    sides: Mapping[str, Callable[[], Any]], repeats: int, seconds: float
) -> dict[str, float]:
    """Median milliseconds of each side; they take turns `repeats` times or until `seconds`."""
    times: dict[str, list[float]] = {side: [] for side in sides}
    begin = time.perf_counter()
    # The first round warms up, and counts only where there is no time for another.
    for round_ in range(repeats + 1):
        if round_ and time.perf_counter() - begin > seconds:
            break
        for side, call in sides.items():
            start = time.perf_counter()
            call()
            times[side].append(1000 * (time.perf_counter() - start))
    return {side: statistics.median(all_[1:] or all_) for side, all_ in times.items()}


def in_fresh_process(
    script: Path, job: Mapping[str, Any], *, threads: int, limit: float
) -> dict[str, float]:
    """What `script --job JOB` prints; NaN for both sides where it took too long or died."""
    command = [sys.executable, str(script), "--job", json.dumps(job)]
    environment = {"OMP_WAIT_POLICY": "PASSIVE", **os.environ, "OMP_NUM_THREADS": str(threads)}
    try:
        done = subprocess.run(
            command, env=environment, stdout=subprocess.PIPE, timeout=limit, check=True, text=True
        )
    except (subprocess.TimeoutExpired, subprocess.CalledProcessError) as error:
        print(f"{job}: {type(error).__name__}", file=sys.stderr)
        return dict.fromkeys(SIDES, math.nan)
    answer: dict[str, float] = json.loads(done.stdout)
    return answer


def shown(value: float, form: str) -> str:
    """The number, or a dash for NaN."""
    return "-" if math.isnan(value) else format(value, form)


def shown_ms(value: float) -> str:
    """Milliseconds with a decimal where they are few."""
    return shown(value, ",.0f" if value >= 100 else ".1f")


def machine() -> str:
    """What the times were taken on, without naming anybody's machine."""
    import torch

    return (
        f"Measured on {os.cpu_count()} cores ({platform.machine()}, "
        f"{torch.backends.cpu.get_cpu_capability()}), PyTorch {torch.__version__}."
    )


def chosen(only: str, known: Sequence[str], kind: str) -> list[str]:
    """The names in `only`, with commas, or all that are known; leaves where one is unknown."""
    names = only.split(",") if only else list(known)
    unknown = sorted(set(names) - set(known))
    if unknown:
        sys.exit(f"no {kind} with a plain form: {', '.join(unknown)}; known: {', '.join(known)}")
    return names


def update(page: str, table: str, markers: tuple[str, str]) -> str:
    """The page with what is between its markers replaced by `table`."""
    begin, end = markers
    if page.count(begin) != 1 or page.count(end) != 1 or page.index(begin) > page.index(end):
        sys.exit(f"the page needs one line {begin} and one line {end} after it")
    head, tail = page.split(begin)[0], page.split(end)[1]
    return f"{head}{begin}\n{table}\n{end}{tail}"


def report(
    header: str,
    lines: Sequence[str],
    rows: Sequence[Mapping[str, Any]],
    *,
    as_json: bool,
    page: Path | None,
    markers: tuple[str, str],
) -> None:
    """Print the table or `rows` as JSON, and write the table into the page."""
    table = "\n".join([machine(), "", header, *lines])
    if page is not None:
        text = page.read_text(encoding="utf-8")
        page.write_text(update(text, table, markers), encoding="utf-8")
    if as_json:
        known = [{k: None if v != v else v for k, v in row.items()} for row in rows]
        print(json.dumps({"machine": machine(), "rows": known}))
    else:
        print(table)
