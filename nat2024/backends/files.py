"""A plugin's network as ONNX files for other programs, each held against PyTorch."""

import hashlib
import importlib.util
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from nat2024.backends.parts import TOLERANCES, Part, as_tuple
from nat2024.backends.runtimes import is_installed, open_session
from nat2024.errors import BackendMismatch, UsageError
from nat2024.files import write_atomic

if TYPE_CHECKING:
    import torch


@dataclass(frozen=True, slots=True)
class ExportedPart:
    """One ONNX file.

    Attributes:
        part: its name.
        path: the file; inputs are `input0` ..., outputs `output0` ..., all float32.
        sha256: of the file.
        dynamic: whether number, height and width of the inputs are free.
        inputs: shapes that it was exported with.
        outputs: shapes that it gives for them.
        difference: largest difference from PyTorch in shares of the largest output, by ONNX
            Runtime on these inputs; NaN where that is not installed.
    """

    part: str
    path: str
    sha256: str
    dynamic: bool
    inputs: tuple[tuple[int, ...], ...]
    outputs: tuple[tuple[int, ...], ...]
    difference: float


def write_onnx(
    module: "torch.nn.Module",
    parts: "Mapping[str, tuple[Part, Sequence[torch.Tensor]]]",
    folder: Path,
    name: str,
) -> list[ExportedPart]:
    """Write `FOLDER/NAME-PART.onnx` for each part.

    Args:
        module: whose weights the parts use.
        parts: each with the inputs to export and check it with.
        folder: made where absent.
        name: what the files begin with.

    Raises:
        BackendMismatch: a part cannot be exported, or gives other numbers.
        Unwritable: the file system refuses.
        UsageError: what the export needs is not installed.
    """
    if importlib.util.find_spec("onnx") is None:
        msg = "the export needs onnx: pip install 'nat-bench[onnx]'"
        raise UsageError(msg)
    return [
        _write(module, key, part, inputs, folder / f"{name}-{key}.onnx")
        for key, (part, inputs) in parts.items()
    ]


def _write(
    module: "torch.nn.Module",
    name: str,
    part: Part,
    inputs: "Sequence[torch.Tensor]",
    path: Path,
) -> ExportedPart:
    import torch

    from nat2024.backends.exporting import export_onnx

    with torch.no_grad():
        wanted = as_tuple(part.run(*inputs))
    problem = ""
    for dynamic in (True, False) if part.dynamic else (False,):
        try:
            raw = export_onnx(module, part.run, inputs, dynamic=dynamic)
            difference = _difference(raw, inputs, wanted)
        except Exception as error:  # exporter and runtime raise errors of many kinds
            problem = str(error).strip().partition("\n")[0]
            continue
        if difference is None or difference <= TOLERANCES["float32"]:  # NaN is no agreement
            write_atomic(path, raw)
            return ExportedPart(
                name,
                str(path),
                hashlib.sha256(raw).hexdigest(),
                dynamic,
                tuple(tuple(one.shape) for one in inputs),
                tuple(tuple(one.shape) for one in wanted),
                math.nan if difference is None else difference,
            )
        problem = f"differs from torch by {difference:.1e} of the largest output"
    msg = f"{path.name}: cannot be exported to ONNX ({problem})"
    raise BackendMismatch(msg)


def _difference(
    raw: bytes, inputs: "Sequence[torch.Tensor]", wanted: "Sequence[torch.Tensor]"
) -> float | None:
    """Largest difference from PyTorch; None where nothing here could tell."""
    if not is_installed("onnxruntime", "cpu"):
        return None
    session = open_session(
        "onnxruntime",
        raw,
        device="cpu",
        threads=1,
        precision="float32",
        shapes=[tuple(one.shape) for one in inputs],
    )
    found = session([one.detach().cpu().contiguous().numpy() for one in inputs])
    away = [
        float(abs(one - other.cpu().numpy()).max()) / max(float(other.abs().max()), 1.0)
        for one, other in zip(found, wanted, strict=True)
    ]
    return math.nan if any(map(math.isnan, away)) else max(away)
