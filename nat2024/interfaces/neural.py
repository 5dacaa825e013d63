"""Enhancers with a network, on whatever backend: the author gives the network and its stride."""

import contextlib
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from nat2024.backends import (
    OPENVINO_FIRST,
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
from nat2024.devices import explain_lack_of_memory
from nat2024.images import batch_to_image, check_batch, check_image, image_to_batch
from nat2024.interfaces.enhancers import Enhancer
from nat2024.interfaces.loading import load_weights
from nat2024.types import Image
from nat2024.zoo import WeightsSpec, find_weights, read_checkpoint

if TYPE_CHECKING:
    import torch

    from nat2024.networks.replaying import Replayed
    from nat2024.zoo import StateDict


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
        can_replay: whether `forward` depends on the batch and on `model` alone, asks for no
            tensor's value and always does the same: then CUDA devices replay it
            (`networks.replaying`).
        backend: what runs the network.
    """

    stride: int = 1
    can_replay: ClassVar[bool] = False
    fastest_backends: ClassVar[tuple[BackendName, ...]] = OPENVINO_FIRST
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
        self._replayed: Replayed | None = None
        self._parts = compile_parts(
            self.model, self.parts(), backends, device=device, precision=precision
        )

    @property
    def answered(self) -> "Counter[BackendName]":
        """How many calls of parts of the network each backend has answered."""
        return sum((part.answered for part in self._parts.values()), Counter())

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

    def _forward(self, padded: "torch.Tensor") -> "torch.Tensor":
        if not self.can_replay or self.device == "cpu":
            return self.forward(padded)
        if self._replayed is None or self._replayed.module is not self.model:
            from nat2024.networks.replaying import Replayed

            self._replayed = Replayed(self.model, self.forward)
        enhanced: torch.Tensor = self._replayed(padded)
        return enhanced

    def _run(self, batch: "torch.Tensor") -> "torch.Tensor":
        height, width = batch.shape[-2:]
        padded, top, left = self.pad(batch.to(self.device))
        if self.backend == "torch":
            enhanced = self._forward(padded)
        else:
            enhanced = self.forward_parts(self._parts, padded)
        enhanced = enhanced[..., top : top + height, left : left + width]
        return enhanced.clamp(0.0, 1.0) if self.clamp else enhanced.contiguous()
