"""Throw broken and hostile files at everything that reads files of strangers.

    python -m benchmarks.fuzz [--seconds 60] [--target NAME] [--engine hypothesis|atheris]

Each target gets an equal share of the time, in a process of its own with limited memory, so that
crashes and hangs of native libraries and floods of memory are found too. What is found is in
`.cache/fuzz/TARGET-DIGEST` and named at the end with its error; exit status 1 says that there is
something. `atheris` (coverage-guided, `pip install atheris`) is used where it is installed.
"""

import argparse
import contextlib
import hashlib
import importlib.util
import re
import subprocess
import sys
import time
import traceback
from pathlib import Path

from benchmarks.fuzz.seeds import seeds_of
from benchmarks.fuzz.targets import TARGETS, quiet

_OUT = Path(".cache/fuzz")
_BATCH = 200
_SLOW_SECONDS = 20.0
"""A small file that takes longer is a fault."""

_GRACE_SECONDS = 60.0


def main() -> int:
    """Run all targets in turn; status 1 where something was found."""
    asked = _arguments()
    quiet()
    if asked.within:
        _limit_memory(asked.memory)
        return _within(asked.target[0], asked.seconds, asked.engine, asked.seed)
    names = asked.target or list(TARGETS)
    found: list[str] = []
    for name in names:
        found += _apart(name, asked, asked.seconds / len(names))
    print(f"{len(names)} targets, {len(found)} faults")
    for line in found:
        print(line)
    return 1 if found else 0


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.fuzz", description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0, help="for all targets together")
    parser.add_argument("--target", action="append", choices=sorted(TARGETS))
    has_atheris = importlib.util.find_spec("atheris") is not None
    default = "atheris" if has_atheris else "hypothesis"
    parser.add_argument("--engine", choices=("hypothesis", "atheris"), default=default)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--memory", type=int, default=4, help="GiB that a target may take")
    parser.add_argument("--within", action="store_true", help=argparse.SUPPRESS)
    return parser.parse_args()


def _limit_memory(gibibytes: int) -> None:
    """So that a flood of memory is an error here, and no trouble of the machine."""
    with contextlib.suppress(ImportError, ValueError):
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (gibibytes * 2**30, gibibytes * 2**30))


def _apart(name: str, asked: argparse.Namespace, seconds: float) -> list[str]:
    """One target in a process of its own; the faults as lines."""
    words = [sys.executable, "-m", "benchmarks.fuzz", "--within", "--target", name]
    words += ["--seconds", str(seconds), "--engine", asked.engine, "--seed", str(asked.seed)]
    words += ["--memory", str(asked.memory)]
    start = time.monotonic()
    try:
        done = subprocess.run(
            words, capture_output=True, text=True, check=False, timeout=seconds + _GRACE_SECONDS
        )
    except subprocess.TimeoutExpired:
        print(f"{name:20} {asked.engine:10} {time.monotonic() - start:6.1f} s hangs")
        return [f"fault {name}: hangs; {_OUT / f'{name}-last'}"]
    lines = [line for line in done.stdout.splitlines() if line.startswith("fault ")]
    tries = re.findall(r"^tries (\d+)", done.stdout, re.M) or re.findall(
        r"Done (\d+) runs", done.stderr
    )
    if done.returncode not in (0, 1):
        last = (done.stderr.strip().splitlines() or ["no word"])[-1]
        kept = next((line for line in done.stderr.splitlines() if "Test unit written" in line), "")
        lines.append(f"fault {name}: process ended with {done.returncode}: {last} {kept}")
    count = tries[-1] if tries else "?"
    print(
        f"{name:20} {asked.engine:10} {time.monotonic() - start:6.1f} s {count:>9} files"
        f" {len(lines)} faults"
    )
    return lines


def _within(name: str, seconds: float, engine: str, seed: int) -> int:
    found: dict[str, bytes] = {}
    count = _by_atheris if engine == "atheris" else _by_hypothesis
    print(f"tries {count(name, seconds, seed, found)}")
    for where, data in found.items():
        path = _keep(name, data)
        print(f"fault {name}: {where}; {path}", flush=True)
    return 1 if found else 0


def _keep(name: str, data: bytes) -> Path:
    _OUT.mkdir(parents=True, exist_ok=True)
    path = _OUT / f"{name}-{hashlib.sha256(data).hexdigest()[:12]}"
    path.write_bytes(data)
    return path


def _attempt(name: str, data: bytes, found: dict[str, bytes]) -> None:
    """Call a target; the smallest file of each kind of fault is kept."""
    from nat2024.errors import NatBenchError

    start = time.monotonic()
    try:
        with contextlib.suppress(NatBenchError):
            TARGETS[name](data)
        if time.monotonic() - start > _SLOW_SECONDS:
            msg = f"took {time.monotonic() - start:.0f} s"
            raise TimeoutError(msg)
    except Exception as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        where = f"{type(error).__name__} at {Path(last.filename).name}:{last.lineno}: {error}"[:200]
        key = where.split(": ", 1)[0]
        known = next((k for k in found if k.startswith(key)), None)
        if known is None or len(data) < len(found[known]):
            found.pop(known or "", None)
            found[where] = data


def _by_hypothesis(name: str, seconds: float, seed: int, found: dict[str, bytes]) -> int:
    import hypothesis
    from hypothesis import HealthCheck, Phase, given, settings

    from benchmarks.fuzz.mutations import near

    for data in seeds_of(name):  # imports what the target needs, before the clock runs
        _attempt(name, data, found)
    end = time.monotonic() + seconds
    count = 0
    for turn in range(10**6):

        @hypothesis.seed(seed * 10**6 + turn)
        @settings(
            max_examples=_BATCH,
            database=None,
            deadline=None,
            phases=[Phase.generate],
            suppress_health_check=list(HealthCheck),
        )
        @given(near(seeds_of(name)))
        def attempt(data: bytes) -> None:
            nonlocal count
            if time.monotonic() < end:
                count += 1
                _keep_last(name, data)
                _attempt(name, data, found)

        attempt()
        if time.monotonic() > end:
            break
    (_OUT / f"{name}-last").unlink(missing_ok=True)
    return count


def _keep_last(name: str, data: bytes) -> None:
    """The file at hand, so that it is there after a crash of the process."""
    _OUT.mkdir(parents=True, exist_ok=True)
    (_OUT / f"{name}-last").write_bytes(data)


def _by_atheris(name: str, seconds: float, seed: int, found: dict[str, bytes]) -> int:
    """Coverage-guided by libFuzzer; it leaves the process itself, so faults are told at once."""
    import os

    import atheris

    with atheris.instrument_imports(include=["nat2024", "nat2024_reports"]):
        for data in seeds_of(name):  # imports what the target needs
            _attempt(name, data, found)
    corpus = _OUT / "corpus" / name
    corpus.mkdir(parents=True, exist_ok=True)
    for data in seeds_of(name):
        (corpus / hashlib.sha256(data).hexdigest()[:12]).write_bytes(data)
    told: set[str] = set()

    def attempt(data: bytes) -> None:
        _attempt(name, data, found)
        for where in found.keys() - told:
            print(f"fault {name}: {where}; {_keep(name, found[where])}", flush=True)
        told.update(found)

    words = [f"-max_total_time={max(1, int(seconds))}", f"-seed={seed + 1}", "-rss_limit_mb=4096"]
    words += ["-timeout=20", f"-artifact_prefix={_OUT}{os.sep}{name}-", "-max_len=65536"]
    atheris.Setup([sys.argv[0], *words, str(corpus)], attempt)
    atheris.Fuzz()  # leaves the process; libFuzzer itself says how many files it tried
    return 0


if __name__ == "__main__":
    sys.exit(main())
