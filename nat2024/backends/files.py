"""A plugin's network as ONNX files for other programs, each held against PyTorch."""

import contextlib
import hashlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from nat2024.backends.parts import TOLERANCES, Part, as_tuple
from nat2024.backends.runtimes import is_installed, open_session
from nat2024.errors import BackendMismatch
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
    """
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
        except Exception as error:  # the exporter raises errors of many kinds
            problem = str(error).strip().partition("\n")[0]
            continue
        write_atomic(path, raw)
        difference = _difference(path, inputs, wanted)
        if not difference > TOLERANCES["float32"]:  # NaN: nothing here could check it
            return ExportedPart(
                name,
                str(path),
                hashlib.sha256(raw).hexdigest(),
                dynamic,
                tuple(tuple(one.shape) for one in inputs),
                tuple(tuple(one.shape) for one in wanted),
                difference,
            )
        problem = f"differs from torch by {difference:.1e} of the largest output"
        with contextlib.suppress(OSError):
            path.unlink()
    msg = f"{path.name}: cannot be exported to ONNX ({problem})"
    raise BackendMismatch(msg)


def _difference(
    path: Path, inputs: "Sequence[torch.Tensor]", wanted: "Sequence[torch.Tensor]"
) -> float:
    if not is_installed("onnxruntime", "cpu"):
        return math.nan
    session = open_session(
        "onnxruntime",
        path,
        device="cpu",
        threads=1,
        precision="float32",
        shapes=[tuple(one.shape) for one in inputs],
    )
    found = session([one.detach().cpu().contiguous().numpy() for one in inputs])
    return max(
        float(abs(one - other.cpu().numpy()).max()) / max(float(other.abs().max()), 1.0)
        for one, other in zip(found, wanted, strict=True)
    )
