"""What the speed scripts share: two sides that take turns, fresh processes, tables in pages."""

import json
import math
import os
import platform
import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
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


class Side:
    """What one side computes, in a process of its own that computes when it is asked.

    So each side has the memory and the threads that it has alone, as set up by its own program.
    """

    def __init__(self, script: Path, job: Mapping[str, Any], *, threads: int) -> None:
        """Start `script --job JOB`, which calls `serve`."""
        environment = {"OMP_WAIT_POLICY": "PASSIVE", **os.environ, "OMP_NUM_THREADS": str(threads)}
        self._process = subprocess.Popen(
            [sys.executable, str(script), "--job", json.dumps(job)],
            env=environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def ask(self, limit: float) -> dict[str, Any]:
        """The next answer, empty where there is none within `limit` seconds or ever."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        watch = threading.Timer(limit, self._process.kill)
        watch.start()
        try:
            self._process.stdin.write("\n")
            self._process.stdin.flush()
            answer: dict[str, Any] = json.loads(self._process.stdout.readline() or "{}")
        except BrokenPipeError:
            return {}
        finally:
            watch.cancel()
        return answer

    def end(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.communicate()


def serve(answers: Iterator[Mapping[str, Any]]) -> None:
    """Print the next of these, as JSON, for each line on standard input."""
    for _ in sys.stdin:
        print(json.dumps(next(answers)), flush=True)


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
