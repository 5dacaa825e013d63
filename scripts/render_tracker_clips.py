"""Render the night clips that the compact tracker trains on, or chooses its constants by.

    python scripts/render_tracker_clips.py FOLDER [--clips 380] [--first-seed 410000] [--frames 8]
        [--photographs FOLDER] [--hidden 0.5] [--dense] [--processes 1]

writes `data_seq/NAME/*.jpg` and `anno/NAME.txt`, which any loader of the toolkit reads. A clip is
a few frames out of 60, in order, or with `--dense` consecutive ones. In a share `--hidden` of them
trees hide the target, or it leaves the view, or both. Frames without the target have no box; those
that show less than 0.3 of it are left out, unless `--dense`. The seeds of `night_mini` are refused.
Clips that are there are kept, so an interrupted call goes on.
"""

import argparse
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

import cv2
import numpy as np

from nat2024.boxes import write_boxes
from nat2024.night import NightFrame, NightSequence, NightSettings
from nat2024.night.ground import reflectance
from nat2024.night.sample import SEEDS
from nat2024.night.sequence import KINDS

_SPAN = 60
_SIZE = (480, 270)
_VISIBLE, _ABSENT = 0.3, 0.05
"""Share of a target above which frames have a box, and below which it counts as absent."""

_HIDINGS = (
    {"occlusion": "partial"},
    {"occlusion": "full"},
    {"out_of_view": True},
    {"occlusion": "partial", "out_of_view": True},
)


def main() -> None:
    """Render what is missing."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--clips", type=int, default=380)
    parser.add_argument("--first-seed", type=int, default=410_000)
    parser.add_argument("--frames", type=int, default=8)
    parser.add_argument("--photographs", type=Path)
    parser.add_argument("--hidden", type=float, default=0.5)
    parser.add_argument("--dense", action="store_true")
    parser.add_argument("--processes", type=int, default=1)
    given = parser.parse_args()
    seeds = range(given.first_seed, given.first_seed + given.clips)
    if set(seeds) & set(SEEDS):
        parser.error("these seeds belong to the sample night_mini")
    with ProcessPoolExecutor(given.processes) as pool:
        list(pool.map(partial(render, given), range(given.clips), chunksize=4))


def render(given: argparse.Namespace, number: int) -> None:
    """Render one clip; its boxes are written last and tell that it is whole."""
    cv2.setNumThreads(1)
    seed, kind = given.first_seed + number, KINDS[number % len(KINDS)]
    truth = given.folder / "anno" / f"{kind}_{seed}.txt"
    if truth.exists():
        return
    rng = np.random.default_rng([seed, 55])
    sequence = NightSequence(draw_settings(rng, given, kind, seed))
    folder = given.folder / "data_seq" / truth.stem
    folder.mkdir(parents=True, exist_ok=True)
    boxes: list[np.ndarray] = []
    for index in range(given.frames) if given.dense else rng.permutation(_SPAN).tolist():
        frame = sequence.frame(index)
        if not given.dense and _ABSENT < frame.visible < _VISIBLE:
            continue
        boxes.append(box_of(frame, dense=given.dense))
        quality = [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(40, 86))]
        cv2.imwrite(str(folder / f"{len(boxes):05d}.jpg"), frame.image, quality)
        if len(boxes) == given.frames:
            break
    truth.parent.mkdir(exist_ok=True)
    write_boxes(truth, np.stack(boxes))


def draw_settings(
    rng: np.random.Generator, given: argparse.Namespace, kind: str, seed: int
) -> NightSettings:
    """A sequence by chance: how dark, how hidden, with which photographs on its grounds."""
    photographs = sorted(given.photographs.glob("*.jpg")) if given.photographs else []
    is_used = len(photographs) > 0 and rng.random() < 0.5
    chosen = rng.choice(len(photographs), size=3) if is_used else []
    mean = float(np.exp(rng.uniform(np.log(0.04), np.log(0.3)))) if rng.random() < 0.5 else None
    hiding = _HIDINGS[int(rng.integers(len(_HIDINGS)))] if rng.random() < given.hidden else {}
    surfaces = tuple(reflectance(cv2.imread(str(photographs[i])), rng) for i in chosen)
    return NightSettings(kind, _SPAN, _SIZE, seed=seed, mean=mean, photographs=surfaces, **hiding)


def box_of(frame: NightFrame, *, dense: bool) -> np.ndarray:
    """The target's box, NaN where it is not seen."""
    is_there = dense or frame.visible >= _VISIBLE
    return frame.box if is_there else np.full(4, np.nan)


if __name__ == "__main__":
    main()
