"""From a part of a PyTorch network to an ONNX file, kept under a hash of what it was made of."""

import contextlib
import functools
import hashlib
import inspect
import logging
import os
import tempfile
import warnings
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from nat2024.errors import Unwritable
from nat2024.files import write_atomic
from nat2024.keeping import cache_folder, trim

log = logging.getLogger("nat2024")

OPSET = 17
_MOST_BYTES = 4 * 10**9
_PLAIN = torch.contiguous_format
_DYNAMIC_AXES = {0: "images", 2: "height", 3: "width"}


class _Part(nn.Module):
    """A function of tensors as a module, so that the weights which it uses are told as such."""

    def __init__(self, module: nn.Module, run: Callable[..., Any]) -> None:
        super().__init__()
        self.module = module
        self.run = run

    def forward(self, *inputs: Tensor) -> Any:
        """What the function gives."""
        return self.run(*inputs)


def exported(
    module: nn.Module,
    run: Callable[..., Any],
    name: str,
    examples: Sequence[Tensor],
    *,
    dynamic: bool,
    anew: bool = False,
) -> Path | bytes:
    """The ONNX file of a part; exported where the cache does not hold it.

    Args:
        module: whose weights the part uses.
        run: the part, a function of tensors that gives one tensor or a tuple of them.
        name: of the part.
        examples: inputs of the shapes that it is exported for.
        dynamic: whether number, height and width of the inputs may differ from the examples'.
        anew: export again even where the cache holds it.

    Returns:
        A file in `cache_folder()`, or its bytes where nothing can be written there. Nothing is
        promised about it but its name's hash: hold its outputs against PyTorch.
    """
    shapes = "any" if dynamic else "-".join("x".join(map(str, one.shape)) for one in examples)
    digest = _digest(module, f"{name} {shapes}")
    path = cache_folder() / "onnx" / f"{type(module).__name__}-{name}-{digest[:24]}.onnx"
    if not anew and _is_kept(path):
        return path
    raw = export_onnx(module, run, examples, dynamic=dynamic)
    try:
        write_atomic(path, raw, durable=False)
    except Unwritable:
        _tell_once(f"{path.parent} cannot be written; networks are exported anew in each process")
        return raw
    trim(path.parent, _MOST_BYTES)
    return path


def _is_kept(path: Path) -> bool:
    """Whether the cache holds a file, which is then noted as used."""
    try:
        is_kept = path.is_file()
    except OSError:  # nobody may look into the folder
        return False
    with contextlib.suppress(OSError):
        os.utime(path)
    return is_kept


@functools.cache
def _tell_once(message: str) -> None:
    log.warning("%s", message)


def export_onnx(
    module: nn.Module,
    run: Callable[..., Any],
    examples: Sequence[Tensor],
    *,
    dynamic: bool,
) -> bytes:
    """A part as the bytes of an ONNX file, inputs `input0` ... and outputs `output0` ...

    Batch norms and the like are left to the runtime, which merges them itself.
    """
    inputs = [f"input{number}" for number in range(len(examples))]
    with _plain_form(), tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "part.onnx"
        given = tuple(one.detach().clone(memory_format=_PLAIN) for one in examples)
        part = _Part(module, run).eval()
        answer = part(*given)
        answer = (answer,) if isinstance(answer, Tensor) else answer
        outputs = [f"output{number}" for number in range(len(answer))]
        torch.onnx.export(
            part,
            given,
            file,
            dynamo=False,
            opset_version=OPSET,
            input_names=inputs,
            output_names=outputs,
            dynamic_axes=_dynamic_axes(inputs, given, outputs, answer) if dynamic else None,
        )
        return file.read_bytes()


@contextlib.contextmanager
def _plain_form() -> Iterator[None]:
    """With gradients, in which networks here have no loops over bands of rows; and in silence.

    The exporter warns of shapes that become constants, which is what `dynamic` is about.
    """
    with torch.inference_mode(False), torch.enable_grad(), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


def _dynamic_axes(
    inputs: list[str], given: Sequence[Tensor], outputs: list[str], answer: Sequence[Tensor]
) -> dict[str, dict[int, str]]:
    """Images, height and width of every tensor that has them, by its name."""
    axes = {}
    for name, tensor in zip([*inputs, *outputs], [*given, *answer], strict=True):
        own = {axis: f"{name}_{what}" for axis, what in _DYNAMIC_AXES.items()}
        axes[name] = {axis: what for axis, what in own.items() if axis < tensor.dim()}
    return axes


def _digest(module: nn.Module, what: str) -> str:
    """A hash of everything that an export depends on: code, settings and weights."""
    digest = hashlib.sha256(f"{what}, opset {OPSET}, torch {torch.__version__}".encode())
    for name, one in module.named_modules():
        digest.update(f"{name} {type(one).__qualname__} {_settings(one)}".encode())
    for kind in sorted({type(one) for one in module.modules()}, key=lambda cls: cls.__qualname__):
        if not kind.__module__.startswith("torch."):
            with contextlib.suppress(OSError, TypeError):  # typed in, not read from a file
                digest.update(inspect.getsource(kind).encode())
    for key, tensor in module.state_dict().items():
        digest.update(f"{key} {tuple(tensor.shape)} {tensor.dtype}".encode())
        digest.update(tensor.detach().cpu().contiguous().numpy().tobytes())
    return digest.hexdigest()


def _settings(module: nn.Module) -> dict[str, Any]:
    plain = (bool, int, float, str, tuple)
    return {key: value for key, value in vars(module).items() if isinstance(value, plain)}
