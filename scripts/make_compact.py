"""Make the bundled weights of `siamrpnpp`, variant `compact`, from photographs alone.

    python scripts/make_compact.py OUT --photographs PHOTOGRAPHS [--processes 15] [--share 1.0]

renders the clips, trains, renders others and goes on training with them, as it was done for the
shipped file; OUT/second/compact_128.safetensors is the result. On CUDA if any, else CPU. Stopped
and called again, it goes on. `--share 0.1` makes a tenth of the steps.
"""

import argparse
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parent
FIRST = {"clips": 600, "first_seed": 410_000, "steps": 11_851, "rate": 3e-3, "seed": 0}
SECOND = {"clips": 450, "first_seed": 410_600, "steps": 6_951, "rate": 1.5e-3, "seed": 10}


def main() -> None:
    """Both stretches."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--photographs", type=Path, required=True)
    parser.add_argument("--processes", type=int, default=max(1, (os.cpu_count() or 2) - 1))
    parser.add_argument("--share", type=float, default=1.0)
    given = parser.parse_args()
    stretch(given, "first", FIRST, [])
    stretch(given, "second", SECOND, ["--start", given.out / "first" / "compact_128.safetensors"])


def stretch(
    given: argparse.Namespace, name: str, recipe: dict[str, float], more: list[str | Path]
) -> None:
    """Render the clips of one stretch and train on them."""
    clips = given.out / f"clips_{name}"
    shared = ["--photographs", given.photographs, "--processes", given.processes]
    call("render_tracker_clips.py", clips, "--clips", recipe["clips"], "--first-seed",
         recipe["first_seed"], *shared)  # fmt: skip
    steps = max(1, round(recipe["steps"] * given.share))
    call("train_compact.py", given.out / name, "--clips", clips, "--steps", steps, "--rate",
         recipe["rate"], "--seed", recipe["seed"], *shared, *more)  # fmt: skip


def call(script: str, *words: object) -> None:
    """Run a script that lies beside this one."""
    subprocess.run([sys.executable, ROOT / script, *map(str, words)], check=True)


if __name__ == "__main__":
    main()
