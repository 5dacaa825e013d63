"""Training a tracker: pairs from photographs and from sequences with boxes, in the one loop.

A tracker can be trained if its class has `training_settings` (a msgspec record), maybe
`training_presets` and `training_options` (options that it is created with), and the method
`training_parts`; see `TrainableTracker`.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias, runtime_checkable

import msgspec

from nat2024.datasets import load_dataset
from nat2024.datasets.decoding import decode_image
from nat2024.errors import DatasetIncomplete, DatasetNotFound, FrameUnreadable, UsageError
from nat2024.files import expand
from nat2024.registry import create_tracker, load_plugin
from nat2024.training import (
    Source,
    TrainingReport,
    TrainingSettings,
    choose_preset,
    digest_of,
    set_values,
    train,
    write_weights,
)
from nat2024.training.randomness import own_random_numbers, seed_all
from nat2024.types import Boxes, FrameSource, Image

if TYPE_CHECKING:
    import torch
    from torch import nn

Clip: TypeAlias = tuple[FrameSource, Boxes]
"""Frames, and float64 (n, 4) boxes; NaN where there is no target."""

Parts: TypeAlias = (
    "tuple[Callable[[Mapping[str, Any]], Mapping[str, torch.Tensor]], Source, "
    "Callable[[nn.Module], Mapping[str, float]] | None]"
)
"""Weighted terms of the loss for a batch, the batches, and the validation."""

_PICTURES = frozenset({".jpg", ".jpeg", ".png", ".bmp"})


@runtime_checkable
class TrainableTracker(Protocol):
    """What a tracker brings to be trained, beside `model`.

    Attributes:
        training_settings: a frozen msgspec record of its own settings, whose names the loop's
            settings do not have.
        model: the network.
    """

    training_settings: msgspec.Struct
    model: Any

    def training_parts(
        self,
        photographs: Sequence[Image],
        clips: Sequence[Clip],
        settings: Any,
        *,
        seed: int,
        batch_size: int,
    ) -> Parts:
        """Loss, batches and validation for some material."""
        ...


@dataclass(frozen=True, slots=True)
class TrackerTraining:
    """What is trained, on what, and how.

    Attributes:
        name: the tracker.
        out: folder of the training; the weights are written as `NAME.safetensors` in it.
        photographs: folder of images that objects are cut from and laid on; None for none.
        sequences: name or path of a dataset with boxes; empty for none.
        root: as in `load_dataset`.
        options: of the tracker, such as `variant`.
        loop: settings of the loop.
        own: settings of the tracker's training.
        start: weights to start from; None for fresh ones.
        device: where it runs.
    """

    name: str
    out: Path
    photographs: Path | None = None
    sequences: str = ""
    root: Path | None = None
    options: Mapping[str, Any] = field(default_factory=dict)
    loop: TrainingSettings = field(default_factory=TrainingSettings)
    own: Any = None
    start: Path | None = None
    device: str = "cpu"


@dataclass(frozen=True, slots=True)
class TrackerTrainingReport:
    """What a training came to.

    Attributes:
        weights: the file that was written.
        photographs: how many there are.
        clips: how many sequences with boxes there are.
        training: the loop's report.
    """

    weights: Path
    photographs: int
    clips: int
    training: TrainingReport


def list_presets(name: str) -> dict[str, Mapping[str, Any]]:
    """Presets of a tracker by name, "default" always among them.

    Raises:
        UsageError: it cannot be trained.
    """
    return {"default": {}, **getattr(_trainable(name), "training_presets", {})}


def _trainable(name: str) -> type[Any]:
    cls = load_plugin(name, "tracker")
    if not (hasattr(cls, "training_settings") and hasattr(cls, "training_parts")):
        msg = f"{name} cannot be trained: its class has no training_settings and training_parts"
        raise UsageError(msg)
    return cls


def choose_settings(
    name: str, preset: str, values: Mapping[str, Any]
) -> tuple[TrainingSettings, Any]:
    """Settings of the loop and of the tracker's own: a preset's, changed by values.

    Raises:
        UsageError: the tracker cannot be trained.
        InvalidOption: no such preset or setting, or a value does not fit.
    """
    own = _trainable(name).training_settings
    preset_values = choose_preset(name, preset, list_presets(name))
    loop, chosen = set_values((TrainingSettings(), own), {**preset_values, **values})
    assert isinstance(loop, TrainingSettings)
    return loop, chosen


def train_tracker(
    training: TrackerTraining,
    *,
    minutes: float | None = None,
    on_progress: "Callable[[int, str], object] | None" = None,
    on_total: Callable[[int], object] = lambda _total: None,
) -> TrackerTrainingReport:
    """Train a tracker's network, or go on where that was stopped, and write its weights.

    Args:
        training: what, on what and how.
        minutes: stop after so long; called again it goes on.
        on_progress: called with (steps done since the last call, what to show).
        on_total: called with the number of steps.

    Raises:
        UsageError: no material is named.
        DatasetIncomplete: no image in a folder, or no box in a dataset.
        FrameUnreadable: an image cannot be decoded; names it.
    """
    if training.photographs is None and not training.sequences:
        msg = f"{training.name}: name photographs, or sequences with boxes, to train on"
        raise UsageError(msg)
    photographs = read_photographs(training.photographs) if training.photographs else []
    clips = read_clips(training.sequences, training.root) if training.sequences else []
    defaults = getattr(_trainable(training.name), "training_options", {})
    training = replace(training, options={**defaults, **training.options})
    loop = training.loop
    with own_random_numbers():
        seed_all(loop.seed)  # of fresh weights
        tracker = create_tracker(
            training.name,
            weights=training.start or False,
            device=training.device,
            **training.options,
        )
    assert isinstance(tracker, TrainableTracker)
    loss, source, validate = tracker.training_parts(
        photographs, clips, training.own, seed=loop.seed, batch_size=loop.batch_size
    )
    on_total(loop.epochs * source.steps_per_epoch if loop.epochs else loop.steps)
    report = train(
        tracker.model,
        loss,
        source,
        loop,
        training.out,
        identity=_identity(training, len(photographs), len(clips)),
        validate=validate,
        minutes=minutes,
        on_progress=on_progress,
        device=training.device,
    )
    weights = training.out / f"{training.name}.safetensors"
    write_weights(weights, tracker.model, {"tracker": training.name})
    return TrackerTrainingReport(weights, len(photographs), len(clips), report)


def read_photographs(folder: Path) -> list[Image]:
    """All images of a folder and its sub-folders, by name, uint8 (H, W, 3) BGR.

    Raises:
        DatasetNotFound: no such folder.
        DatasetIncomplete: it has no image.
        FrameUnreadable: one cannot be decoded; names it.
    """
    folder = expand(folder)
    if not folder.is_dir():
        msg = f"{folder}: no such folder of photographs"
        raise DatasetNotFound(msg)
    paths = sorted(path for path in folder.rglob("*") if path.suffix.lower() in _PICTURES)
    if not paths:
        msg = f"{folder}: no image in it; photographs are {', '.join(sorted(_PICTURES))} files"
        raise DatasetIncomplete(msg)
    return [_read(path) for path in paths]


def _read(path: Path) -> Image:
    try:
        data = path.read_bytes()
    except OSError as error:
        msg = f"{path}: cannot be read ({error.strerror or error})"
        raise FrameUnreadable(msg) from None
    return decode_image(data, str(path))


def read_clips(source: str, root: Path | None = None) -> list[Clip]:
    """Frames, decoded when asked for, and boxes of all annotated sequences of a dataset.

    Raises:
        DatasetIncomplete: none has a usable box.
    """
    import numpy as np

    clips: list[Clip] = [
        (sequence.frames, sequence.boxes)
        for sequence in load_dataset(source, root)
        if np.isfinite(sequence.boxes).all(axis=1).any()
    ]
    if not clips:
        msg = f"{source}: no sequence with boxes to train on"
        raise DatasetIncomplete(msg)
    return clips


def _identity(training: TrackerTraining, photographs: int, clips: int) -> dict[str, Any]:
    return {
        "tracker": training.name,
        "options": dict(training.options),
        "own": msgspec.to_builtins(training.own),
        "start": digest_of(training.start),
        "photographs": photographs,
        "clips": clips,
    }
