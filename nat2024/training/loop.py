"""The loop: steps, curves, checkpoints, validation; killed at any moment it goes on as it was."""

import json
import math
import time
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from nat2024.errors import InvalidOption, ResultConflict, TrainingFailed
from nat2024.files import remove_leftovers, write_atomic
from nat2024.training import checkpoints
from nat2024.training.choice import BestStep
from nat2024.training.curves import CurveFile, open_tensorboard
from nat2024.training.interfaces import Loss, Progress, Source, TrainingReport, Validation
from nat2024.training.optimising import Average, averaged, learning_rate, make_optimiser
from nat2024.training.randomness import (
    own_random_numbers,
    random_states,
    restore_random_states,
    seed_all,
)
from nat2024.training.settings import TrainingSettings, identity_of
from nat2024.training.terms import find_bad, numbers_of, sum_terms, to_device

if TYPE_CHECKING:
    import torch
    from torch import nn

_CHECKPOINTS, _BEST = "checkpoints", "best.pt"
_KEPT = (
    *("optimiser", "average", "scaler", "source", "random"),
    *("choice", "numbers", "terms", "sums", "sum"),
)
_LEAST_SCALE = 1.0  # gradients that overflow even below this are not finite in themselves


def train(
    network: "nn.Module",
    loss: Loss,
    source: Source,
    settings: TrainingSettings,
    folder: Path,
    *,
    identity: Mapping[str, Any] | None = None,
    validate: "Validation | None" = None,
    minutes: float | None = None,
    on_progress: "Progress | None" = None,
    device: str = "cpu",
) -> TrainingReport:
    """Train a network in a folder, or go on with a training that was begun there.

    On a CPU a training that was killed and resumed ends with the same bits as one that was not.
    Random numbers of torch, NumPy and Python are seeded, and given back as they were.

    Args:
        network: trained in place, ends with the chosen weights (the mean, the best) in it.
        loss: gives weighted terms by name for a batch on `device`.
        source: gives the batches.
        settings: how.
        folder: gets `checkpoints/`, `curve.csv`, `validation.csv` and `config.json`.
        identity: what else must be the same on resuming, plain values: data, options, losses.
        validate: numbers of the network in evaluation mode with the mean weights; called without
            gradients, its random numbers do not change the training.
        minutes: stop after so long, with a checkpoint to go on from.
        on_progress: called with (steps done since the last call, what to show).
        device: where the network is.

    Raises:
        InvalidOption: settings that do not fit together, or to the device or the validation.
        TrainingFailed: a loss term or the gradient is not finite, or the loss does not keep its
            contract; names it.
        ResultConflict: the folder holds a training of another configuration.
        WeightsMismatch: a checkpoint is damaged.
        Unwritable: the file system refuses; the checkpoints before stay.
    """
    import torch

    devices = list(range(torch.cuda.device_count())) if torch.cuda.is_available() else []
    with torch.random.fork_rng(devices=devices), own_random_numbers():
        run = _Run(network, loss, source, settings, folder, identity or {}, device, validate)
        run.on_progress = on_progress or run.on_progress
        try:
            return run.go(minutes)
        finally:
            run.close()


class _Run:
    def __init__(
        self,
        network: "nn.Module",
        loss: Loss,
        source: Source,
        settings: TrainingSettings,
        folder: Path,
        identity: Mapping[str, Any],
        device: str,
        validate: "Validation | None",
    ) -> None:
        self.network, self.loss, self.source = network, loss, source
        self.settings, self.folder, self.device = settings, folder, device
        self.validate = validate
        self.on_progress: Progress = lambda _done, _what: None
        self.places = folder / _CHECKPOINTS
        whole = {"settings": identity_of(settings), **identity}
        self.identity = json.dumps(whole, sort_keys=True, default=str)
        self.epoch = max(source.steps_per_epoch, 1)
        self.wanted = settings.epochs * self.epoch if settings.epochs else settings.steps
        self.step = self.resumed_from = 0
        self.best = BestStep(settings, validate)
        self.numbers: dict[str, float] = {}
        self.sums: dict[str, float] = {}
        self.summed, self.terms = 0, dict[str, float]()
        self.begun = time.monotonic()
        self._prepare()

    def _prepare(self) -> None:
        seed_all(self.settings.seed)
        self.network.train()
        self.optimiser = make_optimiser(self.network, self.settings)
        decay = self.settings.average
        self.average = Average(self.network, decay) if decay else None
        self.scaler = _scaler(self.settings, self.device)
        remove_leftovers(self.folder)
        remove_leftovers(self.places)
        found = checkpoints.list_checkpoints(self.places)
        self._write_config(resuming=bool(found))
        if found:
            self._resume(found[-1])
        self.curve = CurveFile(self.folder / "curve.csv", self.step)
        self.validations = CurveFile(self.folder / "validation.csv", self.step)
        self.board = open_tensorboard(self.folder / "tensorboard", self.step)

    def _write_config(self, *, resuming: bool) -> None:
        path = self.folder / "config.json"
        if not resuming:
            text = json.dumps(json.loads(self.identity), indent=2, sort_keys=True)
            write_atomic(path, text + "\n")

    def _resume(self, path: Path) -> None:
        content = checkpoints.read_checkpoint(path, _KEPT)
        checkpoints.check_identity(path, content["identity"], self.identity)
        if content["step"] > self.wanted:
            msg = f"{path}: {content['step']} steps are done already, above the {self.wanted} asked"
            raise ResultConflict(msg)
        checkpoints.load_into(self.network, content["network"], path)
        self.optimiser.load_state_dict(content["optimiser"])
        if self.average is not None:
            self.average.load_state_dict(content["average"])
        if self.scaler is not None and content["scaler"]:
            self.scaler.load_state_dict(content["scaler"])
        if hasattr(self.source, "load_state_dict"):
            self.source.load_state_dict(content["source"])
        self.step = self.resumed_from = content["step"]
        self.best.load_state_dict(content["choice"])
        self.numbers, self.sums, self.summed = content["numbers"], content["sums"], content["sum"]
        self.terms = content["terms"]
        restore_random_states(content["random"])

    def go(self, minutes: float | None) -> TrainingReport:
        """All steps that are left, or those that fit in `minutes`."""
        self.on_progress(self.step, "")
        stopped: Literal["done", "minutes", "patience"] = "done"
        while self.step < self.wanted:
            if self.best.has_lost_patience:
                stopped = "patience"
                break
            if minutes is not None and self._seconds() >= 60 * minutes:
                stopped = "minutes"
                if self.step > self.resumed_from:
                    self._keep()
                break
            self._do_step()
            self._after_step()
        self._choose_weights()
        return TrainingReport(
            self.folder,
            self.step,
            self.wanted,
            stopped,
            self.resumed_from,
            self.best.step,
            self.numbers,
            self.terms,
            self._seconds(),
        )

    def close(self) -> None:
        """Let go of what is open."""
        if self.board is not None:
            self.board.close()

    def _seconds(self) -> float:
        return time.monotonic() - self.begun

    def _do_step(self) -> None:
        import torch

        rate = learning_rate(self.settings, self.step, self.wanted)
        for group in self.optimiser.param_groups:
            group["lr"] = rate
        batch = to_device(self.source.draw(self.step), self.device)
        self.optimiser.zero_grad(set_to_none=True)
        kind = torch.device(self.device).type
        with torch.autocast(kind, torch.float16, enabled=self.scaler is not None):
            terms = self.loss(batch)
            total = sum_terms(terms)
        numbers = numbers_of(terms, total)
        if bad := find_bad(numbers):
            self._fail(bad)
        norm = self._update(total)
        if self.average is not None:
            self.average.update(self.network)
        self.step += 1
        self._sum({**numbers, "gradient": norm, "learning_rate": rate})

    def _update(self, total: "torch.Tensor") -> float:
        """Gradients and one step of the optimiser; gives the gradients' norm before the clip."""
        import torch

        scaler = self.scaler
        (total if scaler is None else scaler.scale(total)).backward()  # type: ignore[no-untyped-call]
        if scaler is not None:
            scaler.unscale_(self.optimiser)
        limit = self.settings.clip or math.inf
        norm = float(torch.nn.utils.clip_grad_norm_(self.network.parameters(), limit))
        if not math.isfinite(norm) and (scaler is None or scaler.get_scale() < _LEAST_SCALE):
            self._fail(f"the gradient's norm is {norm}")
        if scaler is None:
            self.optimiser.step()
            return norm
        scaler.step(self.optimiser)
        scaler.update()
        return norm if math.isfinite(norm) else 0.0  # it has left out a step that overflowed

    def _fail(self, what: str) -> None:
        kept = checkpoints.list_checkpoints(self.places)
        last = f"the last good checkpoint is {kept[-1]}" if kept else "there is no checkpoint yet"
        msg = (
            f"training stopped at step {self.step + 1}: {what}; {last}; a lower learning_rate or "
            "clip may help"
        )
        raise TrainingFailed(msg)

    def _sum(self, numbers: Mapping[str, float]) -> None:
        for name, value in numbers.items():
            self.sums[name] = self.sums.get(name, 0.0) + value
        self.summed += 1

    def _after_step(self) -> None:
        settings, last = self.settings, self.step == self.wanted
        if last or self.step % settings.log_every == 0:
            self._log()
        every = settings.checkpoint_every or self.epoch
        at_checkpoint = last or self.step % every == 0
        valid = settings.validate_every
        if self.validate and (last or (self.step % valid == 0 if valid else at_checkpoint)):
            self._validate(self.validate)
        if at_checkpoint:
            self._keep()
        loss = self.terms.get("loss")
        self.on_progress(1, "" if loss is None else f"loss {loss:.4g}")

    def _log(self) -> None:
        self.terms = {name: value / self.summed for name, value in self.sums.items()}
        self.sums, self.summed = {}, 0
        self.curve.add(self.step, self.terms)
        self._show("train", self.terms)

    def _show(self, group: str, numbers: Mapping[str, float]) -> None:
        if self.board is not None:
            self.board.add(group, self.step, numbers)

    def _validate(self, validate: Validation) -> None:
        import torch

        with own_random_numbers(), averaged(self.network, self.average), torch.no_grad():
            numbers = {name: float(value) for name, value in validate(self.network).items()}
        self.validations.add(self.step, numbers)
        self._show("validation", numbers)
        if not self.settings.best:
            self.numbers = numbers
        elif self.best.take(self.step, numbers):
            self.numbers = numbers
            with averaged(self.network, self.average):
                weights = {key: value.clone() for key, value in self.network.state_dict().items()}
            content = {"step": self.step, "network": weights, "identity": self.identity}
            checkpoints.write_checkpoint(self.places / _BEST, content)

    def _keep(self) -> None:
        average, scaler = self.average, self.scaler
        content = {
            "step": self.step,
            "identity": self.identity,
            "network": self.network.state_dict(),
            "optimiser": self.optimiser.state_dict(),
            "average": None if average is None else average.state_dict(),
            "scaler": None if scaler is None else scaler.state_dict(),
            "source": self.source.state_dict() if hasattr(self.source, "state_dict") else None,
            "random": random_states(),
            "choice": self.best.state_dict(),
            "numbers": self.numbers,
            "terms": self.terms,
            "sums": self.sums,
            "sum": self.summed,
        }
        path = checkpoints.checkpoint_path(self.places, self.step)
        checkpoints.write_checkpoint(path, content)
        checkpoints.forget_old(self.places, self.settings.keep)

    def _choose_weights(self) -> None:
        path = self.places / _BEST
        if self.best.step is not None and path.exists():
            state = checkpoints.read_checkpoint(path)["network"]
        else:
            state = self.average.mean if self.average is not None else {}
        self.network.load_state_dict(state or self.network.state_dict())
        self.network.eval()


def _scaler(settings: TrainingSettings, device: str) -> "torch.amp.GradScaler | None":
    if not settings.mixed_precision:
        return None
    import torch

    if torch.device(device).type != "cuda":
        msg = f"training setting mixed_precision=true is for CUDA, not {device}"
        raise InvalidOption(msg)
    return torch.amp.GradScaler("cuda")
