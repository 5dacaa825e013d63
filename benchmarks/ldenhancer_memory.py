"""Peak memory and time of LDEnhancer on one frame, in this (fresh) process.

    python benchmarks/ldenhancer_memory.py [--width 1920] [--height 1080] [--threads 1]
        [--weights PATH]

Prints one JSON object: resident memory in MB after loading the model and at the peak, what the
frame added, and seconds for the first and the second frame.
"""

import argparse
import json
import resource
import sys
import time
from pathlib import Path

import numpy as np
import torch

from nat2024.registry import create_enhancer


def peak_resident_mb() -> float:
    """Highest resident memory of this process so far, in MB (10^6 bytes)."""
    status = Path("/proc/self/status")
    if status.exists():
        # ru_maxrss survives exec on Linux: it would begin at the peak of whoever started us.
        for line in status.read_text().splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) * 1024 / 1e6
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e6


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--width", type=int, default=1920)
    parser.add_argument("--height", type=int, default=1080)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--weights", default="")
    given = parser.parse_args()
    torch.set_num_threads(given.threads)
    enhancer = create_enhancer("ldenhancer", weights=given.weights or False)
    random = np.random.default_rng(0)
    frame = random.integers(0, 64, (given.height, given.width, 3), dtype=np.uint8)
    loaded = peak_resident_mb()
    seconds = []
    for _ in range(2):
        start = time.perf_counter()
        enhancer.enhance(frame, bgr=True)
        seconds.append(round(time.perf_counter() - start, 3))
    peak = peak_resident_mb()
    report = {
        "frame": f"{given.width}x{given.height}",
        "threads": given.threads,
        "loaded_mb": round(loaded),
        "peak_mb": round(peak),
        "added_mb": round(peak - loaded),
        "first_s": seconds[0],
        "second_s": seconds[1],
    }
    print(json.dumps(report))


if __name__ == "__main__":
    main()
