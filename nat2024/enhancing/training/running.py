"""Training an enhancer on pictures, from its name to a weights file."""

import hashlib
import inspect
import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import msgspec

from nat2024.enhancing.training.batches import PictureBatches
from nat2024.enhancing.training.pictures import CACHE, PictureStore, Progress, find_shots
from nat2024.enhancing.training.settings import PictureSettings
from nat2024.enhancing.training.validation import EnhancerValidation, Tracking
from nat2024.errors import TrainingFailed, UsageError
from nat2024.interfaces import NeuralEnhancer
from nat2024.registry import create_enhancer, load_plugin, resolve_options
from nat2024.training import (
    TrainingReport,
    TrainingSettings,
    choose_preset,
    digest_of,
    set_values,
    train,
    write_weights,
)

if TYPE_CHECKING:
    from torch import nn

_log = logging.getLogger("nat2024")


class Nothing(msgspec.Struct, frozen=True):
    """The settings of an enhancer that has none of its own."""


@dataclass(frozen=True, slots=True)
class EnhancerTraining:
    """What is trained, on what and how.

    Attributes:
        name: registered name of an enhancer with a network and `loss(batch) -> terms`.
        data: folder of images, video, or dataset (its folder or registered name).
        out: folder of the training.
        options: options of the enhancer.
        loop: settings of the loop.
        pictures: settings of the pictures.
        own: the enhancer's own settings.
        root: folder of a registered dataset.
        cache: folder of pictures with their targets; None keeps them beside the data.
        start: a checkpoint to start from; None starts with fresh weights.
        device: where to train.
        tracking: trackers and sequences to validate with.
    """

    name: str
    data: str
    out: Path
    options: Mapping[str, Any]
    loop: TrainingSettings
    pictures: PictureSettings
    own: msgspec.Struct
    root: Path | None = None
    cache: Path | None = None
    start: Path | None = None
    device: str = "cpu"
    tracking: Tracking | None = None

    @property
    def weights(self) -> Path:
        """The weights file that comes out."""
        return self.out / f"{self.name}.safetensors"


@dataclass(frozen=True, slots=True)
class EnhancerTrainingReport:
    """What came out.

    Attributes:
        weights: the weights file.
        training: how the loop ended.
        pictures: pictures trained on.
        held_out: pictures validated with.
    """

    weights: Path
    training: TrainingReport
    pictures: int
    held_out: int


def list_presets(name: str) -> dict[str, Mapping[str, Any]]:
    """Presets of an enhancer by name, "default" always among them.

    Raises:
        UsageError: it cannot be trained.
    """
    cls = _trainable(name)
    return {"default": {}, **getattr(cls, "training_presets", {})}


def choose_settings(
    name: str, preset: str = "default", values: Mapping[str, Any] | None = None
) -> tuple[TrainingSettings, PictureSettings, msgspec.Struct]:
    """Settings of the loop, the pictures and the enhancer's loss.

    Args:
        name: of the enhancer.
        preset: one of `list_presets`.
        values: by the name of the setting, over the preset; texts are read.

    Raises:
        UsageError: the enhancer cannot be trained.
        InvalidOption: no such preset or setting, or a value that does not fit.
    """
    cls, presets = _trainable(name), list_presets(name)
    chosen = choose_preset(name, preset, presets)
    own: msgspec.Struct = getattr(cls, "training_settings", Nothing())
    records: tuple[msgspec.Struct, ...] = (TrainingSettings(), PictureSettings(), own)
    loop, pictures, own = set_values(records, {**chosen, **(values or {})})
    return cast("TrainingSettings", loop), cast("PictureSettings", pictures), own


def _trainable(name: str) -> type[Any]:
    cls = load_plugin(name, "enhancer")
    if not (issubclass(cls, NeuralEnhancer) and callable(getattr(cls, "loss", None))):
        why = cls.card.training or "it has no network with loss(batch) that gives terms"
        msg = f"{name} cannot be trained: {why.removeprefix('not here: ')}"
        raise UsageError(msg)
    return cls


def train_enhancer(
    training: EnhancerTraining,
    *,
    minutes: float | None = None,
    on_progress: Progress = lambda _done, _what: None,
    on_total: Callable[[int], object] = lambda _total: None,
) -> EnhancerTrainingReport:
    """Train an enhancer, or go on with a training that was begun in the same folder.

    Args:
        training: what, on what and how.
        minutes: stop after so long; called again it goes on.
        on_progress: called with (pictures or steps done since the last call, what to show).
        on_total: called with the number of pictures to read, then with the number of steps.

    Raises:
        NatBenchError: as `nat2024.training.train`; also where data is missing or unreadable, or
            the enhancer cannot be trained.
    """
    import torch

    devices = list(range(torch.cuda.device_count())) if torch.cuda.is_available() else []
    with torch.random.fork_rng(devices=devices):
        torch.manual_seed(training.loop.seed)
        enhancer = _create(training)
    note = getattr(enhancer, "training_note", "")
    if note:
        _log.info("%s: %s", training.name, note)
    store = _store(training, enhancer)
    on_total(len(store.shots))
    store.prepare(training.pictures.workers, on_progress)
    batches, held_out = _split(training, store)
    on_total(batches.steps)
    validation = EnhancerValidation(enhancer, _held_out(store, held_out), training.tracking)
    try:
        report = train(
            enhancer.model,
            enhancer.loss,
            batches,
            training.loop,
            training.out,
            identity=_identity(training, store),
            validate=validation if held_out or training.tracking else None,
            minutes=minutes,
            on_progress=on_progress,
            device=training.device,
        )
        recalibrate(enhancer.model, batches, training.pictures.recalibrate, training.device)
    finally:
        batches.close()
    header = {"enhancer": training.name, "steps": str(report.best_step or report.steps)}
    write_weights(training.weights, enhancer.model, header)
    return EnhancerTrainingReport(training.weights, report, len(batches.numbers), len(held_out))


def _create(training: EnhancerTraining) -> Any:
    """The enhancer with its own settings and the weights that it starts with."""
    enhancer: Any = create_enhancer(
        training.name, weights=training.start or False, device=training.device, **training.options
    )
    if not isinstance(training.own, Nothing):
        enhancer.training_settings = training.own
    if training.start is None and hasattr(enhancer, "begin_training"):
        enhancer.begin_training()
    return enhancer


def _store(training: EnhancerTraining, enhancer: Any) -> PictureStore:
    source, shots = find_shots(training.data, training.root, training.pictures.every)
    title = getattr(enhancer, "targets_title", "")
    wanted = bool(title) or not hasattr(type(enhancer), "targets_title")
    targets = getattr(enhancer, "targets", None) if wanted else None
    folder = None
    if targets is not None and title:
        beside = source.path if source.path.is_dir() else source.path.parent
        above = training.cache or beside / CACHE
        folder = above / f"{training.pictures.size}-{training.pictures.fit}-{title}"
    return PictureStore(shots, training.pictures, targets, folder)


def _split(training: EnhancerTraining, store: PictureStore) -> tuple[PictureBatches, range]:
    count = len(store.shots)
    kept = count - min(training.pictures.held_out, count // 4)
    loop = training.loop
    batches = PictureBatches(
        store, range(kept), training.pictures, loop.batch_size, loop.seed, loop.steps
    )
    if loop.epochs:
        batches.steps = loop.epochs * batches.steps_per_epoch
    return batches, range(kept, count)


def _held_out(store: PictureStore, numbers: range) -> list[Any]:
    return [store.load(number)[0] for number in numbers]


def _identity(training: EnhancerTraining, store: PictureStore) -> dict[str, Any]:
    """What a training cannot be resumed with another of."""
    pictures = msgspec.to_builtins(training.pictures)
    del pictures["workers"]
    titles = "\n".join(shot.title for shot in store.shots)
    options = resolve_options(load_plugin(training.name, "enhancer"), training.options)
    ways_to_run = inspect.signature(NeuralEnhancer.__init__).parameters  # no part of the training
    return {
        "enhancer": training.name,
        "options": {key: options[key] for key in sorted(options) if key not in ways_to_run},
        "pictures": pictures,
        "loss": msgspec.to_builtins(training.own),
        "data": {
            "pictures": len(store.shots),
            "titles": hashlib.sha256(titles.encode()).hexdigest()[:16],
        },
        "start": digest_of(training.start),
    }


def recalibrate(network: "nn.Module", batches: PictureBatches, count: int, device: str) -> None:
    """Give BatchNorm layers the mean statistics of whole pictures, with dropout off.

    Raises:
        TrainingFailed: statistics are not finite.
    """
    import torch
    from torch import nn

    norms = [
        part for part in network.modules() if isinstance(part, nn.modules.batchnorm._BatchNorm)
    ]
    if not (count and norms):
        return
    momenta = [norm.momentum for norm in norms]
    for norm in norms:
        norm.reset_running_stats()
        norm.momentum = None  # a cumulative mean
    network.eval()
    for norm in norms:
        norm.train()
    # Without gradients a network in evaluation may fold its BatchNorms, and they would see nothing.
    with torch.enable_grad():
        for number in range(count):
            network(batches.whole(number).to(device))
    for norm, momentum in zip(norms, momenta, strict=True):
        norm.momentum = momentum
        statistics: torch.Tensor | None = norm.running_var
        if statistics is not None and not bool(statistics.isfinite().all()):
            msg = "the statistics of BatchNorm are not finite after training"
            raise TrainingFailed(msg)
    network.eval()
