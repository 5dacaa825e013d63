"""The enhancer weights that come with the package beside the authors'.

    python benchmarks/bundled_enhancers.py --images FOLDER [--images FOLDER] [--every 6]
        [--official ldenhancer=model.pth] [--official dcepp=Epoch99.pth]
        [--sequences FOLDER --nanotrack FOLDER] [--only dcepp] [--keep results.json] [--json]
        [--update docs/bundled-weights.md]

Images are night images, brought to 256x256; FOLDER of sequences has `data_seq`, and `anno` with a
box for every frame or `anno_keyframes` with lines `frame,x,y,w,h`; NanoTrack v3 and v2
(`nanotrackv3.pth`, `nanotrackv2.pth`) run over those named by `--track`, the enhancer on their
crops; where every frame has a box also from five places for 80 frames each, since from one start
alone chance decides more than the weights do. What was measured is kept in `--keep` by the digest
of the weights, so that another call measures only what is new. The tables go to standard output,
and with `--update` into a page.
"""

import argparse
import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from side_by_side import update

MARKERS = (
    ("<!-- images: begin -->", "<!-- images: end -->"),
    ("<!-- tracking: begin -->", "<!-- tracking: end -->"),
)
LINES: tuple[tuple[str, str, dict[str, Any]], ...] = (
    ("none", "none", {}),
    ("ldenhancer, authors'", "ldenhancer", {"weights": "official"}),
    ("ldenhancer, default", "ldenhancer", {"preset": "default"}),
    ("ldenhancer, adaptive", "ldenhancer", {"preset": "adaptive"}),
    ("ldenhancer, bright", "ldenhancer", {"preset": "bright"}),
    ("dcepp, authors'", "dcepp", {"weights": "official"}),
    ("dcepp, bundled", "dcepp", {"weights": "bundled"}),
)
DARK = 50
TRACKERS = ("v3", "v2")
STARTS, WINDOW = 5, 80
LUMINANCE = np.array([0.299, 0.587, 0.114], dtype=np.float32)


@dataclass(frozen=True)
class Line:
    """One enhancer of the tables; `official` holds the authors' files by plugin."""

    title: str
    name: str
    how: Mapping[str, Any]

    def create(self, official: Mapping[str, Path]) -> Any:
        """The enhancer; None where it needs a file that is not given."""
        from nat2024 import create_enhancer
        from nat2024.zoo import find_bundled

        how = dict(self.how)
        if how.get("weights") == "official":
            if self.name not in official:
                return None
            how["weights"] = official[self.name]
        elif how.get("weights") == "bundled":  # whatever the user has registered
            card = create_enhancer(self.name, weights=False).card
            how["weights"] = find_bundled(self.name, card)
        return create_enhancer(self.name, **how)


def night_images(folders: Sequence[Path], every: int) -> list[Any]:
    """Images of folders, uint8 (256, 256, 3) RGB; of folders with many every `every`-th."""
    import cv2

    found = []
    for folder in folders:
        paths = sorted(p for p in folder.iterdir() if p.suffix in (".jpg", ".jpeg", ".png"))
        for path in paths[:: every if len(paths) > 60 else 1]:
            image = cv2.imread(str(path))
            small = cv2.resize(image, (256, 256), interpolation=cv2.INTER_AREA)
            found.append(small[..., ::-1].copy())
    return found


def measure_images(enhancer: Any, images: Sequence[Any]) -> dict[str, Any]:
    """Light, over-enhancement, noise, colour and adaptivity over all images."""
    from nat2024.images import image_to_batch
    from nat2024.measures.adaptivity import measure_adaptivity
    from nat2024.measures.enhancement import mean_measures, measure_enhancement

    outputs = [
        enhancer.enhance_batch(image_to_batch(image))[0].permute(1, 2, 0).numpy()
        for image in images
    ]
    befores = [image.astype(np.float32) / 255 for image in images]
    dark, bright, saturated, casts = [], [], [], []
    for before, after in zip(befores, outputs, strict=True):
        old, new = before @ LUMINANCE, after @ LUMINANCE
        dark.append((new - old)[old < DARK / 255])
        bright.append((after.mean(axis=2) - before.mean(axis=2))[before.mean(axis=2) > 0.7])
        saturated.append(np.mean(after.max(axis=2) > 0.97))
        casts.append(np.abs(_chromaticity(after) - _chromaticity(before)).sum())
    rows = [
        measure_enhancement(image, np.rint(after * 255).astype(np.uint8)).as_row()
        for image, after in zip(images, outputs, strict=True)
    ]
    step = max(1, len(images) // 24)
    adaptivity = measure_adaptivity(list(zip(befores, outputs, strict=True))[::step][:24])
    risen = np.concatenate(bright)
    return {
        "dark_gain": 255 * float(np.concatenate(dark).mean()),
        "over_enhanced": float(np.mean(risen > 1.001 / 255)),
        "bright_rise": float(risen.mean()),
        "saturated": float(np.mean(saturated)),
        "noise_gain": mean_measures(rows)["noise_gain"],
        "cast": float(np.mean(casts)),
        "explained": adaptivity.explained,
        "verdict": adaptivity.verdict,
    }


def _chromaticity(image: Any) -> Any:
    means = image.mean(axis=(0, 1))
    return means / max(float(means.sum()), 1e-6)


@dataclass(frozen=True)
class Video:
    """A sequence, and boxes of some of its frames by 0-based number."""

    name: str
    frames: tuple[Path, ...]
    boxes: Mapping[int, Any]


def read_video(folder: Path, name: str) -> Video:
    """Read a sequence with a box for every frame, or with key frames."""
    from nat2024.boxes import read_boxes

    frames = tuple(sorted((folder / "data_seq" / name).glob("*.jpg")))
    every = folder / "anno" / f"{name}.txt"
    if every.is_file():
        return Video(name, frames, dict(enumerate(read_boxes(every))))
    rows = np.loadtxt(folder / "anno_keyframes" / f"{name}.txt", delimiter=",", ndmin=2)
    return Video(name, frames, {int(row[0]) - 1: row[1:5] for row in rows})


def measure_tracking(enhancer: Any, video: Video, weights: Path, variant: str) -> dict[str, float]:
    """Success AUC, precision at 20 pixels and median distance of centres, where there are boxes."""
    from nat2024 import create_tracker, evaluate_boxes

    tracker = create_tracker("nanotrack", weights=weights, variant=variant, enhancer=enhancer)
    rows, truth = _follow(tracker, video, 0, len(video.frames))
    scores = evaluate_boxes(rows, truth)
    centres = rows[:, :2] + rows[:, 2:] / 2 - truth[:, :2] - truth[:, 2:] / 2
    return {
        "auc": float(scores.success_auc),
        "precision_20": float(scores.precision_20),
        "distance": float(np.median(np.hypot(*centres.T))),
    }


def measure_starts(enhancer: Any, video: Video, weights: Path, variant: str) -> dict[str, Any]:
    """Success AUC from several places of a sequence: their mean, and each."""
    from nat2024 import create_tracker, evaluate_boxes

    tracker = create_tracker("nanotrack", weights=weights, variant=variant, enhancer=enhancer)
    window = min(WINDOW, len(video.frames))
    aucs = []
    for start in np.linspace(0, len(video.frames) - window, STARTS).astype(int).tolist():
        rows, truth = _follow(tracker, video, start, start + window)
        aucs.append(float(evaluate_boxes(rows, truth).success_auc))
    return {"mean": float(np.mean(aucs)), "aucs": aucs}


def _follow(tracker: Any, video: Video, start: int, stop: int) -> tuple[Any, Any]:
    """Boxes that a tracker finds in frames `start` to `stop`, and the true ones where known."""
    import cv2

    found = {start: tracker.init(cv2.imread(str(video.frames[start])), video.boxes[start])}
    for number in range(start + 1, stop):
        found[number] = tracker.update(cv2.imread(str(video.frames[number])))[0]
    known = [number for number in range(start, stop) if number in video.boxes]
    rows = np.array([found[number] for number in known])
    return rows, np.array([video.boxes[number] for number in known])


class Kept:
    """Results by what they were measured on; written after each."""

    def __init__(self, path: Path | None) -> None:
        self.path = path
        self.results: dict[str, Any] = {}
        self._read()

    def _read(self) -> None:
        if self.path is not None and self.path.is_file():
            self.results |= json.loads(self.path.read_text())

    def get(self, key: str, measure: Any) -> Any:
        """What is known under a key, else what `measure()` gives."""
        if key not in self.results:
            found = measure()
            print(f"{key}: {found}", file=sys.stderr)
            self._read()  # another process may have added to it
            self.results[key] = found
            if self.path is not None:
                self.path.write_text(json.dumps(self.results, indent=1))
        return self.results[key]


def run(given: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """Measure all lines, one row each."""
    kept = Kept(given.keep)
    official = {key: Path(path) for key, _, path in (one.partition("=") for one in given.official)}
    images = night_images(given.images, given.every)
    names = given.track.split(",") if given.sequences else []
    videos = [read_video(given.sequences, name) for name in names]
    for line in (Line(*parts) for parts in LINES if given.only in parts[0]):
        enhancer = line.create(official)
        if enhancer is None:
            print(f"{line.title}: left out, it needs --official", file=sys.stderr)
            continue
        digest = enhancer.weights.sha256[:16] if enhancer.weights else "none"
        row: dict[str, Any] = {"enhancer": line.title}
        key = f"{line.name} {digest} {len(images)} images"
        row |= kept.get(key, lambda used=enhancer: measure_images(used, images))
        for variant in TRACKERS if given.nanotrack else ():
            weights = given.nanotrack / f"nanotrack{variant}.pth"
            for video in videos:
                used = None if line.name == "none" else enhancer
                task = (used, video, weights, variant)
                key = f"{line.name} {digest} nanotrack {variant} {video.name}"
                found = dict(kept.get(key, lambda task=task: measure_tracking(*task)))
                if len(video.boxes) == len(video.frames):
                    starts = kept.get(f"{key} starts", lambda task=task: measure_starts(*task))
                    found["starts"] = starts["mean"]
                row[f"{variant} {video.name}"] = found
        yield row


def image_table(rows: Sequence[Mapping[str, Any]]) -> str:
    """What happens to images, in Markdown."""
    gains = {row["enhancer"]: row["dark_gain"] for row in rows}
    lines = [
        "| weights | gain of dark pixels | of the authors' | bright pixels risen | their rise "
        "| saturated | noise | cast | one curve explains | verdict |",
        "| --- " + "| ---: " * 8 + "| --- |",
    ]
    for row in rows:
        reference = gains.get(row["enhancer"].partition(",")[0] + ", authors'", 0)
        share = f"{row['dark_gain'] / reference:.0%}" if reference else "-"
        numbers = (
            f"{row['dark_gain']:.1f} | {share} | {row['over_enhanced']:.1%} "
            f"| {row['bright_rise']:.3f} | {row['saturated']:.2%} | {row['noise_gain']:.2f} "
            f"| {row['cast']:.3f} | {row['explained']:.4f}"
        )
        lines.append(f"| {row['enhancer']} | {numbers} | {row['verdict']} |")
    return "\n".join(lines).replace("| nan |", "| - |")


COLUMNS = {
    "auc": ("AUC", ".3f"),
    "starts": (f"AUC of {STARTS} starts", ".3f"),
    "precision_20": ("P20", ".3f"),
    "distance": ("distance", ".1f"),
}


def tracking_table(rows: Sequence[Mapping[str, Any]]) -> str:
    """What a tracker makes of it, in Markdown, a table for each sequence."""
    runs = [key for key in rows[0] if key.partition(" ")[0] in TRACKERS]
    sequences = dict.fromkeys(run.partition(" ")[2] for run in runs)
    return "\n\n".join(
        _tracking_table(rows, name, [run for run in runs if run.endswith(f" {name}")])
        for name in sequences
    )


def _tracking_table(rows: Sequence[Mapping[str, Any]], sequence: str, runs: Sequence[str]) -> str:
    shown = [(run, key) for run in runs for key in COLUMNS if key in rows[0][run]]
    heads = [f"{run.partition(' ')[0]}: {COLUMNS[key][0]}" for run, key in shown]
    lines = [
        f"| {sequence} | " + " | ".join(heads) + " |",
        "| --- " + "| ---: " * len(heads) + "|",
    ]
    for row in rows:
        fields = [format(row[run][key], COLUMNS[key][1]) for run, key in shown]
        lines.append(f"| {row['enhancer']} | " + " | ".join(fields) + " |")
    return "\n".join(lines)


def main() -> None:
    """Measure, print, and update a page."""
    from nat2024 import NatBenchError
    from nat2024.engine.workers import computing_threads

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--images", type=Path, action="append", required=True)
    parser.add_argument("--every", type=int, default=6, help="of a folder of more than 60 images")
    parser.add_argument("--official", action="append", default=[], metavar="NAME=PATH")
    parser.add_argument("--sequences", type=Path, help="folder of the sequences")
    parser.add_argument("--track", default="uavdt_S1301a,night_person11", help="their names")
    parser.add_argument("--nanotrack", type=Path, help="folder of the published files")
    parser.add_argument("--only", default="", help="lines whose title has this in it")
    parser.add_argument("--keep", type=Path, help="file of what was measured")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--update", type=Path, help="page whose tables to replace")
    given = parser.parse_args()
    if (given.sequences is None) != (given.nanotrack is None):
        parser.error("--sequences and --nanotrack go together")
    try:
        with computing_threads(1):
            rows = list(run(given))
    except NatBenchError as error:
        sys.exit(str(error))
    tables = [image_table(rows), *([tracking_table(rows)] if given.nanotrack else [])]
    if given.update is not None:
        text = given.update.read_text(encoding="utf-8")
        for table, markers in zip(tables, MARKERS, strict=False):
            text = update(text, table, markers)
        given.update.write_text(text, encoding="utf-8")
    print(json.dumps({"rows": rows}) if given.json else "\n\n".join(tables))


if __name__ == "__main__":
    main()
