"""Parts of a network that another backend runs, checked against PyTorch before they are used."""

import contextlib
import logging
import threading
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextvars import ContextVar
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TypeAlias

from nat2024.backends.runtimes import BackendName, Precision, Session, open_session
from nat2024.errors import BackendMismatch

if TYPE_CHECKING:
    import torch

log = logging.getLogger("nat2024")

Outputs: TypeAlias = "torch.Tensor | tuple[torch.Tensor, ...]"
Shapes: TypeAlias = tuple[tuple[int, ...], ...]

TOLERANCES: Mapping[Precision, float] = {"float32": 1e-4, "bfloat16": 0.1}
"""How far outputs may be from PyTorch's, in shares of the largest (or of 1, if that is more)."""

_MOST_SHAPES = 16
"""Sessions of fixed shape that are kept. Beyond, inputs of further shapes run in PyTorch where each
shape needs an export of its own, and else the session that was opened first is closed."""

_FASTER_FIXED: frozenset[BackendName] = frozenset({"openvino"})
"""What runs a network for one shape faster (a sixth, in bfloat16) and opens it at once."""

_OPENING = threading.RLock()
"""Of all parts, since one of its own could not be copied or pickled with a plugin."""

_is_all_in_torch: ContextVar[bool] = ContextVar("_is_all_in_torch", default=False)


@contextlib.contextmanager
def all_in_torch() -> Iterator[None]:
    """Let PyTorch run every part meanwhile, for tools of its own that watch what is computed."""
    token = _is_all_in_torch.set(True)
    try:
        yield
    finally:
        _is_all_in_torch.reset(token)


@dataclass(frozen=True, slots=True)
class Part:
    """A function of tensors that belongs to a network.

    Attributes:
        run: from tensors (N, ...) to one tensor or a tuple of them.
        dynamic: whether one export may serve any number, height and width of its inputs.
    """

    run: "Callable[..., Outputs]"
    dynamic: bool = True


@dataclass(slots=True)
class _Opened:
    """Sessions by the shapes that they are for (None: any), and the shapes that were checked."""

    sessions: dict[Shapes | None, Session] = field(default_factory=dict)
    checked: set[Shapes] = field(default_factory=set)

    def clear(self) -> None:
        self.sessions.clear()
        self.checked.clear()

    def forget_oldest(self) -> None:
        """Close the first session where there are too many; its shape is checked anew."""
        if len(self.sessions) > _MOST_SHAPES:
            shapes = next(iter(self.sessions))
            del self.sessions[shapes]
            self.checked.discard(shapes or ())


class CompiledPart:
    """A part that runs in one of some backends, called as the part itself is.

    Sessions are opened at the first call of each shape, for as many threads as torch computes on
    then, and anew when the network's weights have changed. Where the first backend fails its check
    the next takes over, with a line of log; the last one's failure is raised.

    Attributes:
        answered: how many calls each backend has answered.
    """

    def __init__(
        self,
        module: "torch.nn.Module",
        name: str,
        part: Part,
        backends: Sequence[BackendName],
        *,
        device: str = "cpu",
        precision: Precision = "float32",
    ) -> None:
        from nat2024.networks.folding import Derived

        self.module, self.name, self.part = module, name, part
        self.device, self.precision = device, precision
        self._backends = list(backends)
        self.answered: Counter[BackendName] = Counter()
        self._threads = 0
        self._is_dynamic = part.dynamic
        # Empty again as soon as a weight has changed.
        self._opened: Derived[_Opened] = Derived(module, _Opened)

    @property
    def backend(self) -> BackendName:
        """What runs the part, as far as is known."""
        return self._backends[0]

    def __call__(self, *inputs: "torch.Tensor") -> Outputs:
        """What the part gives for `inputs`.

        Raises:
            BackendMismatch: the backend cannot run the part, or gives other numbers.
        """
        import torch

        if self._is_left_to_torch() or _is_all_in_torch.get() or torch.is_grad_enabled():
            return self._in_torch(inputs)
        with _OPENING:
            session = self._session(inputs)
            if session is not None:
                self.answered[self.backend] += 1
        return self._in_torch(inputs) if session is None else self._run(session, inputs)

    def _session(self, inputs: "Sequence[torch.Tensor]") -> Session | None:
        """The session for inputs of these shapes, opened and checked; None leaves it to PyTorch."""
        import torch

        opened = self._opened()
        if self._threads != torch.get_num_threads():
            self._threads = torch.get_num_threads()
            opened.clear()
        shapes = tuple(tuple(one.shape) for one in inputs)
        if shapes not in opened.checked:
            if len(opened.checked) >= _MOST_SHAPES and not self._is_dynamic:
                return None
            self._open_checked(opened, inputs, shapes, self.part.run(*inputs))
            if self._is_left_to_torch():
                return None
            opened.checked.add(shapes)
            opened.forget_oldest()
        return opened.sessions[self._key(shapes)]

    def _in_torch(self, inputs: "Sequence[torch.Tensor]") -> Outputs:
        self.answered["torch"] += 1
        return self.part.run(*inputs)

    def _is_left_to_torch(self) -> bool:
        return self.backend == "torch"

    def _key(self, shapes: Shapes) -> Shapes | None:
        """What a session is kept under: inputs of these shapes, or of any."""
        return shapes if not self._is_dynamic or self.backend in _FASTER_FIXED else None

    def _open_checked(
        self,
        opened: _Opened,
        inputs: "Sequence[torch.Tensor]",
        shapes: Shapes,
        wanted: Outputs,
    ) -> None:
        """Open a session that gives `wanted`, falling back to fixed shapes and other backends."""
        while not self._is_left_to_torch():
            problem = self._try(opened, inputs, shapes, wanted)
            if not problem:
                return
            opened.clear()
            if self._is_dynamic:
                self._is_dynamic = False
            else:
                self._next_backend(problem)

    def _try(
        self,
        opened: _Opened,
        inputs: "Sequence[torch.Tensor]",
        shapes: Shapes,
        wanted: Outputs,
    ) -> str:
        """Open a session where there is none and hold it against `wanted`; says what is wrong."""
        key, problem = self._key(shapes), ""
        # What the cache holds may be damaged, or stale by code that no hash can see. A session that
        # was right for other shapes is neither.
        for anew in (False,) if key in opened.sessions else (False, True):
            try:
                if key not in opened.sessions:
                    opened.sessions[key] = self._open(inputs, anew=anew)
                problem = self._difference(self._run(opened.sessions[key], inputs), wanted)
            except Exception as error:  # runtimes raise errors of their own kinds
                problem = f"cannot run it ({_first_line(error)})"
            if not problem:
                return ""
            opened.sessions.pop(key, None)
        return problem

    def _open(self, inputs: "Sequence[torch.Tensor]", *, anew: bool) -> Session:
        from nat2024.backends.exporting import exported

        network = exported(
            self.module, self.part.run, self.name, inputs, dynamic=self._is_dynamic, anew=anew
        )
        return open_session(
            self.backend,
            network,
            device=self.device,
            threads=self._threads,
            precision=self.precision,
            shapes=[tuple(one.shape) for one in inputs],
        )

    def _run(self, session: Session, inputs: "Sequence[torch.Tensor]") -> Outputs:
        import torch

        arrays = [one.detach().cpu().contiguous().numpy() for one in inputs]
        outputs = tuple(torch.from_numpy(one).to(inputs[0].device) for one in session(arrays))
        return outputs if len(outputs) > 1 else outputs[0]

    def _difference(self, found: Outputs, wanted: Outputs) -> str:
        allowed = TOLERANCES[self.precision]
        for one, other in zip(as_tuple(found), as_tuple(wanted), strict=True):
            largest = max(float(other.abs().max()), 1.0)
            away = float((one - other).abs().max()) / largest
            if not away <= allowed:  # NaN is no agreement
                return (
                    f"differs from torch by {away:.1e} of the largest output, allowed {allowed:g}"
                )
        return ""

    def _next_backend(self, problem: str) -> None:
        message = f"{type(self.module).__name__}, {self.name}: {self.backend} {problem}"
        if len(self._backends) == 1:
            msg = f"{message}; take backend torch"
            raise BackendMismatch(msg)
        self._backends.pop(0)
        self._is_dynamic = self.part.dynamic
        log.warning("%s; %s takes over", message, self.backend)


class Recorder:
    """Runs parts as they are and keeps the inputs of each one's first call."""

    def __init__(self, parts: Mapping[str, Part]) -> None:
        self.seen: dict[str, tuple[Part, tuple[torch.Tensor, ...]]] = {}
        self.parts = {name: self._recorded(name, part) for name, part in parts.items()}

    def _recorded(self, name: str, part: Part) -> "Callable[..., Outputs]":
        def run(*inputs: "torch.Tensor") -> Outputs:
            self.seen.setdefault(name, (part, inputs))
            return part.run(*inputs)

        return run


def compile_parts(
    module: "torch.nn.Module",
    parts: Mapping[str, Part],
    backends: Sequence[BackendName],
    *,
    device: str = "cpu",
    precision: Precision = "float32",
) -> dict[str, CompiledPart]:
    """All parts of a network for some backends; nothing is exported before a part is called."""
    return {
        name: CompiledPart(module, name, part, backends, device=device, precision=precision)
        for name, part in parts.items()
    }


def as_tuple(outputs: Outputs) -> "tuple[torch.Tensor, ...]":
    """One tensor as a tuple of one."""
    return outputs if isinstance(outputs, tuple) else (outputs,)


def _first_line(error: Exception) -> str:
    lines: Any = str(error).strip().splitlines() or [type(error).__name__]
    return str(lines[0])[:200]
