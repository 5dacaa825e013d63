"""Ctrl-C stops at once, whatever the number of workers, and keeps what is finished."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

SLOW = """
import time
from nat2024 import Tracker, register_tracker
from nat2024.cards import Card

@register_tracker("slow")
class Slow(Tracker):
    card = Card(title="Slow", summary="")

    def start(self, image, box):
        self.box = box
        return box

    def advance(self, image):
        time.sleep(0.1 if self.box[2] < 20 else 60)
        return self.box, 0.0
"""


def hear_interrupts() -> None:
    """In the new process: what a shell has started in the background ignores Ctrl-C."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.mark.parametrize(
    "how",
    [
        ["--timeout", "600"],  # one worker
        pytest.param(["--workers", "1"], marks=pytest.mark.slow),
        pytest.param(["--workers", "2"], marks=pytest.mark.slow),
    ],
    ids="-".join,
)
def test_interrupt(night_clip: Path, tmp_path: Path, how: list[str]) -> None:
    (tmp_path / "slow.py").write_text(SLOW)
    words = ["run", "--tracker", "slow", "--plugin", str(tmp_path / "slow.py"), "--device", "cpu"]
    more = ["--dataset", str(night_clip), "--results", str(tmp_path), *how]
    process = subprocess.Popen(
        [sys.executable, "-m", "nat2024", *words, *more],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
        preexec_fn=hear_interrupts,
    )
    folder = tmp_path / "night_clip" / "slow"
    while process.poll() is None and len(list(folder.glob("*.txt"))) < 2:
        time.sleep(0.01)
    begun = time.monotonic()
    os.killpg(process.pid, signal.SIGINT)
    out, err = process.communicate(timeout=30)
    assert time.monotonic() - begun < 10
    assert process.returncode == 130
    assert out == b""
    assert err.decode().split("\n")[1:-1] == ["nat-bench: stopped; what was finished is kept"]
    assert sorted(p.name for p in folder.glob("*.txt")) == ["narrow.txt", "tall.txt"]


def test_an_interrupt_while_workers_are_started_is_not_lost() -> None:
    from nat2024.engine.workers import born_deaf_to_interrupts

    code = "import signal, sys; sys.exit(signal.SIGINT in signal.pthread_sigmask(0, []))"
    handler = signal.signal(signal.SIGINT, signal.default_int_handler)
    heard = []
    try:
        with born_deaf_to_interrupts():
            deaf = subprocess.run([sys.executable, "-S", "-c", code], check=False).returncode
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.05)
    except KeyboardInterrupt:
        heard.append("interrupt")
    finally:
        signal.signal(signal.SIGINT, handler)
    assert (deaf, heard) == (1, ["interrupt"])
