"""Train the bundled weights of `siamrpnpp`, variant `compact`, again.

    python scripts/render_tracker_clips.py CLIPS --photographs PHOTOGRAPHS
    python scripts/train_compact.py OUT --photographs PHOTOGRAPHS --clips CLIPS

One process trains with one thread, another makes the pairs. OUT gets `last.pt` every 250 steps, and
the same call goes on from there; `log.jsonl` has the losses and the checks. At the end the averaged
weights are written as OUT/compact.safetensors in half precision, and OUT/compact.json says which
photographs and seeds they have seen.

This is the run that made the shipped file: its rate stays, then falls in a straight line, so that
its end could be moved while it ran. `nat-bench train siamrpnpp` does the same with a cosine.
"""

import argparse
import hashlib
import json
import multiprocessing
import sys
import time
from pathlib import Path
from typing import Any

import cv2
import torch

from nat2024.boxes import read_boxes
from nat2024_trackers.siamrpnpp.compact import CompactSiamRPN
from nat2024_trackers.siamrpnpp.training.pairs import PairSource
from nat2024_trackers.siamrpnpp.training.recipe import PairLoss, PairValidation, as_tensors

BATCH = 8
WARM_UP = 300
LAST_RATE = 0.02
KEPT_EVERY = 250
CHECKED_EVERY = 1000
FIRST_SEED = 410_000
NOTE = {
    "title": "siamrpnpp, variant compact",
    "licence": "Apache-2.0",
    "attribution": "Images from BoofCV-Data by Peter Abeles, CC BY 4.0",
}


def read_clips(folder: Path, count: int) -> list[Any]:
    """Frames and boxes of the first clips by their seed."""
    truths = sorted((folder / "anno").glob("*.txt"), key=lambda path: path.stem.split("_")[1])
    found = []
    for truth in truths[:count]:
        paths = sorted((folder / "data_seq" / truth.stem).glob("*.jpg"))
        found.append(([cv2.imread(str(path)) for path in paths], read_boxes(truth)))
    return found


def make_source(given: argparse.Namespace, seed: int) -> PairSource:
    """All pairs of a seed."""
    photographs: list[Any] = [cv2.imread(str(p)) for p in sorted(given.photographs.glob("*.jpg"))]
    return PairSource(photographs, read_clips(given.clips, given.clip_count), seed=seed)


def generate(given: argparse.Namespace, first: int, queue: Any) -> None:
    """Put batches into a queue for ever; runs in a process of its own."""
    cv2.setNumThreads(1)
    source = make_source(given, given.seed)
    number = first
    while True:
        queue.put((number, source.batch(number, BATCH)))
        number += 1


def rate_of(step: int, given: argparse.Namespace) -> float:
    """Learning rate of a step: up, level, down."""
    if step < WARM_UP:
        return float(given.rate) * (step + 1) / WARM_UP
    if step < given.decay_from:
        return float(given.rate)
    progress = min(1.0, (step - given.decay_from) / max(1, given.steps - given.decay_from))
    return float(given.rate) * (1 + (LAST_RATE - 1) * progress)


class Run:
    """A training with its averaged network, as it is kept on disk."""

    def __init__(self, given: argparse.Namespace) -> None:
        """Begin, or go on from OUT/last.pt."""
        self.given, self.last, self.step = given, given.out / "last.pt", 0
        torch.manual_seed(given.seed)
        self.model = CompactSiamRPN().to(memory_format=torch.channels_last)
        self.ema = CompactSiamRPN().to(memory_format=torch.channels_last)
        self.ema.load_state_dict(self.model.state_dict())
        decayed = [p for p in self.model.parameters() if p.ndim > 1]
        others = [p for p in self.model.parameters() if p.ndim <= 1]
        groups = [
            {"params": decayed, "weight_decay": 1e-4},
            {"params": others, "weight_decay": 0.0},
        ]
        self.optimizer = torch.optim.AdamW(groups, lr=given.rate)
        self.loss = PairLoss(self.model)
        if self.last.exists():
            saved = torch.load(self.last, weights_only=True)
            self.model.load_state_dict(saved["model"])
            self.ema.load_state_dict(saved["ema"])
            self.optimizer.load_state_dict(saved["optimizer"])
            self.step = saved["step"]

    def learn(self, batch: dict[str, torch.Tensor]) -> dict[str, float]:
        """One step; gives the weighted terms of the loss."""
        self.model.train()
        for group in self.optimizer.param_groups:
            group["lr"] = rate_of(self.step, self.given)
        terms = self.loss(batch)
        self.optimizer.zero_grad()
        torch.stack(list(terms.values())).sum().backward()  # type: ignore[no-untyped-call]
        torch.nn.utils.clip_grad_norm_(self.model.parameters(), 5.0)
        self.optimizer.step()
        decay = min(0.999, (1 + self.step) / (10 + self.step))
        current = self.model.state_dict()
        with torch.no_grad():
            for key, value in self.ema.state_dict().items():
                if value.is_floating_point():
                    value.lerp_(current[key], 1 - decay)
        self.step += 1
        return {name: term.item() for name, term in terms.items()}

    def keep(self) -> None:
        """Write OUT/last.pt, whole or not at all."""
        content = {
            "model": self.model.state_dict(),
            "ema": self.ema.state_dict(),
            "step": self.step,
            "optimizer": self.optimizer.state_dict(),
        }
        part = self.last.with_name("part.pt")
        torch.save(content, part)
        part.replace(self.last)


def train(run: Run) -> None:
    """Train to the end."""
    given = run.given
    context = multiprocessing.get_context("spawn")
    queue: Any = context.Queue(24)
    context.Process(target=generate, args=(given, run.step, queue), daemon=True).start()
    check = PairValidation(make_source(given, given.seed + 1))
    sums: dict[str, float] = {}
    began = time.time()
    with (given.out / "log.jsonl").open("a") as log:
        while run.step < given.steps:
            _, arrays = queue.get()
            for name, term in run.learn(as_tensors(arrays)).items():
                sums[name] = sums.get(name, 0.0) + term / KEPT_EVERY
            at_end = run.step == given.steps
            if run.step % KEPT_EVERY and not at_end:
                continue
            run.keep()
            record: dict[str, Any] = {"step": run.step, "rate": rate_of(run.step, given), **sums}
            record["pairs_s"] = KEPT_EVERY * BATCH / (time.time() - began)
            if run.step % CHECKED_EVERY == 0 or at_end:
                record |= check(run.ema.eval())
            sums, began = {}, time.time()
            line = json.dumps({k: round(v, 4) for k, v in record.items()})
            log.write(line + "\n")
            log.flush()
            sys.stdout.write(line + "\n")


def export(run: Run) -> None:
    """Write the averaged weights in half precision, and what they have seen."""
    from safetensors.torch import save_file

    state = {
        key: value.half().contiguous()
        for key, value in run.ema.state_dict().items()
        if value.is_floating_point()
    }
    note = {**NOTE, "steps": str(run.step), "seed": str(run.given.seed)}
    save_file(state, run.given.out / "compact.safetensors", note)
    photographs = sorted(run.given.photographs.glob("*.jpg"))
    digests = sorted(hashlib.sha256(path.read_bytes()).hexdigest() for path in photographs)
    facts = {
        "photographs": len(digests),
        "training_seeds": [FIRST_SEED, FIRST_SEED + run.given.clip_count - 1],
        "choice_seeds": [420_000, 421_006],
        "photographs_sha256": digests,
    }
    (run.given.out / "compact.json").write_text(json.dumps(facts, indent=1) + "\n")


def main() -> None:
    """Train, then export."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--photographs", type=Path, required=True)
    parser.add_argument("--clips", type=Path, required=True)
    parser.add_argument("--clip-count", type=int, default=140)
    parser.add_argument("--steps", type=int, default=8000)
    parser.add_argument("--decay-from", type=int, default=6200)
    parser.add_argument("--rate", type=float, default=2e-3)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    torch.set_num_threads(1)
    run = Run(given)
    train(run)
    export(run)


if __name__ == "__main__":
    main()
