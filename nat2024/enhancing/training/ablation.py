"""The variants of an enhancer, each trained alike with several seeds, and how far they spread."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from shlex import quote

import numpy as np

from nat2024.enhancing.training.pictures import Progress
from nat2024.enhancing.training.running import (
    EnhancerTraining,
    EnhancerTrainingReport,
    train_enhancer,
)
from nat2024.errors import UsageError
from nat2024.registry import load_plugin
from nat2024.training import TrainingSettings, set_values


@dataclass(frozen=True, slots=True)
class Variant:
    """One training of the ablation.

    Attributes:
        name: of the variant, such as "+TB".
        seed: of this training.
        report: what came out.
    """

    name: str
    seed: int
    report: EnhancerTrainingReport


@dataclass(frozen=True, slots=True)
class Spread:
    """One number of a variant over its seeds.

    Attributes:
        mean: over seeds.
        deviation: sample standard deviation, NaN for one seed.
        least: smallest.
        most: largest.
    """

    mean: float
    deviation: float
    least: float
    most: float


def run_ablation(
    training: EnhancerTraining,
    seeds: int = 3,
    *,
    minutes: float | None = None,
    on_progress: Progress = lambda _done, _what: None,
    on_total: Callable[[int], object] = lambda _total: None,
) -> list[Variant]:
    """Train all variants of an enhancer with equal budgets, each in a folder of its own.

    Called again it goes on where it was stopped.

    Args:
        training: as for the whole enhancer; the variants' options win over its own.
        seeds: trainings of each variant, with the seed given and those that follow it.
        minutes: of each training.
        on_progress: as in `train_enhancer`.
        on_total: as in `train_enhancer`.

    Raises:
        UsageError: the enhancer names no variants.
        NatBenchError: as `train_enhancer`.
    """
    variants = getattr(load_plugin(training.name, "enhancer"), "ablation", {})
    if not variants:
        msg = f"{training.name} has no variants for an ablation"
        raise UsageError(msg)
    done = []
    for name, options in variants.items():
        for number in range(seeds):
            seed = training.loop.seed + number
            one = replace(
                training,
                out=training.out / _folder_of(name) / f"seed-{seed}",
                options={**training.options, **options},
                loop=_with_seed(training, seed),
            )
            report = train_enhancer(
                one, minutes=minutes, on_progress=on_progress, on_total=on_total
            )
            done.append(Variant(name, seed, report))
    return done


def tracking_script(training: EnhancerTraining, trained: Iterable[Variant]) -> str:
    """A shell script that tracks all variants, each under a label that the table knows.

    Words that it is called with, such as `--dataset NAME`, go to `nat-bench run`.

    Args:
        training: as in `run_ablation`.
        trained: what that gave.
    """
    variants = load_plugin(training.name, "enhancer").ablation
    lines = ["#!/bin/sh", 'nat-bench run "$@" --enhancer none \\']
    for one in trained:
        label = f"{training.name}@{_folder_of(one.name)}-{one.seed}"
        lines.append(f"  --enhancer {label} \\")
        options = {**training.options, **variants[one.name]}
        lines += [
            f"  --opt {quote(f'{label}.{key}={_text(value)}')} \\" for key, value in options.items()
        ]
        lines.append(f"  --weights {quote(f'{label}={one.report.weights.absolute()}')} \\")
    lines[-1] = lines[-1].removesuffix(" \\")
    return "\n".join(lines) + "\n"


def _text(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


def _folder_of(variant: str) -> str:
    return variant.replace("+", "_").strip("_")


def _with_seed(training: EnhancerTraining, seed: int) -> TrainingSettings:
    return set_values([training.loop], {"seed": seed})[0]


def spread(trained: Iterable[Variant]) -> dict[str, Mapping[str, Spread]]:
    """Every number of the validation by variant: its mean over seeds and how far they differ."""
    rows: dict[str, dict[str, list[float]]] = {}
    for one in trained:
        numbers = rows.setdefault(one.name, {})
        for name, value in one.report.training.numbers.items():
            numbers.setdefault(name, []).append(value)
    return {
        variant: {name: _spread(values) for name, values in numbers.items()}
        for variant, numbers in rows.items()
    }


def _spread(values: list[float]) -> Spread:
    deviation = float(np.std(values, ddof=1)) if len(values) > 1 else float("nan")
    return Spread(float(np.mean(values)), deviation, min(values), max(values))
