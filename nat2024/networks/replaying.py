"""Networks on CUDA devices, recorded once and replayed: one launch in place of hundreds."""

from collections import Counter, OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import torch
from torch import Tensor, nn
from torch.utils._python_dispatch import TorchDispatchMode, _get_current_dispatch_mode

from nat2024.networks.folding import Derived

_CALLS_BEFORE = 3
"""Calls of the first shape before it is recorded, in which kernels are chosen.

The second shape takes 4 times as many, the third 9 times: a recording costs more than a few calls,
and batches that get smaller, sequence by sequence, would not pay for theirs.
"""

_COPIES = ("_to_copy", "copy_")
_QUESTIONS = ("_local_scalar_dense", "nonzero", "masked_select", "equal", "_unique2")

_PLACES = ("index", "index_put_", "index_put")

_RECORDINGS = 8
"""Shapes that are kept at most; each holds the memory that its network needs."""


@dataclass(slots=True)
class _Recording:
    graph: torch.cuda.CUDAGraph
    inputs: list[Tensor]
    answer: Any


@dataclass(slots=True)
class _Known:
    """What is known for the weights as they are."""

    calls: Counter[Any] = field(default_factory=Counter)
    recordings: OrderedDict[Any, _Recording | None] = field(default_factory=OrderedDict)


class Replayed:
    """A function of tensors, the same numbers, with the kernels of a CUDA device replayed.

    A small network keeps a device waiting for Python, which launches one kernel after another. From
    the fourth call with inputs of the same shapes, of further shapes from a later one, a recording
    (a CUDA graph) is replayed instead. Weights may change: recordings made with others are thrown
    away. With gradients, under autocast and on other devices the function is simply called;
    likewise where it cannot be recorded.

    Example:
        >>> layer = nn.Linear(2, 2)
        >>> double = Replayed(layer, lambda rows: 2 * layer(rows))
        >>> double(torch.zeros(1, 2)).shape
        torch.Size([1, 2])
    """

    def __init__(self, module: nn.Module, function: Callable[..., Any]) -> None:
        """Nothing is recorded yet.

        Args:
            module: holds all weights that the function uses.
            function: of tensors on one device, which are not modified, to a tensor or a tuple of
                tensors. Beside them and the weights
                it depends on nothing, and it must not ask for a tensor's value.
        """
        self.module = module
        self._function = function
        self._known = Derived(module, _Known)

    def __call__(self, *inputs: Tensor) -> Any:
        """What the function gives."""
        if inputs[0].device.type != "cuda" or torch.is_grad_enabled() or _is_watched():
            return self._function(*inputs)
        # Ordinary tensors, whatever mode asks first.
        with torch.inference_mode(mode=False), torch.no_grad():
            return self._answer(inputs)

    def __getstate__(self) -> dict[str, Any]:
        return {"module": self.module, "function": self._function}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__init__(**state)  # type: ignore[misc]

    def _answer(self, inputs: tuple[Tensor, ...]) -> Any:
        known, key = self._known(), _key(inputs)
        if key not in known.recordings:
            known.calls[key] += 1
            if known.calls[key] <= _CALLS_BEFORE * (1 + len(known.recordings)) ** 2:
                return self._function(*inputs)
            known.recordings[key] = self._record(inputs)
            if len(known.recordings) > _RECORDINGS:
                known.recordings.popitem(last=False)
        known.recordings.move_to_end(key)
        recording = known.recordings[key]
        if recording is None:
            return self._function(*inputs)
        for given, kept in zip(inputs, recording.inputs, strict=True):
            kept.copy_(given)
        recording.graph.replay()
        if isinstance(recording.answer, Tensor):
            return recording.answer.clone()
        return tuple(part.clone() for part in recording.answer)

    def _record(self, inputs: tuple[Tensor, ...]) -> _Recording | None:
        """Record a call; None where the function does what a recording cannot."""
        graph, kept = torch.cuda.CUDAGraph(), [given.clone() for given in inputs]
        with torch.cuda.device(inputs[0].device):
            stream = torch.cuda.Stream()  # type: ignore[no-untyped-call]
            stream.wait_stream(torch.cuda.current_stream())
            with torch.cuda.stream(stream), _Scout() as scout:  # type: ignore[no-untyped-call]
                self._function(*kept)  # libraries set themselves up for the stream
            torch.cuda.current_stream().wait_stream(stream)
            if scout.obstacle:
                return None
            try:
                with torch.cuda.graph(graph, stream=stream, capture_error_mode="thread_local"):
                    answer = self._function(*kept)
            except RuntimeError:
                _recover(stream)
                return None
        return _Recording(graph, kept, answer)


class _Scout(TorchDispatchMode):  # type: ignore[no-untyped-call]
    """Looks for what cannot be recorded: values asked for, and tensors that come from the CPU."""

    obstacle = ""

    def __torch_dispatch__(
        self, func: Any, types: Any, args: tuple[Any, ...] = (), kwargs: Any = None
    ) -> Any:
        answer = func(*args, **(kwargs or {}))
        name = func.overloadpacket.__name__
        tensors = [one for one in (*args, answer) if isinstance(one, Tensor)]
        crosses = name in _COPIES and len({one.device.type for one in tensors}) > 1
        if crosses or name in _QUESTIONS or (name in _PLACES and _is_mask(args[1])):
            self.obstacle = name
        return answer


def _is_mask(indices: Sequence[Tensor | None]) -> bool:
    """Whether how much is chosen depends on values."""
    return any(index is not None and index.dtype in (torch.bool, torch.uint8) for index in indices)


def _recover(stream: torch.cuda.Stream) -> None:
    """Record something that ends: random numbers wait for the end of one that broke off."""
    with torch.cuda.graph(torch.cuda.CUDAGraph(), stream=stream):
        torch.zeros(1, device="cuda")


def _is_watched() -> bool:
    """Whether somebody else changes or looks at every operation: autocast, a counter, a tracer."""
    return (
        torch.is_autocast_enabled("cuda")
        or torch.cuda.is_current_stream_capturing()
        or _get_current_dispatch_mode() is not None
        or torch.compiler.is_compiling()
    )


def _key(inputs: tuple[Tensor, ...]) -> Any:
    """All that the choice of kernels depends on."""
    shapes = tuple((given.shape, given.dtype, given.device) for given in inputs)
    cudnn, matmul = torch.backends.cudnn, torch.backends.cuda.matmul
    return shapes, cudnn.allow_tf32, matmul.allow_tf32, cudnn.deterministic
