"""Draw the loss curves of the bundled enhancer weights, which lie beside them as CSV.

    python docs/figures/training_curves.py

writes `training_curves.png` beside this file.
"""

import csv
from importlib.resources import files
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.ticker import FuncFormatter

HERE = Path(__file__).parent
SHOWN = (
    ("ldenhancer", "default"),
    ("ldenhancer", "adaptive"),
    ("ldenhancer", "bright"),
    ("dcepp", "default"),
)
COLOURS = {
    "loss": "#000000",
    "exposure": "#e69f00",
    "smoothness": "#0072b2",
    "spatial": "#009e73",
    "colour": "#cc79a7",
    "light": "#56b4e9",
}


def read_columns(plugin: str, preset: str) -> dict[str, list[float]]:
    """A curve file's columns."""
    text = files(f"nat2024_enhancers.{plugin}").joinpath("weights", f"{preset}.csv").read_text()
    rows = list(csv.DictReader(text.splitlines()))
    return {key: [float(row[key]) for row in rows] for key in rows[0]}


def main() -> None:
    """One axis a training, all on one scale."""
    figure, axes = plt.subplots(1, len(SHOWN), figsize=(11, 2.9), sharey=True, layout="constrained")
    for axis, (plugin, preset) in zip(axes, SHOWN, strict=True):
        columns = read_columns(plugin, preset)
        for term, colour in COLOURS.items():
            if term in columns:
                width = 1.8 if term == "loss" else 1.2
                label = "sum" if term == "loss" else term
                axis.plot(columns["step"], columns[term], color=colour, lw=width, label=label)
        axis.set_yscale("log")
        axis.set_title(f"{plugin}, {preset}", fontsize=9, loc="left")
        axis.set_xlabel("step", fontsize=8)
        axis.tick_params(labelsize=7)
        axis.grid(color="#dddddd", linewidth=0.5)
        axis.spines[["top", "right"]].set_visible(False)
        axis.set_xlim(0, columns["step"][-1])
    axes[0].yaxis.set_major_formatter(FuncFormatter(lambda value, _place: f"{value:g}"))
    axes[0].set_ylabel("weighted loss terms", fontsize=8)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(
        handles, labels, loc="outside lower center", ncols=len(COLOURS), fontsize=8, frameon=False
    )
    figure.savefig(HERE / "training_curves.png", dpi=130)


if __name__ == "__main__":
    main()
