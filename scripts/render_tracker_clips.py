"""Render the night clips that the compact tracker trains on, or chooses its constants by.

    python scripts/render_tracker_clips.py FOLDER [--clips 140] [--first-seed 410000] [--frames 12]
        [--photographs FOLDER] [--dense]

writes `data_seq/NAME/*.jpg` and `anno/NAME.txt`, which any loader of the toolkit reads. A clip is
a few frames out of 60, in order, or with `--dense` consecutive ones; frames that hardly show the
target have no box. The seeds of `night_mini` are refused. Clips that are there are kept, so an
interrupted call goes on.
"""

import argparse
from pathlib import Path

import cv2
import numpy as np

from nat2024.boxes import write_boxes
from nat2024.night import NightSequence, NightSettings
from nat2024.night.ground import reflectance
from nat2024.night.sample import SEEDS
from nat2024.night.sequence import KINDS

_SPAN = 60
_SIZES = ((480, 270), (480, 270), (640, 360))


def main() -> None:
    """Render what is missing."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--clips", type=int, default=140)
    parser.add_argument("--first-seed", type=int, default=410_000)
    parser.add_argument("--frames", type=int, default=12)
    parser.add_argument("--photographs", type=Path)
    parser.add_argument("--dense", action="store_true")
    given = parser.parse_args()
    seeds = range(given.first_seed, given.first_seed + given.clips)
    if set(seeds) & set(SEEDS):
        parser.error("these seeds belong to the sample night_mini")
    photographs = sorted(given.photographs.glob("*.jpg")) if given.photographs else []
    for number, seed in enumerate(seeds):
        render(given.folder, number, seed, given.frames, photographs, dense=given.dense)


def render(
    base: Path, number: int, seed: int, frames: int, photographs: list[Path], *, dense: bool
) -> None:
    """Render one clip; its boxes are written last and tell that it is whole."""
    rng = np.random.default_rng([seed, 55])
    kind = KINDS[number % len(KINDS)]
    name = f"{kind}_{seed}"
    truth = base / "anno" / f"{name}.txt"
    if truth.exists():
        return
    used = photographs and rng.random() < 0.5
    chosen = rng.choice(len(photographs), size=3) if used else []
    mean = float(np.exp(rng.uniform(np.log(0.04), np.log(0.3)))) if rng.random() < 0.5 else None
    sequence = NightSequence(
        NightSettings(
            kind,
            _SPAN,
            _SIZES[int(rng.integers(len(_SIZES)))],
            seed=seed,
            mean=mean,
            photographs=tuple(reflectance(cv2.imread(str(photographs[i])), rng) for i in chosen),
        )
    )
    wanted = range(frames) if dense else np.sort(rng.choice(_SPAN, size=frames, replace=False))
    folder = base / "data_seq" / name
    folder.mkdir(parents=True, exist_ok=True)
    boxes = []
    for place, index in enumerate(wanted, 1):
        frame = sequence.frame(int(index))
        quality = [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(45, 96))]
        cv2.imwrite(str(folder / f"{place:05d}.jpg"), frame.image, quality)
        seen = frame.visible > 0.6 or dense
        boxes.append(frame.box if seen else np.full(4, np.nan))
    truth.parent.mkdir(exist_ok=True)
    write_boxes(truth, np.stack(boxes))


if __name__ == "__main__":
    main()
