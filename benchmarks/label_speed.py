"""How fast the light labels of LDEnhancer's training are made: 256x256 pictures a second.

    python benchmarks/label_speed.py [--images 48] [--repeats 5] [--threads 1,2]
        [--update docs/training.md] [--json]

takes frames of the bundled `night_mini` and makes their labels with so many threads, as
`--set workers=N` of `nat-bench train` does; then the same with reading the files and keeping
pictures with labels as PNG. Best of the repeats. Where other work runs beside it the wall clock
says little; the processor time of a picture holds then, with the cores that it got.
"""

import argparse
import json
import os
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
from side_by_side import update

MARKERS = ("<!-- label speed: begin -->", "<!-- label speed: end -->")
SIZE = 256


def night_pictures(count: int) -> list[Any]:
    """Frames of the bundled sample, spread over it, uint8 (256, 256, 3) RGB."""
    import cv2

    from nat2024 import load_dataset

    places = [(one, index) for one in load_dataset("night_mini") for index in range(len(one))]
    chosen = np.linspace(0, len(places) - 1, count).astype(int)
    frames = (places[number][0].image(places[number][1]) for number in chosen)
    small = (cv2.resize(one, (SIZE, SIZE), interpolation=cv2.INTER_AREA) for one in frames)
    return [np.ascontiguousarray(one[..., ::-1]) for one in small]


def best_of(repeats: int, call: Callable[[], object]) -> tuple[float, float]:
    """Least seconds of the wall clock and of the processor, each over all repeats."""
    walls, used = [], []
    for _ in range(repeats):
        wall, processor = time.perf_counter(), time.process_time()
        call()
        walls.append(time.perf_counter() - wall)
        used.append(time.process_time() - processor)
    return min(walls), min(used)


def measure_labels(pictures: Sequence[Any], threads: int, repeats: int) -> tuple[float, float]:
    """Seconds for the labels of all pictures, one a call."""
    import torch

    from nat2024_enhancers.ldenhancer.light_label import light_labels

    batches = [torch.from_numpy(one.transpose(2, 0, 1)[None] / np.float32(255)) for one in pictures]
    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(light_labels, batches[:threads]))  # the first call finds its plans
        return best_of(repeats, lambda: list(pool.map(light_labels, batches)))


def measure_preparation(pictures: Sequence[Any], threads: int, repeats: int) -> tuple[float, float]:
    """Seconds for reading all pictures, making their labels and keeping both on disk."""
    import cv2

    from nat2024 import create_enhancer
    from nat2024.enhancing.training import PictureSettings
    from nat2024.enhancing.training.pictures import PictureStore, find_shots

    enhancer: Any = create_enhancer("ldenhancer", weights=False)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "pictures").mkdir()
        for number, picture in enumerate(pictures):
            cv2.imwrite(str(folder / "pictures" / f"{number:04}.png"), picture[..., ::-1])
        shots = find_shots(folder / "pictures", None, 1)[1]
        rounds = iter(range(repeats))

        def prepare() -> None:
            kept = folder / f"kept{next(rounds)}"
            store = PictureStore(shots, PictureSettings(size=SIZE), enhancer.targets, kept)
            store.prepare(threads, lambda _done, _what: None)

        return best_of(repeats, prepare)


def run(given: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """All rows of the table."""
    pictures = night_pictures(given.images)
    for threads in given.threads:
        for work, measure in (
            ("labels", measure_labels),
            ("labels, with reading and keeping", measure_preparation),
        ):
            wall, processor = measure(pictures, threads, given.repeats)
            yield {
                "work": work,
                "threads": threads,
                "processor_ms": 1000 * processor / len(pictures),
                "per_second_on_own_cores": threads * len(pictures) / processor,
                "per_second": len(pictures) / wall,
                "cores_got": processor / wall,
            }


def table_of(rows: Sequence[dict[str, Any]]) -> str:
    """The rows in Markdown."""
    lines = [
        "| work | threads | processor ms a picture | a second, where each thread has a core "
        "| a second, measured | cores that were free |",
        "| --- | ---: | ---: | ---: | ---: | ---: |",
    ]
    for row in rows:
        lines.append(
            f"| {row['work']} | {row['threads']} | {row['processor_ms']:.1f} "
            f"| {row['per_second_on_own_cores']:.0f} | {row['per_second']:.0f} "
            f"| {row['cores_got']:.2f} |"
        )
    return "\n".join(lines)


def main() -> None:
    """Measure, print, and update a page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--images", type=int, default=48)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--threads", default="1,2", help="with commas")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--update", type=Path, help="page whose table to replace")
    given = parser.parse_args()
    given.threads = [int(one) for one in given.threads.split(",")]
    os.environ["OMP_NUM_THREADS"] = "1"  # before torch: each thread of the pool computes alone
    rows = list(run(given))
    table = table_of(rows)
    if given.update is not None:
        text = given.update.read_text(encoding="utf-8")
        given.update.write_text(update(text, table, MARKERS), encoding="utf-8")
    print(json.dumps({"rows": rows}) if given.json else table)


if __name__ == "__main__":
    main()
