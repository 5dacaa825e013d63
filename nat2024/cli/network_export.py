"""From the words of `nat-bench export --format onnx` to files of a network."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from nat2024.cli import options as shared
from nat2024.cli.output import print_json, print_table
from nat2024.errors import UsageError


@dataclass(frozen=True, slots=True)
class NetworkExport:
    """What was asked for, as text."""

    tracker: str | None
    enhancer: str | None
    form: str
    size: str | None
    weights: tuple[str, ...]
    opts: tuple[str, ...]


def export_network(wanted: NetworkExport, out: Path, *, as_json: bool) -> int:
    """Write the network of one tracker or enhancer as ONNX files and tell about them.

    Raises:
        UsageError: the words do not fit together, or the plugin has no network.
    """
    plugin = _create(wanted)
    write = getattr(plugin, "export_onnx", None)
    if write is None:
        msg = f"{plugin.name} has no network of PyTorch to export"
        raise UsageError(msg)
    if wanted.enhancer and wanted.size:
        parts = write(out, size=shared.read_size(wanted.size))
    else:
        parts = write(out)
    if as_json:
        print_json({"parts": parts})
        return 0
    rows = [
        [
            one.part,
            one.path,
            "any" if one.dynamic else "fixed",
            " ".join("x".join(map(str, shape)) for shape in one.inputs),
            "not checked" if one.difference != one.difference else f"{one.difference:.1e}",
        ]
        for one in parts
    ]
    print_table(["Part", "File", "Size", "Inputs", "Away from torch"], rows, words=4)
    return 0


def _create(wanted: NetworkExport) -> Any:
    from nat2024.engine.plan import plugin_specs, refuse_unused
    from nat2024.registry import create_enhancer, create_tracker

    if wanted.form != "onnx":
        msg = "--tracker and --enhancer are for --format onnx; results are chosen by --run"
        raise UsageError(msg)
    if bool(wanted.tracker) == bool(wanted.enhancer):
        msg = "--format onnx needs --tracker NAME or --enhancer NAME, one of them"
        raise UsageError(msg)
    if wanted.tracker and wanted.size:
        msg = "--size is for enhancers; the crops of a tracker have its own size"
        raise UsageError(msg)
    options = shared.read_plugin_options(wanted.opts)
    weights = shared.read_pairs(wanted.weights, "--weights")
    name = wanted.tracker or wanted.enhancer or ""
    [spec] = plugin_specs("tracker" if wanted.tracker else "enhancer", [name], options, weights)
    refuse_unused([spec], options, weights)
    create = create_tracker if wanted.tracker else create_enhancer
    return create(spec.name, weights=spec.weights, **spec.options)
