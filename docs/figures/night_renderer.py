"""Draw the picture of the night renderer: rendered frames, and how they measure.

    python docs/figures/night_renderer.py

renders 28 sequences at default settings and writes `night_renderer.png` beside this file. Above,
one frame of eight of them with the box of the target; below, eight statistics of three frames of
each, and the ranges (10th to 90th percentile) of real night frames.
"""

import json
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.patches import Rectangle

from nat2024.measures import night_statistics
from nat2024.night import NightFrame, NightSequence, NightSettings
from nat2024.night.sequence import KINDS

HERE = Path(__file__).parent
RANGES = HERE.parents[1] / "tests" / "data" / "night_ranges.json"
SEEDS = range(200, 228)
SHOWN = (200, 205, 208, 210, 214, 218, 223, 225)
TITLES = {
    "mean": "mean",
    "p50": "median",
    "p99": "99th percentile",
    "p99_9": "99.9th percentile",
    "saturated_share": "saturated share",
    "local_contrast": "local contrast",
    "unevenness": "light unevenness",
    "noise_sigma": "noise",
}
REAL = (
    ("first_frames", "#009e73", "22 real first frames"),
    ("other_frames", "#cc79a7", "81 others"),
)


def main() -> None:
    """Render, measure, draw."""
    shown, measured = [], []
    for seed in SEEDS:
        settings = NightSettings(KINDS[seed % len(KINDS)], frames=60, seed=seed)
        sequence = NightSequence(settings)
        frames = [sequence.frame(index) for index in (0, 30, 59)]
        measured.append([night_statistics(frame.image) for frame in frames])
        if seed in SHOWN:
            shown.append((settings.target, frames[1]))
    figure = plt.figure(figsize=(12, 5.7), layout="constrained")
    above, below = figure.subfigures(2, 1, height_ratios=[3.1, 1.5])
    draw_frames(above, shown)
    draw_measures(below, measured, json.loads(RANGES.read_text(encoding="utf-8")))
    figure.savefig(HERE / "night_renderer.png", dpi=100)


def draw_frames(figure: "mpl.figure.FigureBase", shown: list[tuple[str, NightFrame]]) -> None:
    """Frames in two rows, the target in its box."""
    for axis, (target, frame) in zip(figure.subplots(2, 4).flat, shown, strict=True):
        axis.imshow(frame.image[..., ::-1])
        axis.set_axis_off()
        axis.set_title(target, fontsize=8, loc="left", pad=2)
        if np.isfinite(frame.box).all():
            x, y, w, h = frame.box
            axis.add_patch(Rectangle((x - 2, y - 2), w + 4, h + 4, fill=False, edgecolor="red"))


def draw_measures(
    figure: "mpl.figure.FigureBase",
    measured: list[list[dict[str, float]]],
    ranges: dict[str, dict[str, list[float]]],
) -> None:
    """One small axis a statistic: bars are real ranges, dots are rendered sequences."""
    for axis, (key, title) in zip(figure.subplots(1, len(TITLES)), TITLES.items(), strict=True):
        for place, (name, colour, label) in enumerate(REAL):
            low, high = ranges[name][key]
            axis.bar(place, high - low, 0.6, low, color=colour, alpha=0.55, label=label)
        values = [float(np.median([one[key] for one in frames])) for frames in measured]
        spread = np.linspace(-0.25, 0.25, len(values))
        axis.plot(2 + spread, values, ".", color="#0072b2", markersize=3, label="rendered")
        middle = float(np.median(values))
        axis.plot([1.65, 2.35], [middle, middle], color="black", label="their median")
        axis.set_title(title, fontsize=8)
        axis.set_xticks([])
        axis.set_ylim(bottom=0)
        axis.tick_params(labelsize=6)
    handles, labels = axis.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, fontsize=8, frameon=False)


if __name__ == "__main__":
    main()
