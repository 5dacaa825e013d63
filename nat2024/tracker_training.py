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
from nat2024.errors import DatasetIncomplete, DatasetNotFound, FrameUnreadable, UsageError
from nat2024.files import expand
from nat2024.registry import create_tracker, load_plugin
from nat2024.training import (
    Source,
    TrainingReport,
    TrainingSettings,
    set_values,
    train,
    write_weights,
)
from nat2024.types import Boxes, FrameSource, Image, closest

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

_PICTURES = frozenset({".jpg", ".jpeg", ".png", ".bmp", ".webp"})


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


def choose_settings(
    name: str, preset: str, values: Mapping[str, Any]
) -> tuple[TrainingSettings, Any]:
    """Settings of the loop and of the tracker's own: a preset's, changed by values.

    Raises:
        UsageError: the tracker cannot be trained, or has no such preset.
        InvalidOption: no such setting, or a value does not fit.
    """
    cls = load_plugin(name, "tracker")
    own = getattr(cls, "training_settings", None)
    if own is None or not hasattr(cls, "training_parts"):
        msg = f"{name} cannot be trained: its class has no training_settings and training_parts"
        raise UsageError(msg)
    presets: Mapping[str, Mapping[str, Any]] = getattr(cls, "training_presets", {"default": {}})
    if preset not in presets:
        msg = f"{name} has no preset {preset!r}{closest(preset, presets)}; "
        msg += f"it has {', '.join(presets)}"
        raise UsageError(msg)
    loop, chosen = set_values((TrainingSettings(), own), {**presets[preset], **values})
    assert isinstance(loop, TrainingSettings)
    return loop, chosen


def train_tracker(
    training: TrackerTraining,
    *,
    minutes: float | None = None,
    on_progress: "Callable[[int, str], object] | None" = None,
) -> TrackerTrainingReport:
    """Train a tracker's network, or go on where that was stopped, and write its weights.

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
    defaults = getattr(load_plugin(training.name, "tracker"), "training_options", {})
    training = replace(training, options={**defaults, **training.options})
    tracker = create_tracker(
        training.name,
        weights=training.start or False,
        device=training.device,
        **training.options,
    )
    assert isinstance(tracker, TrainableTracker)
    loop = training.loop
    loss, source, validate = tracker.training_parts(
        photographs, clips, training.own, seed=loop.seed, batch_size=loop.batch_size
    )
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
        FrameUnreadable: one cannot be decoded.
    """
    import cv2
    import numpy as np

    folder = expand(folder)
    if not folder.is_dir():
        msg = f"{folder}: no such folder of photographs"
        raise DatasetNotFound(msg)
    paths = sorted(path for path in folder.rglob("*") if path.suffix.lower() in _PICTURES)
    if not paths:
        msg = f"{folder}: no image in it; photographs are {', '.join(sorted(_PICTURES))} files"
        raise DatasetIncomplete(msg)
    images = []
    for path in paths:
        data = np.fromfile(path, dtype=np.uint8)
        image = cv2.imdecode(data, cv2.IMREAD_COLOR) if len(data) else None
        if image is None:
            msg = f"{path}: not a readable image; remove it or mend it"
            raise FrameUnreadable(msg)
        images.append(np.asarray(image, dtype=np.uint8))
    return images


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
        "start": str(training.start or ""),
        "photographs": photographs,
        "clips": clips,
    }
