"""Draw the README's picture: the bundled sample, tracked with and without an enhancer.

    python docs/figures/first_run.py

runs the tracker fdsst on `night_mini` and writes `first_run.png` beside this file.
"""

import tempfile
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.patches import Rectangle

import nat2024
from nat2024.engine import combine, run_benchmark
from nat2024.store import RunFolder

HERE = Path(__file__).parent
TRUTH, PLAIN, ENHANCED = "#ffffff", "#e69f00", "#56b4e9"
SEQUENCE = "car1"
SHOWN = (0, 36, 72)


def main() -> None:
    """Run, score, draw."""
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        dataset = nat2024.load_dataset("night_mini")
        run_benchmark(combine(["fdsst"], ["none", "clahe"]), dataset, work / "results")
        evaluation = nat2024.evaluate(work / "results", dataset)
        draw(dataset, work / "results" / "night_mini", evaluation)


def draw(dataset: nat2024.Dataset, runs: Path, evaluation: nat2024.Evaluation) -> None:
    """Three frames above, as seen and as enhanced; success and precision plots at the right."""
    clahe = nat2024.create_enhancer("clahe")
    sequence = dataset[SEQUENCE]
    figure, axes = plt.subplots(
        2, 4, figsize=(12, 3.9), layout="constrained", width_ratios=[1.6, 1.6, 1.6, 1.35]
    )
    rows = (("fdsst", "fDSST", PLAIN, None), ("fdsst+clahe", "fDSST + CLAHE", ENHANCED, clahe))
    for row, (run, title, colour, enhancer) in enumerate(rows):
        boxes = RunFolder(runs / run).boxes(sequence.name)
        for column, frame in enumerate(SHOWN):
            image = sequence.image(frame)
            if enhancer:
                image = enhancer.enhance(image, bgr=True)
            axis = axes[row, column]
            axis.imshow(image[..., ::-1])
            axis.set_axis_off()
            axis.set_title(f"{title}, frame {frame + 1}", fontsize=9, loc="left")
            for box, edge, style in (
                (sequence.boxes[frame], TRUTH, "-"),
                (boxes[frame], colour, "--"),
            ):
                patch = Rectangle(box[:2], *box[2:], fill=False, edgecolor=edge, linestyle=style)
                axis.add_patch(patch)
    curves = evaluation.curves()
    for row, (metric, label) in enumerate(
        (("success", "overlap threshold"), ("precision", "centre error threshold (px)"))
    ):
        axis = axes[row, 3]
        for run, title, colour, enhancer in rows:
            chosen = curves[(curves.run == run) & (curves.metric == metric)]
            style = "-" if enhancer else "--"
            axis.plot(chosen.threshold, chosen.value, style, color=colour, label=title)
        axis.set_title(metric, fontsize=9, loc="left")
        axis.set_xlabel(label, fontsize=8)
        axis.set_ylim(0, 1.02)
        axis.tick_params(labelsize=7)
        axis.grid(alpha=0.3)
        axis.legend(fontsize=7)
    figure.savefig(HERE / "first_run.png", dpi=110)


if __name__ == "__main__":
    main()
