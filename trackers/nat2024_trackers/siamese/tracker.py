"""The loop: crop, enhance, network, decode, penalise, update, for one or several sequences."""

import copy
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, Self, TypeAlias

import numpy as np
import numpy.typing as npt

from nat2024.backends import (
    TORCH_FIRST,
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
from nat2024.errors import UsageError
from nat2024.interfaces import BatchEnhancer, Scope, Tracker, load_weights, run_enhancer
from nat2024.types import Box, Floats, Image
from nat2024.zoo import WeightsSpec, find_weights
from nat2024_trackers.siamese.batches import Crops
from nat2024_trackers.siamese.crops import mean_color, search_window, template_side
from nat2024_trackers.siamese.selection import cosine_window, select
from nat2024_trackers.siamese.state import (
    Candidates,
    Constants,
    Features,
    FirstFrame,
    Step,
    Target,
)

if TYPE_CHECKING:
    import torch

Maps: TypeAlias = tuple[npt.NDArray[np.float32], ...]
"""Outputs of a network, float32 (n, channels, map, map) each."""

Decoder: TypeAlias = Callable[[Maps], Candidates]
"""From a network's outputs to scores and boxes."""


_NEAR = 4
"""Sequences whose candidates are judged at once: those of more do not fit into caches."""


class SiameseNetwork(Protocol):
    """What the loop asks of a network; crops are float32 (n, 3, side, side), 0..255, BGR."""

    def embed(self, template: "torch.Tensor", /) -> Features:
        """Everything that depends on the template crops only; axis 0 counts the sequences."""
        ...

    def match(self, features: Features, search: "torch.Tensor", /) -> "tuple[torch.Tensor, ...]":
        """Response maps of the search crops, (n, channels, map, map) each."""
        ...


class SiameseTracker(Tracker):
    """A tracker made of a network, a decoder and constants.

    Template features are computed at `init`, so weights loaded into `.model` take effect at the
    next `init`.

    Attributes:
        model: the network, a `SiameseNetwork`, in eval mode.
        decoder: from the network's outputs to candidates.
        constants: of this tracker and variant.
        enhance_template: whether the enhancer sees the template crop too (scope "patch").
        fastest_backends: what "auto" tries on a CPU, measured by `benchmarks/backend_speed.py`.
        backend: what runs the network.
        last_step: outcome of the latest `update`, None right after `init`.
    """

    fastest_backends: ClassVar[tuple[BackendName, ...]] = TORCH_FIRST

    def __init__(
        self,
        model: "torch.nn.Module",
        decoder: Decoder,
        constants: Constants,
        *,
        enhancer: BatchEnhancer | None = None,
        device: str = "cpu",
        scope: Scope | None = None,
        enhance_template: bool = True,
        backend: BackendWish = "torch",
        precision: Precision = "float32",
    ) -> None:
        """Put the parts together; `enhancer`, `device` and `scope` as in `Tracker`.

        Args:
            model: the network.
            decoder: of its outputs.
            constants: of the tracker.
            enhancer: anything with `enhance_batch`.
            device: where the network runs, such as "cpu" or "cuda:1".
            scope: what is enhanced: "patch" (default) or "frame".
            enhance_template: whether the template crop is enhanced too.
            backend: what runs the network: "torch", "onnxruntime", "openvino", "tensorrt", or
                "auto" for the fastest one installed; each is held against torch before it is used.
            precision: what the backend computes in.
        """
        super().__init__(enhancer=enhancer, device=device, scope=scope)
        backends = backends_of(backend, self.device, precision, self.fastest_backends)
        self.backend, self.precision = backends[0], precision
        self.model: Any = model.to(device).eval()
        self._parts = compile_parts(
            self.model, self.parts(), backends, device=device, precision=precision
        )
        self._answered_before: Counter[BackendName] = Counter()
        self._compiled = _PartedNetwork(self._parts)
        self._replayed: tuple[Any, _PartedNetwork] | None = None
        self.decoder = decoder
        self.constants = constants
        self.enhance_template = enhance_template
        self._window: Floats = cosine_window(constants)
        self.forget()
        self._has_matched = self.backend == "torch"

    def twin(self, enhancer: BatchEnhancer | None) -> Self:
        """Another tracker over the same network, with an enhancer and a state of its own."""
        _ = self.network  # what replays it is shared as well
        other = copy.copy(self)
        other.enhancer = enhancer
        other._answered_before = self._all_answered()
        other.forget()
        return other

    def forget(self) -> None:
        """Be as before `init`."""
        self._has_started = False
        self._first: FirstFrame | None = None
        self._target: Target | None = None
        self.last_step: Step | None = None
        self._crops = Crops(self.device)

    @property
    def network(self) -> SiameseNetwork:
        """What the loop runs: `model`, or what stands for it outside PyTorch."""
        if self.backend != "torch":
            return self._compiled
        if self.device == "cpu":
            network: SiameseNetwork = self.model
            return network
        if self._replayed is None or self._replayed[0] is not self.model:
            from nat2024.networks.replaying import Replayed

            parts = {name: Replayed(self.model, part.run) for name, part in self.parts().items()}
            self._replayed = self.model, _PartedNetwork(parts)
        return self._replayed[1]

    @property
    def answered(self) -> "Counter[BackendName]":
        """How many calls of parts of the network each backend has answered for this tracker.

        Those of twins that are on their way meanwhile count too: their network is the same.
        """
        return self._all_answered() - self._answered_before

    def _all_answered(self) -> "Counter[BackendName]":
        return sum((part.answered for part in self._parts.values()), Counter())

    def parts(self) -> dict[str, Part]:
        """What another backend runs; sizes of crops are constants of the tracker."""
        return {
            "embed": Part(lambda template: self.model.embed(template), dynamic=False),
            "match": Part(lambda search, *of: self.model.match(of, search), dynamic=False),
        }

    @property
    def target(self) -> Target:
        """The state: where the target was last seen. It may be set, to go on from elsewhere."""
        return self._started()[1]

    @target.setter
    def target(self, target: Target) -> None:
        self._started()
        self._target = target

    def export_onnx(self, folder: str | Path) -> list[ExportedPart]:
        """Write the network as `FOLDER/NAME-embed.onnx` and `FOLDER/NAME-match.onnx`.

        The first takes template crops (1, 3, side, side), 0..255, BGR; the second takes search
        crops and then what the first gave.

        Raises:
            BackendMismatch: the network cannot be exported, or gives other numbers then.
            Unwritable: the file system refuses.
        """
        import torch

        generator = torch.Generator(self.device).manual_seed(0)
        sides = (self.constants.exemplar_size, self.constants.instance_size)
        template, search = (
            255 * torch.rand(1, 3, side, side, generator=generator, device=self.device)
            for side in sides
        )
        recorder = Recorder(self.parts())
        network = _PartedNetwork(recorder.parts)
        with torch.no_grad():
            network.match(network.embed(template), search)
        return write_onnx(self.model, recorder.seen, Path(folder), self.name)

    def start(self, image: Image, box: Box) -> Box:
        """Start on an image; the answer is x + 0.5, y + 0.5, w, h as official testers write it."""
        self._first, self._target = self.begin(image, box)
        if not self._has_matched:
            self._match_once(image, self._first, self._target)
        self.last_step = None
        x, y, width, height = box.tolist()
        return np.array([x + 0.5, y + 0.5, width, height], dtype=np.float64)

    def advance(self, image: Image) -> tuple[Box, float]:
        """Follow into the next image; the score is the network's own, without penalty."""
        first, target = self._started()
        [step] = self.update_many([image], [first], [target])
        self._target, self.last_step = step.target, step
        return step.box, step.score

    def begin(self, image: Image, box: Box) -> tuple[FirstFrame, Target]:
        """First frame of any sequence, without touching this tracker's own state."""
        target = Target.from_annotation(box)
        side = template_side(target, self.constants)
        fill = mean_color(image)
        template = self._crops.cut(self.constants.exemplar_size, [image], [target], [side], [fill])
        return FirstFrame(fill, side, self._embed(template)), target

    def update_many(
        self, images: Sequence[Image], firsts: Sequence[FirstFrame], targets: Sequence[Target]
    ) -> list[Step]:
        """One frame of several sequences in one batch, without touching this tracker's own state.

        Args:
            images: the next frame of each sequence; sizes may differ.
            firsts: what `begin` gave for each.
            targets: the state of each.
        """
        constants = self.constants
        sizes = [(image.shape[1], image.shape[0]) for image in images]
        windows = [
            search_window(target, first, size, constants)
            for target, first, size in zip(targets, firsts, sizes, strict=True)
        ]
        crops = self._crops.cut(
            constants.instance_size,
            images,
            targets,
            [window.side for window in windows],
            [first.fill for first in firsts],
        )
        maps = self._match([first.features for first in firsts], crops)
        steps: list[Step] = []
        for start in range(0, len(images), _NEAR):
            rows = slice(start, start + _NEAR)
            steps += select(
                self.decoder(tuple(part[rows] for part in maps)),
                targets[rows],
                windows[rows],
                self._window,
                sizes[rows],
                constants,
            )
        return steps

    def _match_once(self, image: Image, first: FirstFrame, target: Target) -> None:
        """Let the backend open the network, so that its time counts for the first frame.

        The enhancer is not asked: one that remembers frames would get to see this one twice.
        """
        import torch

        window = search_window(target, first, (image.shape[1], image.shape[0]), self.constants)
        size = self.constants.instance_size
        search = self._crops.cut(size, [image], [target], [window.side], [first.fill])
        with torch.inference_mode():
            self.network.match(first.features, self._pixels(search))
        self._has_matched = True

    def _started(self) -> tuple[FirstFrame, Target]:
        if self._first is None or self._target is None:
            msg = f"{self.name}: update before init; call init(image, box) on the first frame"
            raise UsageError(msg)
        return self._first, self._target

    def _embed(self, crops: "torch.Tensor") -> Features:
        import torch

        batch = self._batch(crops, enhanced=self.enhance_template)
        with torch.inference_mode():
            features: Features = self.network.embed(batch)
        return features

    def _match(self, features: Sequence[Features], crops: "torch.Tensor") -> Maps:
        import torch

        batch = self._batch(crops, enhanced=True)
        with torch.inference_mode():
            joined = tuple(torch.cat(parts) for parts in zip(*features, strict=True))
            outputs = self.network.match(joined, batch)
        return tuple(output.float().cpu().numpy() for output in outputs)

    def _batch(self, crops: "torch.Tensor", *, enhanced: bool) -> "torch.Tensor":
        """float32 (n, 3, side, side) in 0..255, BGR; enhanced crops are not rounded."""
        import torch

        batch = self._pixels(crops)
        if self.enhancer is None or self.scope != "patch" or not enhanced:
            return batch
        better = run_enhancer(self.enhancer, batch / 255.0, self.device)
        return better.to(device=batch.device, dtype=torch.float32) * 255.0

    def _pixels(self, crops: "torch.Tensor") -> "torch.Tensor":
        import torch

        pixels = crops.to(self.device).permute(0, 3, 1, 2)
        return pixels.to(torch.float32, memory_format=torch.contiguous_format)


class _PartedNetwork:
    """A `SiameseNetwork` made of its two parts as something else runs them."""

    def __init__(self, parts: Mapping[str, Callable[..., Any]]) -> None:
        self._parts = parts

    def embed(self, template: "torch.Tensor") -> Features:
        """As the network's own."""
        features = self._parts["embed"](template)
        return features if isinstance(features, tuple) else (features,)

    def match(self, features: Features, search: "torch.Tensor") -> "tuple[torch.Tensor, ...]":
        """As the network's own."""
        maps = self._parts["match"](search, *features)
        return maps if isinstance(maps, tuple) else (maps,)


class OneNetworkTracker(SiameseTracker, ABC):
    """A Siamese tracker that has one network and one set of constants; a subclass names them."""

    def __init__(self, *, weights: WeightsSpec = None, **base: Any) -> None:
        """Build the network and load its weights; `base` as in `SiameseTracker`.

        Args:
            weights: a checkpoint path, False for fresh initial weights, None for the best at hand.
            base: `enhancer`, `device`, `scope`, `enhance_template`, `backend`, `precision`.

        Raises:
            WeightsMissing, WeightsMismatch: no weights, or of another network.
        """
        self.weights = find_weights(self.name, weights, self.card)
        model, decoder, constants = self.build()
        load_weights(model, self.weights)
        super().__init__(model, decoder, constants, **base)

    @abstractmethod
    def build(self) -> "tuple[torch.nn.Module, Decoder, Constants]":
        """The network with the official checkpoint's keys, the decoder and the constants."""
