"""Which runtimes there are, and how each opens an ONNX file."""

import importlib.util
import threading
from collections.abc import Callable, Iterable, Sequence
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
_PROVIDERS = {"cuda": "CUDAExecutionProvider", "tensorrt": "TensorrtExecutionProvider"}

# Fixed orders, not timed ones: the same installation must always give the same bytes.
OPENVINO_FIRST: tuple[BackendName, ...] = ("openvino", "onnxruntime", "torch")
"""What "auto" tries on a CPU, for networks that tell no order of their own."""

ONNXRUNTIME_FIRST: tuple[BackendName, ...] = ("onnxruntime", "torch", "openvino")
"""Likewise for networks so small that a call of OpenVINO costs more than it saves."""

TORCH_FIRST: tuple[BackendName, ...] = ("torch", "onnxruntime", "openvino")
"""Likewise for networks of many channels, which multiply less there (`networks.winograd`)."""

_FASTEST_ON_CUDA: tuple[BackendName, ...] = ("tensorrt", "torch")


def is_installed(backend: BackendName, device: str) -> bool:
    """Whether a backend can run on a device ("cpu", "cuda", "cuda:1") of this machine."""
    if importlib.util.find_spec(_PACKAGES[backend]) is None:
        return False
    if backend != "torch" and importlib.util.find_spec("onnx") is None:
        return False  # the export needs it
    kind = _kind(device)
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
    wish: BackendWish,
    device: str,
    precision: Precision = "float32",
    fastest: Sequence[BackendName] = OPENVINO_FIRST,
) -> tuple[BackendName, ...]:
    """The backends to try for a wish, in their order; more than one only for "auto".

    Args:
        wish: a backend, or "auto".
        device: where the network runs.
        precision: what the backend computes in.
        fastest: what "auto" tries on a CPU, in this order.

    Raises:
        UsageError: no such backend or precision, the backend is not installed or cannot run on
            the device, or cannot compute in the precision.
    """
    if precision not in PRECISIONS:
        msg = f"precision {precision!r} is none of {', '.join(PRECISIONS)}"
        raise UsageError(msg)
    if wish == "auto":
        names = _FASTEST_ON_CUDA if _kind(device) == "cuda" else fastest
        found = tuple(n for n in names if is_installed(n, device) and _can(n, precision))
        if found:
            return found
        msg = f"no backend here computes in {precision} on {device}; {_remedy('openvino', device)}"
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
            f"{_remedy(wish, device)}, or take backend torch"
        )
        raise UsageError(msg)
    return (wish,)


def _remedy(backend: BackendName, device: str) -> str:
    """What makes a backend run on a device, or that nothing does."""
    if backend == "openvino":
        on_cpu = "pip install 'nat-bench[openvino]' brings openvino"
        return on_cpu if _kind(device) == "cpu" else "openvino runs on device cpu only"
    if backend == "tensorrt" and _kind(device) == "cpu":
        return "it runs on device cuda only"
    if _kind(device) == "cuda":
        tensorrt = " and NVIDIA's TensorRT" if backend == "tensorrt" else ""
        return f"it needs 'nat-bench[onnx]' with onnxruntime-gpu{tensorrt}"
    return "pip install 'nat-bench[onnx]'"


def _kind(device: str) -> str:
    return device.partition(":")[0]


def _can(backend: BackendName, precision: Precision) -> bool:
    return precision == "float32" or backend == "openvino"


def open_session(
    backend: BackendName,
    network: Path | bytes,
    *,
    device: str,
    threads: int,
    precision: Precision,
    shapes: Sequence[tuple[int, ...]],
) -> Session:
    """Open an ONNX file, or its bytes; whatever the runtime raises about it is let through.

    `shapes` are those of all inputs that will be given; onnxruntime takes others as well.
    """
    if backend == "openvino":
        return _open_openvino(network, threads, precision, shapes)
    return _open_onnxruntime(network, threads, _providers_for(backend, device))


def _providers_for(backend: BackendName, device: str) -> list[Any]:
    kind, _, number = device.partition(":")
    if kind == "cpu":
        return ["CPUExecutionProvider"]
    chosen = {"device_id": int(number or 0)}
    on_cuda: list[Any] = [(_PROVIDERS["cuda"], chosen), "CPUExecutionProvider"]
    return [(_PROVIDERS["tensorrt"], chosen), *on_cuda] if backend == "tensorrt" else on_cuda


def _places(names: Iterable[str]) -> list[int]:
    """Which of a part's inputs a file still has: an export drops those that nothing uses."""
    return [int(name.removeprefix("input")) for name in names]


def _open_onnxruntime(network: Path | bytes, threads: int, providers: list[Any]) -> Session:
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    options.log_severity_level = 3  # its warnings speak of the graph, which no user wrote
    session = onnxruntime.InferenceSession(network, options, providers=providers)
    names = [one.name for one in session.get_inputs()]
    places = _places(names)

    def run(arrays: Sequence[Array]) -> list[Array]:
        given = {name: arrays[place] for name, place in zip(names, places, strict=True)}
        found: list[Array] = session.run(None, given)
        return found

    return run


def _open_openvino(
    network: Path | bytes,
    threads: int,
    precision: Precision,
    shapes: Sequence[tuple[int, ...]],
) -> Session:
    import openvino

    core = openvino.Core()
    model = core.read_model(network)
    names = [one.get_any_name() for one in model.inputs]
    places = _places(names)
    model.reshape({name: shapes[place] for name, place in zip(names, places, strict=True)})
    compiled = core.compile_model(
        model,
        "CPU",
        {
            "INFERENCE_PRECISION_HINT": {"float32": "f32", "bfloat16": "bf16"}[precision],
            "INFERENCE_NUM_THREADS": threads,
            "NUM_STREAMS": 1,
        },
    )
    own = threading.local()  # a request that two threads use gives one the other's numbers
    count = len(compiled.outputs)

    def run(arrays: Sequence[Array]) -> list[Array]:
        if not hasattr(own, "request"):
            own.request = compiled.create_infer_request()
        given = [arrays[place] for place in places]
        found = own.request.infer(given, share_inputs=True, share_outputs=False)
        return [np.asarray(found[number]) for number in range(count)]

    return run
