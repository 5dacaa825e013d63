"""How fast night sequences are rendered: frames a second, from the settings to JPEG bytes.

    python benchmarks/render_speed.py [--frames 90] [--size 640x360] [--sequences 14] [--workers 2]

renders sequences of all kinds of targets, as many at a time as there are workers, and prints the
frames a second of each and of all together, the laying out of scenes included.
"""

import argparse
import multiprocessing
import time
from concurrent.futures import ProcessPoolExecutor


def render(job: tuple[int, int, int, int]) -> tuple[str, float, float]:
    """Render one sequence; gives its target, and seconds to lay it out and to render it."""
    import cv2

    from nat2024.night import NightSequence, NightSettings
    from nat2024.night.sequence import KINDS

    seed, frames, width, height = job
    cv2.setNumThreads(1)
    start = time.perf_counter()
    kind = KINDS[seed % len(KINDS)]
    sequence = NightSequence(NightSettings(kind, frames=frames, size=(width, height), seed=seed))
    ready = time.perf_counter()
    for frame in sequence:
        cv2.imencode(".jpg", frame.image, [cv2.IMWRITE_JPEG_QUALITY, sequence.sensor.quality])
    return kind, ready - start, time.perf_counter() - ready


def main() -> None:
    """Render and count."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--frames", type=int, default=90)
    parser.add_argument("--size", default="640x360")
    parser.add_argument("--sequences", type=int, default=14)
    parser.add_argument("--workers", type=int, default=2)
    given = parser.parse_args()
    width, height = (int(side) for side in given.size.split("x"))
    jobs = [(seed, given.frames, width, height) for seed in range(given.sequences)]
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(given.workers, mp_context=context) as pool:
        list(pool.map(render, [(99, 2, 64, 64)] * given.workers))  # workers import first
        start = time.perf_counter()
        for kind, layout, rest in pool.map(render, jobs):
            print(f"{kind:8s} laid out in {layout:.2f} s, then {given.frames / rest:6.1f} frames/s")
        rate = given.frames * given.sequences / (time.perf_counter() - start)
    print(f"all      {rate:.1f} frames/s with {given.workers} workers, laying out included")


if __name__ == "__main__":
    main()
