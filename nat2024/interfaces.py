"""What an enhancer and a tracker are; base classes that leave an author one method each.

An enhancer sees no tracker, and a tracker sees at most a thing with `enhance_batch`: N + M
adapters make N x M combinations.
"""

import contextlib
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Protocol, TypeAlias, runtime_checkable

import numpy as np

from nat2024.backends import (
    FASTEST_FIRST,
    BackendName,
    BackendWish,
    ExportedPart,
    Part,
    Precision,
    Recorder,
    backends_of,
    compile_parts,
    write_onnx,
)
from nat2024.cards import Card
from nat2024.devices import check_device, explain_lack_of_memory
from nat2024.errors import ArrayContract, InvalidOption, UsageError
from nat2024.images import batch_to_image, check_batch, check_image, image_to_batch
from nat2024.types import Box, Image
from nat2024.zoo import Weights, WeightsSpec, find_weights, fit_state_dict, read_checkpoint

if TYPE_CHECKING:
    import torch

    from nat2024.zoo import StateDict

Scope: TypeAlias = Literal["patch", "frame"]
"""What is enhanced: the tracker's template and search crops, or the whole frame."""


@runtime_checkable
class BatchEnhancer(Protocol):
    """All that a tracker asks of an enhancer."""

    def enhance_batch(self, batch: "torch.Tensor", /) -> "torch.Tensor":
        """float32 (N, 3, H, W) in 0..1 to the same shape and range."""
        ...


class Enhancer:
    """A low-light enhancer. Write either `enhance` or `enhance_batch`; the other follows.

    Attributes:
        name: registered name, set by `register_enhancer`.
        card: what it is and whose work it is.
        device: where batches live.
        weights: what it was created with, None for methods without weights.
    """

    name: ClassVar[str] = ""
    card: ClassVar[Card]
    device: str
    weights: Weights | None = None

    def __init__(self, *, device: str = "cpu") -> None:
        self.device = check_device(device)

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        if cls.enhance is Enhancer.enhance and cls.enhance_batch is Enhancer.enhance_batch:
            msg = f"{cls.__name__} must define enhance or enhance_batch"
            raise TypeError(msg)

    def enhance(self, image: Image, *, bgr: bool = False) -> Image:
        """Enhance one image, uint8 (H, W, 3) to uint8 (H, W, 3), rounded to nearest.

        The method sees RGB, as the authors' stand-alone tests feed it.

        Args:
            image: any height and width of at least 1; not modified.
            bgr: whether `image` (and the answer) is in BGR order, as OpenCV reads it.

        Raises:
            ArrayContract: `image` is not uint8 (H, W, 3).
            OutOfMemory: the image is too large for the device.
        """
        height, width = check_image(image).shape[:2]
        with explain_lack_of_memory(self.name, height, width):
            batch = image_to_batch(image, self.device, reverse=bgr)
            return batch_to_image(self.enhance_batch(batch), reverse=bgr)

    def enhance_batch(self, batch: "torch.Tensor") -> "torch.Tensor":
        """Enhance float32 (N, 3, H, W) in 0..1, channels fed in the order given.

        Trackers call it on BGR crops, or on the BGR frame where the scope is "frame".

        Raises:
            ArrayContract: `batch` is not float32 (N, 3, H, W).
        """
        import torch

        check_batch(batch)
        images = [self.enhance(batch_to_image(one.unsqueeze(0))) for one in batch]
        return torch.cat([image_to_batch(image, self.device) for image in images])

    def maps(self, batch: "torch.Tensor") -> "dict[str, torch.Tensor]":
        """Intermediate maps by name, channels fed in the order given; empty where there are none.

        Raises:
            ArrayContract: `batch` is not float32 (N, 3, H, W).
        """
        check_batch(batch)
        return {}


class NeuralEnhancer(Enhancer, ABC):
    """An enhancer with a network: pads to the network's stride, runs it, cuts back, clamps.

    A subclass gives `build` (the network), `forward` (padded batch to enhanced batch) and `stride`;
    `pad` where its authors pad otherwise; `parts` and `forward_parts` where another backend should
    run less than all of `forward`. A state dict loaded into `.model` takes effect at the
    next call: what a network derives from its weights follows them (`networks.folding.Derived`).

    Attributes:
        stride: sides are padded up to multiples of this.
        image_order: the order in which the network sees the channels of images that `enhance`
            gets, as the authors' stand-alone test feeds them.
        fastest_backends: what "auto" tries on a CPU, measured by `benchmarks/backend_speed.py`.
        backend: what runs the network.
    """

    stride: int = 1
    fastest_backends: ClassVar[tuple[BackendName, ...]] = FASTEST_FIRST
    image_order: ClassVar[Literal["rgb", "bgr"]] = "rgb"

    def __init__(
        self,
        *,
        weights: WeightsSpec = None,
        device: str = "cpu",
        clamp: bool = True,
        channel_order: Literal["as_given", "rgb"] = "as_given",
        quantise: Literal["round", "truncate"] = "round",
        backend: BackendWish = "torch",
        precision: Precision = "float32",
    ) -> None:
        """Build the network and load its weights.

        Args:
            weights: a checkpoint path, False for fresh initial weights, None for the best at hand.
            device: where the network runs, such as "cpu" or "cuda:1".
            clamp: whether outputs are limited to 0..1; False gives the raw network output.
            channel_order: what `enhance_batch` feeds the network: "as_given", or "rgb" for
                batches that come in BGR and are turned before and after the network.
            quantise: how `enhance` makes 8-bit numbers: "round" to nearest, or "truncate" as some
                authors' stand-alone tests do when they save.
            backend: what runs the network: "torch", "onnxruntime", "openvino", "tensorrt", or
                "auto" for the fastest one installed; each is held against torch before it is used.
            precision: what the backend computes in.
        """
        super().__init__(device=device)
        self.clamp = clamp
        self.channel_order = channel_order
        self.quantise: Literal["round", "truncate"] = quantise
        backends = backends_of(backend, device, precision, self.fastest_backends)
        self.backend, self.precision = backends[0], precision
        self.weights = find_weights(self.name, weights, self.card)
        model = self.build()
        load_weights(model, self.weights, self.read_state)
        self.model: torch.nn.Module = model.to(device).eval()
        self._parts = compile_parts(
            self.model, self.parts(), backends, device=device, precision=precision
        )

    @abstractmethod
    def build(self) -> "torch.nn.Module":
        """The network, with the official checkpoint's keys and shapes."""

    def read_state(self, path: Path) -> "StateDict":
        """Read the state dict of a weights file; a subclass may know more forms of files.

        Raises:
            WeightsMissing: no such file.
            WeightsMismatch: unreadable, unsafe, or no state dict in it.
        """
        return read_checkpoint(path)

    @abstractmethod
    def forward(self, batch: "torch.Tensor") -> "torch.Tensor":
        """Enhance a batch whose sides are multiples of `stride`; no clamp."""

    def parts(self) -> Mapping[str, Part]:
        """What another backend runs, by name; all of `forward` by default."""
        return {"network": Part(self.forward)}

    def forward_parts(
        self, parts: "Mapping[str, Callable[..., Any]]", batch: "torch.Tensor"
    ) -> "torch.Tensor":
        """`forward`, put together from its parts as another backend runs them."""
        enhanced: torch.Tensor = parts["network"](batch)
        return enhanced

    def export_onnx(
        self, folder: str | Path, *, size: tuple[int, int] = (288, 288)
    ) -> list[ExportedPart]:
        """Write the network as `FOLDER/NAME-PART.onnx`, for batches of sides that `stride` divides.

        What lies between the parts of a network that has several stays in `forward_parts`.

        Args:
            folder: made where absent.
            size: width and height of the image that is exported and checked with; files take
                other sizes where the network allows it.

        Raises:
            BackendMismatch: the network cannot be exported, or gives other numbers then.
            Unwritable: the file system refuses.
        """
        import torch

        width, height = size
        generator = torch.Generator().manual_seed(0)
        dark = torch.rand(1, 3, height, width, generator=generator) ** 2
        recorder = Recorder(self.parts())
        with self._inference(height, width):
            self.forward_parts(recorder.parts, self.pad(dark.to(self.device))[0])
        return write_onnx(self.model, recorder.seen, Path(folder), self.name)

    def forward_maps(self, batch: "torch.Tensor") -> "dict[str, torch.Tensor]":  # noqa: ARG002
        """Intermediate maps of a batch whose sides are multiples of `stride`; none by default."""
        return {}

    def enhance(self, image: Image, *, bgr: bool = False) -> Image:
        """Enhance one image; see `Enhancer.enhance`. The network sees it in `image_order`."""
        reverse = bgr != (self.image_order == "bgr")
        height, width = check_image(image).shape[:2]
        with self._inference(height, width):
            batch = image_to_batch(image, self.device, reverse=reverse)
            return batch_to_image(self._run(batch), reverse=reverse, quantise=self.quantise)

    def enhance_batch(self, batch: "torch.Tensor") -> "torch.Tensor":
        """Enhance a batch; see `Enhancer.enhance_batch`."""
        check_batch(batch)
        count, _, height, width = batch.shape
        with self._inference(height, width, count):
            if self.channel_order == "rgb":
                return self._run(batch.flip(1)).flip(1)
            return self._run(batch)

    def maps(self, batch: "torch.Tensor") -> "dict[str, torch.Tensor]":
        """Intermediate maps of the network at padded size, channels fed in the order given."""
        check_batch(batch)
        count, _, height, width = batch.shape
        with self._inference(height, width, count):
            return self.forward_maps(self.pad(batch.to(self.device))[0])

    def pad(self, batch: "torch.Tensor") -> "tuple[torch.Tensor, int, int]":
        """Pad to sizes that the network takes; also the row and column where the batch begins."""
        from nat2024.networks.padding import pad_to_multiple

        return pad_to_multiple(batch, self.stride)

    @contextlib.contextmanager
    def _inference(self, height: int, width: int, count: int = 1) -> "Iterator[None]":
        """Without gradients, in float32 whatever the caller's autocast, memory explained."""
        import torch

        autocast = torch.autocast(self.device.partition(":")[0], enabled=False)
        # not inference_mode: what comes out may enter somebody's training
        with torch.no_grad(), autocast, explain_lack_of_memory(self.name, height, width, count):
            yield

    def _run(self, batch: "torch.Tensor") -> "torch.Tensor":
        height, width = batch.shape[-2:]
        padded, top, left = self.pad(batch.to(self.device))
        if self.backend == "torch":
            enhanced = self.forward(padded)
        else:
            enhanced = self.forward_parts(self._parts, padded)
        enhanced = enhanced[..., top : top + height, left : left + width]
        return enhanced.clamp(0.0, 1.0) if self.clamp else enhanced.contiguous()


def load_weights(
    model: "torch.nn.Module",
    weights: Weights,
    read: "Callable[[Path], StateDict]" = read_checkpoint,
) -> None:
    """Load `weights` into `model` as `read` gives them; nothing for fresh weights.

    Raises:
        WeightsMismatch: the file is unsafe, unreadable or of another network.
    """
    if weights.path is None:
        return
    state = read(weights.path)
    fitting = fit_state_dict(state, model.state_dict(), str(weights.path))
    model.load_state_dict({**model.state_dict(), **fitting})


class Tracker(ABC):
    """A single-object tracker. Write `start` and `advance`.

    Attributes:
        name: registered name, set by `register_tracker`.
        card: what it is and whose work it is; `card.scopes` says which scopes it can do.
        enhancer: applied to the crops or to the frame, None for the plain tracker.
        scope: "patch" or "frame".
        weights: what it was created with, None for methods without weights.
    """

    name: ClassVar[str] = ""
    card: ClassVar[Card]
    weights: Weights | None = None
    _has_started: bool = False

    def __init__(
        self,
        *,
        enhancer: BatchEnhancer | None = None,
        device: str = "cpu",
        scope: Scope | None = None,
    ) -> None:
        """Keep what all trackers share.

        Args:
            enhancer: anything with `enhance_batch`.
            device: where networks run.
            scope: what is enhanced; None takes the tracker's own default, the card's first.

        Raises:
            InvalidOption: the tracker cannot do that scope.
        """
        self.scope: Scope = scope or self.card.scopes[0]
        if self.scope not in self.card.scopes:
            msg = f"{self.name} takes only scope={' or '.join(self.card.scopes)}, not {scope}"
            raise InvalidOption(msg)
        self.enhancer = enhancer
        self.device = check_device(device)

    def init(self, image: Image, box: Any) -> Box:
        """Start on a frame.

        Args:
            image: uint8 (H, W, 3) BGR.
            box: x, y, w, h as annotated, 0-based pixels, floats allowed.

        Returns:
            The float64 (4,) box that results hold as row 0.

        Raises:
            ArrayContract: the image is no image, or the box is not four finite numbers with a
                size above zero that touch the image.
        """
        check_image(image)
        self._has_started = False
        row = self.start(self._enhance_frame(image), check_start_box(box, image))
        self._has_started = True
        return row

    def update(self, image: Image) -> tuple[Box, float]:
        """Follow the target into the next frame, uint8 (H, W, 3) BGR; gives (box, score).

        Raises:
            ArrayContract: the image is no image.
            UsageError: there was no `init`, or it failed.
        """
        if not self._has_started:
            msg = f"{self.name}: update before init; call init(image, box) on the first frame"
            raise UsageError(msg)
        return self.advance(self._enhance_frame(check_image(image)))

    @abstractmethod
    def start(self, image: Image, box: Box) -> Box:
        """Forget everything and start on this (already frame-enhanced) image; see `init`."""

    @abstractmethod
    def advance(self, image: Image) -> tuple[Box, float]:
        """Follow into this (already frame-enhanced) image; see `update`."""

    def _enhance_frame(self, image: Image) -> Image:
        if self.enhancer is None or self.scope != "frame":
            return image
        return enhance_frame(self.enhancer, image, self.device)


def enhance_frame(enhancer: BatchEnhancer, frame: Image, device: str) -> Image:
    """Enhance a uint8 BGR frame, fed to `enhance_batch` as BGR, rounded to nearest.

    An enhancer that has a method `enhance_frame` of its own is asked that instead.
    """
    own = getattr(enhancer, "enhance_frame", None)
    if own is not None:
        enhanced: Image = own(frame)
        return enhanced
    name = getattr(enhancer, "name", "") or "the enhancer"
    with explain_lack_of_memory(name, *frame.shape[:2]):
        return batch_to_image(run_enhancer(enhancer, image_to_batch(frame), device))


def run_enhancer(enhancer: BatchEnhancer, batch: "torch.Tensor", device: str) -> "torch.Tensor":
    """Enhance crops or a frame on the enhancer's own device; without gradients.

    Args:
        enhancer: anything with `enhance_batch`.
        batch: float32 (N, 3, H, W) in 0..1.
        device: where an enhancer that tells no device gets it.

    Returns:
        A tensor of the same shape, on the enhancer's device; its range is the enhancer's.

    Raises:
        ArrayContract: the enhancer gives no tensor, or one of another shape.
    """
    import torch

    with torch.no_grad():
        enhanced = enhancer.enhance_batch(batch.to(getattr(enhancer, "device", device)))
    if not isinstance(enhanced, torch.Tensor):
        msg = f"the enhancer must give a tensor, not {type(enhanced).__name__}"
        raise ArrayContract(msg)
    if enhanced.shape != batch.shape:
        msg = (
            f"the enhancer turned a batch of shape {tuple(batch.shape)} into "
            f"{tuple(enhanced.shape)}; it must keep the shape"
        )
        raise ArrayContract(msg)
    return enhanced.detach()


def check_start_box(box: Any, image: Image) -> Box:
    """Return the box as float64 (4,) if a tracker can start on it, else raise `ArrayContract`."""
    try:
        start = np.array(box, dtype=np.float64).reshape(-1)
    except (TypeError, ValueError):
        start = np.empty(0)
    height, width = image.shape[:2]
    if start.shape != (4,) or not np.isfinite(start).all():
        told = box.tolist() if isinstance(box, np.ndarray) else box
        msg = f"start box must be four finite numbers x, y, w, h, not {told!r:.60}"
        raise ArrayContract(msg)
    x, y, w, h = start
    if w <= 0 or h <= 0:
        msg = f"start box {start.tolist()} has no area; width and height must be above 0"
        raise ArrayContract(msg)
    if x >= width or y >= height or x + w <= 0 or y + h <= 0:
        msg = f"start box {start.tolist()} lies outside the {width}x{height} image"
        raise ArrayContract(msg)
    return start
