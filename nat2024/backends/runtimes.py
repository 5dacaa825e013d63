"""Which runtimes there are, and how each opens an ONNX file."""

import importlib.util
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Literal, TypeAlias, get_args

import numpy as np
import numpy.typing as npt

from nat2024.errors import UsageError

BackendName: TypeAlias = Literal["torch", "onnxruntime", "openvino", "tensorrt"]
"""What runs a network."""

BackendWish: TypeAlias = Literal["auto", "torch", "onnxruntime", "openvino", "tensorrt"]
"""A backend, or "auto" for the fastest one that is installed and passes its own check."""

Precision: TypeAlias = Literal["float32", "bfloat16"]
"""Numbers that a backend computes in; what goes in and comes out is float32."""

Array: TypeAlias = npt.NDArray[Any]
Session: TypeAlias = Callable[[Sequence[Array]], list[Array]]
"""An opened network: arrays in, arrays out."""

BACKENDS: tuple[BackendName, ...] = get_args(BackendName)
PRECISIONS: tuple[Precision, ...] = get_args(Precision)

_PACKAGES: dict[BackendName, str] = {
    "torch": "torch",
    "onnxruntime": "onnxruntime",
    "openvino": "openvino",
    "tensorrt": "onnxruntime",
}
_EXTRAS: dict[BackendName, str] = {
    "onnxruntime": "onnx",
    "openvino": "openvino",
    "tensorrt": "tensorrt",
}
_PROVIDERS = {"cuda": "CUDAExecutionProvider", "tensorrt": "TensorrtExecutionProvider"}
_FASTEST_FIRST: dict[str, tuple[BackendName, ...]] = {
    # Fixed, not timed: the same installation must always give the same bytes.
    "cpu": ("openvino", "onnxruntime", "torch"),
    "cuda": ("tensorrt", "torch"),
}


def is_installed(backend: BackendName, device: str) -> bool:
    """Whether a backend can run on a device ("cpu", "cuda", "cuda:1") of this machine."""
    if importlib.util.find_spec(_PACKAGES[backend]) is None:
        return False
    if backend != "torch" and importlib.util.find_spec("onnx") is None:
        return False  # the export needs it
    kind = device.partition(":")[0]
    if backend == "openvino":
        return kind == "cpu"
    if backend == "tensorrt":
        return kind == "cuda" and _PROVIDERS["tensorrt"] in _providers()
    if backend == "onnxruntime" and kind == "cuda":
        return _PROVIDERS["cuda"] in _providers()
    return True


def _providers() -> list[str]:
    import onnxruntime

    return list(onnxruntime.get_available_providers())


def backends_of(
    wish: BackendWish, device: str, precision: Precision = "float32"
) -> tuple[BackendName, ...]:
    """The backends to try for a wish, in their order; more than one only for "auto".

    Raises:
        UsageError: no such backend or precision, the backend is not installed or cannot run on
            the device, or cannot compute in the precision.
    """
    if precision not in PRECISIONS:
        msg = f"precision {precision!r} is none of {', '.join(PRECISIONS)}"
        raise UsageError(msg)
    if wish == "auto":
        names = _FASTEST_FIRST[device.partition(":")[0]]
        found = tuple(n for n in names if is_installed(n, device) and _can(n, precision))
        if found:
            return found
        msg = (
            f"no backend here computes in {precision}; pip install 'nat-bench[openvino]' brings one"
        )
        raise UsageError(msg)
    if wish not in BACKENDS:
        msg = f"backend {wish!r} is none of auto, {', '.join(BACKENDS)}"
        raise UsageError(msg)
    if not _can(wish, precision):
        msg = f"backend {wish} computes in float32 only; openvino knows bfloat16"
        raise UsageError(msg)
    if not is_installed(wish, device):
        msg = (
            f"backend {wish} is not installed for device {device}; "
            f"pip install 'nat-bench[{_EXTRAS.get(wish, wish)}]', or take backend torch"
        )
        raise UsageError(msg)
    return (wish,)


def _can(backend: BackendName, precision: Precision) -> bool:
    return precision == "float32" or backend == "openvino"


def open_session(
    backend: BackendName, path: Path, *, device: str, threads: int, precision: Precision
) -> Session:
    """Open an ONNX file; whatever the runtime raises about it is let through."""
    if backend == "openvino":
        return _open_openvino(path, threads, precision)
    return _open_onnxruntime(path, threads, _providers_for(backend, device))


def _providers_for(backend: BackendName, device: str) -> list[Any]:
    kind, _, number = device.partition(":")
    if kind == "cpu":
        return ["CPUExecutionProvider"]
    chosen = {"device_id": int(number or 0)}
    on_cuda: list[Any] = [(_PROVIDERS["cuda"], chosen), "CPUExecutionProvider"]
    return [(_PROVIDERS["tensorrt"], chosen), *on_cuda] if backend == "tensorrt" else on_cuda


def _open_onnxruntime(path: Path, threads: int, providers: list[Any]) -> Session:
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    options.log_severity_level = 3  # its warnings speak of the graph, which no user wrote
    session = onnxruntime.InferenceSession(str(path), options, providers=providers)
    names = [one.name for one in session.get_inputs()]

    def run(arrays: Sequence[Array]) -> list[Array]:
        found: list[Array] = session.run(None, dict(zip(names, arrays, strict=True)))
        return found

    return run


def _open_openvino(path: Path, threads: int, precision: Precision) -> Session:
    import openvino

    compiled = openvino.Core().compile_model(
        str(path),
        "CPU",
        {
            "INFERENCE_PRECISION_HINT": {"float32": "f32", "bfloat16": "bf16"}[precision],
            "INFERENCE_NUM_THREADS": threads,
            "NUM_STREAMS": 1,
        },
    )
    request = compiled.create_infer_request()
    count = len(compiled.outputs)

    def run(arrays: Sequence[Array]) -> list[Array]:
        found = request.infer(list(arrays), share_inputs=True, share_outputs=False)
        return [np.asarray(found[number]) for number in range(count)]

    return run
