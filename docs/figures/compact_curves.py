"""Draw the loss curves of the bundled weights of `siamrpnpp`, which lie beside them as CSV.

    python docs/figures/compact_curves.py

writes `compact_curves.png` beside this file.
"""

import csv
from importlib.resources import files
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.ticker import FuncFormatter

HERE = Path(__file__).parent
SECOND_STRETCH = 11_851
COLOURS = {
    "loss": "#000000",
    "box": "#e69f00",
    "positive": "#0072b2",
    "negative": "#009e73",
    "cross": "#cc79a7",
}


def main() -> None:
    """The terms on one axis, a line where the second stretch begins."""
    source = files("nat2024_trackers.siamrpnpp").joinpath("weights", "compact.csv")
    rows = list(csv.DictReader(source.read_text().splitlines()))
    steps = [int(row["step"]) for row in rows]
    figure, axis = plt.subplots(figsize=(7, 3.2), layout="constrained")
    for term, colour in COLOURS.items():
        width, label = (1.8, "sum") if term == "loss" else (1.2, term)
        axis.plot(steps, [float(row[term]) for row in rows], color=colour, lw=width, label=label)
    axis.axvline(SECOND_STRETCH, color="#888888", linewidth=0.8, linestyle="--")
    axis.annotate(
        "second stretch, other clips", (SECOND_STRETCH, 1.02), xytext=(4, 0),
        xycoords=("data", "axes fraction"), textcoords="offset points", fontsize=8,
        color="#555555", ha="left", va="bottom",
    )  # fmt: skip
    axis.set_yscale("log")
    axis.set_xlim(0, steps[-1])
    axis.set_xlabel("step", fontsize=9)
    axis.set_ylabel("weighted loss terms", fontsize=9)
    axis.xaxis.set_major_formatter(FuncFormatter(lambda value, _place: f"{value:,.0f}"))
    axis.yaxis.set_major_formatter(FuncFormatter(lambda value, _place: f"{value:g}"))
    axis.tick_params(labelsize=8)
    axis.grid(color="#dddddd", linewidth=0.5)
    axis.spines[["top", "right"]].set_visible(False)
    figure.legend(loc="outside right center", fontsize=8, frameon=False)
    figure.savefig(HERE / "compact_curves.png", dpi=130)


if __name__ == "__main__":
    main()
