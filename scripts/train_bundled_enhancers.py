"""Train the bundled weights of `ldenhancer` and `dcepp`, from photographs to files.

    python scripts/train_bundled_enhancers.py PHOTOGRAPHS OUT [--only ldenhancer-default]
        [--minutes 30] [--install]

PHOTOGRAPHS is the folder of the photographs under CC BY 4.0 that `ATTRIBUTION.txt` names. OUT gets
`images` (256x256 night images of them, see `nat2024.night.training_images`), one folder a training
and, for each, weights with a model card; what is there already is gone on with. A line for each
says whether the weights are those that are shipped, byte by byte. `--install` copies weights, cards
and loss curves to the packages; cards of plugins (`card.toml`) name their digests, which the script
prints. About two minutes a training on one core.

Each training is `nat-bench train NAME --data OUT/images/train` with the values printed on its card.
"""

import argparse
import hashlib
import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ROOT / "enhancers" / "nat2024_enhancers"
ATTRIBUTION = "Images from BoofCV-Data by Peter Abeles, CC BY 4.0"


@dataclass(frozen=True)
class Shipped:
    """One training: of which plugin, by which preset, with what to say of it on the card."""

    plugin: str
    preset: str
    about: str

    @property
    def title(self) -> str:
        """Its folder, and what `--only` names."""
        return f"{self.plugin}-{self.preset}"


VALUES: dict[str, Any] = {"seed": 1, "held_out": 0}
"""Over the presets: no image is held out of these, there are others for checking."""

SHIPPED = (
    Shipped(
        "ldenhancer",
        "default",
        "Lifts dark places about as much as the authors' weights do. Like those it gives every "
        "pixel the same tone curve, whatever the image; its colours change less.",
    ),
    Shipped(
        "ldenhancer",
        "adaptive",
        "Lifts dark places more than bright ones: its curves differ from place to place. It raises "
        "the noise of dark places with them, and evens the light out.",
    ),
    Shipped(
        "ldenhancer",
        "bright",
        "One curve for every pixel as `default`, but far brighter; meant for very dark video.",
    ),
    Shipped(
        "dcepp",
        "default",
        "About as bright as the authors' weights, with curves that differ from place to place as "
        "theirs do; trained on night images alone, where the authors had photographs of all "
        "exposures.",
    ),
)


def main() -> None:
    """Make the images, train, measure, write the cards."""
    from nat2024 import NatBenchError
    from nat2024.engine.workers import computing_threads

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("photographs", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--only", default="", help="titles, with commas")
    parser.add_argument("--minutes", type=float, help="stop a training after so long")
    parser.add_argument("--install", action="store_true", help="copy files to the packages")
    given = parser.parse_args()
    wanted = [one for one in SHIPPED if not given.only or one.title in given.only.split(",")]
    try:
        with computing_threads(1):
            make_images(given.photographs, given.out / "images")
            for one in wanted:
                make(one, given)
    except NatBenchError as error:
        sys.exit(str(error))


def make_images(photographs: Path, out: Path) -> None:
    """The night images."""
    from nat2024.night.training_images import make_training_images

    def show(done: int, all_: int) -> None:
        if done % 50 == 0 or done == all_:
            click.echo(f"images: {done} of {all_} scenes", err=True)

    make_training_images(photographs, out, on_progress=show)


def make(one: Shipped, given: argparse.Namespace) -> None:
    """Train one, measure it, write weights and card."""
    from nat2024.enhancing.training import EnhancerTraining, choose_settings, train_enhancer

    loop, pictures, own = choose_settings(one.plugin, one.preset, VALUES)
    images = given.out / "images"
    folder = given.out / one.title
    training = EnhancerTraining(
        one.plugin, str(images / "train"), folder, {}, loop, pictures, own, cache=images
    )
    report = train_enhancer(training, minutes=given.minutes)
    if report.training.steps < report.training.wanted:
        steps = report.training.steps
        click.echo(f"{one.title}: {steps} steps; call again to go on", err=True)
        return
    measures = measure_held_out(one.plugin, report.weights, images / "held_out")
    card = write_card(one, report.weights, measures, images, folder)
    digest = hashlib.sha256(report.weights.read_bytes()).hexdigest()
    target = PACKAGES / one.plugin / "weights"
    shipped = target / f"{one.preset}.safetensors"
    same = shipped.is_file() and shipped.read_bytes() == report.weights.read_bytes()
    found = {"title": one.title, "sha256": digest, "same_as_shipped": same}
    click.echo(json.dumps({**found, **measures}))
    if given.install:
        target.mkdir(exist_ok=True)
        shipped.write_bytes(report.weights.read_bytes())
        (target / f"{one.preset}.csv").write_bytes((folder / "curve.csv").read_bytes())
        (target / f"{one.preset}.md").write_text(card, encoding="utf-8")
        made = json.loads((images / "images.json").read_text(encoding="utf-8"))
        facts = {key: made[key] for key in ("settings", "photographs")}
        (target / "images.json").write_text(json.dumps(facts, indent=1) + "\n", encoding="utf-8")
        (target / "ATTRIBUTION.txt").write_text(ATTRIBUTION + "\n", encoding="utf-8")


def measure_held_out(plugin: str, weights: Path, folder: Path) -> dict[str, float]:
    """What weights do to the images that were held out, RGB 0..1."""
    import cv2
    import torch

    from nat2024 import create_enhancer

    enhancer = create_enhancer(plugin, weights=weights)
    paths = sorted(folder.glob("*.png"))
    pixels = [cv2.imread(str(path))[..., ::-1].transpose(2, 0, 1) for path in paths]
    images = torch.stack([torch.from_numpy(one.copy()).float() / 255 for one in pixels])
    enhanced, amounts = [], []
    for batch in images.split(4):
        enhanced.append(enhancer.enhance_batch(batch))
        maps = enhancer.maps(batch)
        amounts.append(maps.get("A", maps.get("x_r"))[..., :256, :256].mean(dim=1))
    after, amount = torch.cat(enhanced), torch.cat(amounts)
    old, new = images.mean(dim=1), after.mean(dim=1)
    dark, bright = old < 0.15, old > 0.7
    shares = [
        one.mean(dim=(2, 3)) / one.mean(dim=(1, 2, 3))[:, None] / 3 for one in (images, after)
    ]
    local = torch.nn.functional.avg_pool2d(old[:, None], 15, 1, 7)[:, 0]
    pairs = [torch.stack([a.flatten(), b.flatten()]) for a, b in zip(amount, local, strict=True)]
    numbers = {
        "images": len(images),
        "dark_before": old[dark].mean(),
        "dark_after": new[dark].mean(),
        "bright_before": old[bright].mean(),
        "bright_after": new[bright].mean(),
        "saturated_before": (images.amax(dim=1) > 0.97).float().mean(),
        "saturated_after": (after.amax(dim=1) > 0.97).float().mean(),
        "cast": (shares[0] - shares[1]).abs().sum(dim=1).mean(),
        "curve_deviation": amount.std(dim=(1, 2)).mean(),
        "curve_follows_light": torch.stack(
            [torch.corrcoef(pair)[0, 1] for pair in pairs]
        ).nanmean(),
    }
    return {key: round(float(value), 4) for key, value in numbers.items()}


def write_card(
    one: Shipped, weights: Path, measures: dict[str, float], images: Path, folder: Path
) -> str:
    """The model card, beside the weights."""
    record = (images / "images.json").read_bytes()
    config = json.loads((folder / "config.json").read_text(encoding="utf-8"))
    made = json.loads(record)
    values = " ".join(f"--set {key}={value}" for key, value in VALUES.items())
    numbers = "\n".join(f"| {key} | {value:g} |" for key, value in measures.items())
    text = f"""# {one.plugin}, bundled weights "{one.preset}"

These are not the authors' weights. They were trained by the nat-bench project on images that may be
used and passed on. {one.about}

- **File**: `{one.preset}.safetensors`, {weights.stat().st_size} bytes, sha256
  `{hashlib.sha256(weights.read_bytes()).hexdigest()}`.
- **Licence**: that of nat-bench. The images that were trained on: {ATTRIBUTION}.
- **Data**: {len(made["train"])} night images of 256x256 made of {len(made["photographs"])}
  photographs and of {made["settings"]["rendered"]} scenes made of code, by
  `nat2024.night.training_images`; {len(made["held_out"])} more of photographs that were held out
  served for the measures below. Record `images.json`: sha256
  `{hashlib.sha256(record).hexdigest()}`. Nothing of `night_mini`, and no frame of a
  benchmark, was trained on; only the wanted level (of dcepp the smoothness too) was set after a
  look at how real night images come out beside the authors' weights.
- **Recipe**: `nat-bench train {one.plugin} --preset {one.preset} {values}`; all of it again with
  `python scripts/train_bundled_enhancers.py PHOTOGRAPHS OUT --only {one.title}`.
- **Seed**: {config["settings"]["seed"]}. **Code**: revision `{revision()}`, PyTorch
  {torch_version()} on a CPU, where the same command gives the same bytes again. **Loss curves**:
  `{one.preset}.csv`.

| measure on held-out images | value |
| --- | ---: |
{numbers}

Levels are means of the three channels in 0..1; dark is below 0.15 before, bright above 0.7.
`cast` is the summed change of the three channels' shares; `curve_deviation` how much the curve
parameters vary inside an image; `curve_follows_light` their correlation with the light around, high
where dark places are lifted more. Real images and trackers: `docs/bundled-weights.md`.

```json
{json.dumps(config, indent=1, sort_keys=True)}
```
"""
    (folder / "card.md").write_text(text, encoding="utf-8")
    return text


def torch_version() -> str:
    """The release of PyTorch, without what it was built for."""
    import torch

    return torch.__version__.partition("+")[0]


def revision() -> str:
    """The commit that the code is at."""
    command = ["git", "-C", str(ROOT), "rev-parse", "--short=12", "HEAD"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return done.stdout.strip() or "unknown"


if __name__ == "__main__":
    main()
