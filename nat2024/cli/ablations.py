"""Which runs are the variants of an enhancer's ablation."""

import contextlib
import re
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from nat2024.errors import NatBenchError

if TYPE_CHECKING:
    from nat2024.evaluation import Evaluation, RunScores
    from nat2024_reports.layouts import Ablation

_SEED = re.compile(r"[-_.]*(?:seed)?[-_.]*[0-9]+$")
_BASELINE = "baseline"


def ablations_of(evaluation: "Evaluation") -> "list[Ablation]":
    """The variants of every enhancer that has some.

    A run's label tells its variant, such as `ldenhancer@TB_LS` or `ldenhancer@TB-seed2`; without
    such a label the options that the network was made with do.
    """
    from nat2024.cli.display_names import display_name
    from nat2024_reports.layouts import Ablation

    found = []
    for enhancer in sorted({run.enhancer.partition("@")[0] for run in evaluation.runs}):
        options = _options_of_variants(enhancer)
        names = [_title(variant) for variant in options]
        variants = {
            run.run: _title(variant)
            for run in evaluation.runs
            if run.enhancer.partition("@")[0] == enhancer
            and (variant := _variant(run, options)) is not None
        }
        if variants:
            found.append(Ablation(display_name(enhancer, "enhancer"), names, variants))
    return found


def _options_of_variants(enhancer: str) -> Mapping[str, Mapping[str, Any]]:
    """Options by variant, empty where the enhancer has none or is not installed."""
    from nat2024.registry import list_plugins, load_plugin

    if enhancer not in list_plugins("enhancer"):
        return {}
    with contextlib.suppress(NatBenchError):
        options: Mapping[str, Mapping[str, Any]] = getattr(
            load_plugin(enhancer, "enhancer"), "ablation", {}
        )
        return options
    return {}


def _variant(run: "RunScores", options: Mapping[str, Mapping[str, Any]]) -> str | None:
    label = run.enhancer.partition("@")[2]
    by_parts = {_parts(variant): variant for variant in options}
    named = _parts(_SEED.sub("", label)) if label else None
    if named in by_parts:
        return by_parts[named]
    record = run.manifest.enhancer if run.manifest else None
    if record is None:
        return None
    for variant, wanted in options.items():
        if all(record.options.get(key) == value for key, value in wanted.items()):
            return variant
    return None


def _parts(text: str) -> frozenset[str]:
    """`+TB+LS`, `Baseline_TB_LS` and `tb-ls` are the same."""
    found: Iterable[str] = filter(None, re.split(r"[-+_.]+", text.lower()))
    parts = frozenset(found)
    return parts - {_BASELINE} if parts != {_BASELINE} else parts


def _title(variant: str) -> str:
    """`+Baseline+TB`, as the paper has it."""
    added = variant if variant.startswith("+") else ""
    return f"+{_BASELINE.capitalize()}{added}"
