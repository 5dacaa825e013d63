"""Runtimes other than PyTorch for the networks of plugins: ONNX Runtime, OpenVINO, TensorRT.

A network is handed over in *parts*: functions of tensors that belong to a `torch.nn.Module`. Each
part is exported to ONNX once (kept on disk under a hash of its weights), opened by the runtime and
held against PyTorch on the very tensors of its first call, before any result of it is used.
"""

from nat2024.backends.files import ExportedPart, write_onnx
from nat2024.backends.parts import CompiledPart, Part, Recorder, all_in_torch, compile_parts
from nat2024.backends.runtimes import (
    BACKENDS,
    ONNXRUNTIME_FIRST,
    OPENVINO_FIRST,
    PRECISIONS,
    TORCH_FIRST,
    BackendName,
    BackendWish,
    Precision,
    backends_of,
    is_installed,
)

__all__ = [
    "BACKENDS",
    "ONNXRUNTIME_FIRST",
    "OPENVINO_FIRST",
    "PRECISIONS",
    "TORCH_FIRST",
    "BackendName",
    "BackendWish",
    "CompiledPart",
    "ExportedPart",
    "Part",
    "Precision",
    "Recorder",
    "all_in_torch",
    "backends_of",
    "compile_parts",
    "is_installed",
    "write_onnx",
]
