"""Train `siamrpnpp`, variant `compact`, on photographs and clips: on CUDA if any, else CPU.

    python scripts/render_tracker_clips.py CLIPS --photographs PHOTOGRAPHS --processes 8
    python scripts/train_compact.py OUT --photographs PHOTOGRAPHS --clips CLIPS

`make_compact.py` does both twice, as it was done for the shipped weights.

Processes make the pairs, each batch from its number alone; the network sees a batch, and some
steps later once more, mirrored and with other colours (`--repeats`). OUT gets `last_WIDTH.pt` every
`--kept-every` steps, and the same call goes on from there; `log.jsonl` has the losses and checks.
The averaged weights are in OUT/compact_WIDTH.safetensors in half precision, and OUT/compact.json
says which photographs and seeds they have seen.

`--widths 128 96` trains several networks on the same pairs. `--minutes` ends a run early: the rate
falls by whichever is farther, steps or minutes, so that what comes out is always annealed.
"""

import argparse
import hashlib
import json
import math
import mmap
import multiprocessing
import os
import sys
import time
from collections import deque
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import torch

from nat2024.boxes import read_boxes
from nat2024_trackers.siamrpnpp.compact import CompactSiamRPN
from nat2024_trackers.siamrpnpp.training.pairs import PairSource
from nat2024_trackers.siamrpnpp.training.recipe import PairLoss, PairValidation

SIDES = {"template": 127, "search": 191}
SLOTS = 96
AGAIN_AFTER = 24
WARM_UP = 0.03
LAST_RATE = 0.01
FIRST_SEED = 410_000
NOTE = {
    "title": "siamrpnpp, variant compact",
    "licence": "Apache-2.0",
    "attribution": "Images from BoofCV-Data by Peter Abeles, CC BY 4.0",
}


def read_clips(folder: Path) -> list[Any]:
    """Frames and boxes of all clips by their seed."""
    truths = sorted((folder / "anno").glob("*.txt"), key=lambda path: path.stem.split("_")[1])
    found = []
    for truth in truths:
        paths = sorted((folder / "data_seq" / truth.stem).glob("*.jpg"))
        found.append(([cv2.imread(str(path)) for path in paths], read_boxes(truth)))
    return found


class PairFactory:
    """Batches of pairs in the order of their numbers, made by processes into shared memory."""

    def __init__(self, source: PairSource, size: int, processes: int, first: int) -> None:
        """Start the processes; `first` is the number of the first batch that is wanted."""
        context = multiprocessing.get_context("fork")
        shapes = {name: (SLOTS, size, side, side, 3) for name, side in SIDES.items()}
        self.slots = {
            name: np.frombuffer(mmap.mmap(-1, math.prod(shape)), np.uint8).reshape(shape)
            for name, shape in shapes.items()
        }
        memory = mmap.mmap(-1, SLOTS * size * 16)
        self.slots["box"] = np.frombuffer(memory, np.float32).reshape(SLOTS, size, 4)
        self.size, self.source = size, source
        self.wanted, self.made = context.SimpleQueue(), context.SimpleQueue()
        self.ready: set[int] = set()
        self.number = first
        for number in range(first, first + SLOTS):
            self.wanted.put(number)
        for _ in range(processes):
            context.Process(target=self._work, daemon=True).start()

    def _work(self) -> None:
        cv2.setNumThreads(1)
        torch.set_num_threads(1)
        while True:
            number = self.wanted.get()
            for name, values in self.source.batch(number, self.size).items():
                self.slots[name][number % SLOTS] = values
            self.made.put(number)

    def draw(self, device: str) -> dict[str, torch.Tensor]:
        """The next batch, uint8 crops (n, side, side, 3), on a device."""
        while self.number not in self.ready:
            self.ready.add(self.made.get())
        self.ready.remove(self.number)
        slot = self.number % SLOTS
        batch = {name: torch.tensor(values[slot]) for name, values in self.slots.items()}
        self.wanted.put(self.number + SLOTS)
        self.number += 1
        return {name: tensor.to(device) for name, tensor in batch.items()}


def load_weights(network: torch.nn.Module, path: Path) -> None:
    """Weights that an earlier run has exported."""
    from safetensors.torch import load_file

    state = {key: value.float() for key, value in load_file(path).items()}
    network.load_state_dict({**network.state_dict(), **state})


def varied(batch: dict[str, torch.Tensor], chance: torch.Generator) -> dict[str, torch.Tensor]:
    """A batch as the loss takes it, half of it mirrored, some on its side or in other colours."""
    device, count = batch["box"].device, len(batch["box"])
    mirrored, turned, mixed = (
        (torch.rand(count, generator=chance) < share).to(device) for share in (0.5, 0.25, 0.4)
    )
    order = torch.randperm(3, generator=chance).to(device)
    result = {}
    for name in SIDES:
        crops = batch[name].permute(0, 3, 1, 2).float()
        crops = torch.where(mirrored[:, None, None, None], crops.flip(3), crops)
        crops = torch.where(turned[:, None, None, None], crops.transpose(2, 3), crops)
        crops = torch.where(mixed[:, None, None, None], crops[:, order], crops)
        result[name] = crops.contiguous(memory_format=torch.channels_last)
    x, y, width, height = batch["box"].unbind(1)
    box = torch.stack([torch.where(mirrored, -x, x), y, width, height], dim=1)
    result["box"] = torch.where(turned[:, None], box[:, [1, 0, 3, 2]], box)
    return result


class Run:
    """A training of one network with its average, as it is kept on disk."""

    def __init__(self, given: argparse.Namespace, width: int) -> None:
        """Begin, or go on from OUT/last_WIDTH.pt."""
        self.given, self.width = given, width
        self.last = given.out / f"last_{width}.pt"
        self.step, self.seconds = 0, 0.0
        torch.manual_seed(given.seed)
        self.model, self.ema = (self._network() for _ in range(2))
        if given.start:
            load_weights(self.model, given.start)
        self.ema.load_state_dict(self.model.state_dict())
        decayed = [p for p in self.model.parameters() if p.ndim > 1]
        others = [p for p in self.model.parameters() if p.ndim <= 1]
        groups = [
            {"params": decayed, "weight_decay": given.decay},
            {"params": others, "weight_decay": 0.0},
        ]
        self.optimizer = torch.optim.AdamW(groups, lr=given.rate, fused=True)
        self.loss = PairLoss(self.model)
        self.sums = torch.zeros(4, device=given.device)
        if self.last.exists():
            saved = torch.load(self.last, weights_only=True, map_location=given.device)
            self.model.load_state_dict(saved["model"])
            self.ema.load_state_dict(saved["ema"])
            self.optimizer.load_state_dict(saved["optimizer"])
            self.step, self.seconds = saved["step"], saved["seconds"]
        self.pairs = [
            (mean, current)
            for mean, current in zip(
                self.ema.state_dict().values(), self.model.state_dict().values(), strict=True
            )
            if mean.is_floating_point()
        ]

    def _network(self) -> CompactSiamRPN:
        network = CompactSiamRPN(self.width).to(self.given.device)
        return network.to(memory_format=torch.channels_last)

    def progress(self) -> float:
        """Share 0..1 of the schedule that is done."""
        minutes = self.given.minutes
        timed = self.seconds / (60 * minutes) if minutes else 0.0
        return min(1.0, max(self.step / self.given.steps, timed))

    def rate(self) -> float:
        """Learning rate of the next step: up, then down along a cosine."""
        done = self.progress()
        if done < WARM_UP and self.step < 1000:
            return float(self.given.rate) * (done / WARM_UP + 0.01)
        falling = 0.5 * (1 + math.cos(math.pi * done))
        return float(self.given.rate) * (LAST_RATE + (1 - LAST_RATE) * falling)

    def learn(self, batch: dict[str, torch.Tensor]) -> None:
        """One step."""
        self.model.train()
        for group in self.optimizer.param_groups:
            group["lr"] = self.rate()
        terms = self.loss(batch)
        self.optimizer.zero_grad()
        torch.stack(list(terms.values())).sum().backward()  # type: ignore[no-untyped-call]
        torch.nn.utils.clip_grad_norm_(self.model.parameters(), 5.0)
        self.optimizer.step()
        decay = min(0.999, (1 + self.step) / (10 + self.step))
        with torch.no_grad():
            means, current = (list(one) for one in zip(*self.pairs, strict=True))
            torch._foreach_lerp_(means, current, 1 - decay)
            self.sums += torch.stack([term.detach() for term in terms.values()])
        self.step += 1

    def average(self) -> CompactSiamRPN:
        """A copy of the averaged network in eval mode; what is derived from weights starts anew."""
        network = self._network()
        network.load_state_dict(self.ema.state_dict())
        return network.eval()

    def keep(self) -> None:
        """Write OUT/last_WIDTH.pt, whole or not at all."""
        content = {
            "model": self.model.state_dict(),
            "ema": self.ema.state_dict(),
            "step": self.step,
            "seconds": self.seconds,
            "optimizer": self.optimizer.state_dict(),
        }
        part = self.last.with_name("part.pt")
        torch.save(content, part)
        part.replace(self.last)

    def terms(self, steps: int) -> dict[str, float]:
        """Means of the weighted terms of the loss since the last call."""
        means = (self.sums / steps).tolist()
        self.sums.zero_()
        return dict(zip(("positive", "negative", "cross", "box"), means, strict=True))


def batches(given: argparse.Namespace, factory: PairFactory, step: int) -> Iterator[Any]:
    """New batches, each followed by one that was new a while ago, and so on."""
    kept: deque[dict[str, torch.Tensor]] = deque()
    while True:
        chance = torch.Generator().manual_seed(given.seed * 1_000_003 + step)
        if step % given.repeats == 0 or not kept:
            kept.append(factory.draw(given.device))
            chosen = kept[-1]
        else:
            chosen = kept[int(torch.randint(len(kept), (1,), generator=chance))]
        if len(kept) > AGAIN_AFTER:
            kept.popleft()
        yield varied(chosen, chance)
        step += 1


def train(runs: list[Run], factory: PairFactory, check: PairValidation) -> None:
    """Train to the end."""
    given, first = runs[0].given, runs[0]
    began = time.time()
    with (given.out / "log.jsonl").open("a") as log:
        for batch in batches(given, factory, first.step):
            for run in runs:
                run.learn(batch)
            at_end = first.progress() >= 1
            if first.step % 50 == 0 or at_end:
                elapsed = time.time() - began
                for run in runs:
                    run.seconds += elapsed
                began = time.time()
            if first.step % given.kept_every and not at_end:
                continue
            is_checked = first.step % given.checked_every == 0 or at_end
            for run in runs:
                record: dict[str, Any] = {"width": run.width, "step": run.step}
                record |= {"rate": run.rate(), "seconds": run.seconds, "batch": factory.number}
                record |= run.terms(first.step % given.kept_every or given.kept_every)
                if is_checked:
                    record |= check(run.average())
                run.keep()
                export(run)
                line = json.dumps({k: round(v, 5) for k, v in record.items()})
                log.write(line + "\n")
                log.flush()
                sys.stdout.write(line + "\n")
                sys.stdout.flush()
            if at_end:
                return


def export(run: Run) -> None:
    """Write the averaged weights in half precision, and what they have seen."""
    from safetensors.torch import save_file

    given = run.given
    state = {
        key: value.half().cpu().contiguous()
        for key, value in run.ema.state_dict().items()
        if value.is_floating_point()
    }
    note = {**NOTE, "steps": str(run.step), "seed": str(given.seed)}
    save_file(state, given.out / f"compact_{run.width}.safetensors", note)
    photographs = sorted(given.photographs.glob("*.jpg"))
    digests = sorted(hashlib.sha256(path.read_bytes()).hexdigest() for path in photographs)
    seeds = [int(path.stem.split("_")[1]) for path in (given.clips / "anno").glob("*.txt")]
    facts = {
        "photographs": len(digests),
        "training_seeds": [min(FIRST_SEED, *seeds) if given.start else min(seeds), max(seeds)],
        "choice_seeds": [420_000, 422_027],
        "photographs_sha256": digests,
    }
    (given.out / "compact.json").write_text(json.dumps(facts, indent=1) + "\n")


def main() -> None:
    """Train, then export."""
    given = _arguments()
    given.out.mkdir(parents=True, exist_ok=True)
    torch.set_num_threads(1)
    torch.backends.cudnn.benchmark = True
    photographs: list[Any] = [cv2.imread(str(p)) for p in sorted(given.photographs.glob("*.jpg"))]
    clips = read_clips(given.clips)
    # The processes are forked before anything is put on a GPU.
    saved = given.out / f"last_{given.widths[0]}.pt"
    step = torch.load(saved, weights_only=True, map_location="cpu")["step"] if saved.exists() else 0
    source = PairSource(photographs, clips, seed=given.seed)
    factory = PairFactory(source, given.batch, given.processes, -(-step // given.repeats))
    check = PairValidation(PairSource(photographs, clips, seed=given.seed + 1), count=96)
    runs = [Run(given, width) for width in given.widths]
    if runs[0].progress() < 1:
        train(runs, factory, check)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--photographs", type=Path, required=True)
    parser.add_argument("--clips", type=Path, required=True)
    parser.add_argument("--start", type=Path, help="exported weights to go on from")
    parser.add_argument("--widths", type=int, nargs="+", default=[128])
    parser.add_argument("--steps", type=int, default=20_000)
    parser.add_argument("--minutes", type=float)
    parser.add_argument("--batch", type=int, default=128)
    parser.add_argument("--repeats", type=int, default=2)
    parser.add_argument("--rate", type=float, default=3e-3)
    parser.add_argument("--decay", type=float, default=1e-2)
    parser.add_argument("--processes", type=int, default=max(1, (os.cpu_count() or 2) - 1))
    parser.add_argument("--kept-every", type=int, default=500)
    parser.add_argument("--checked-every", type=int, default=2500)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--device", default="cuda" if torch.cuda.is_available() else "cpu")
    return parser.parse_args()


if __name__ == "__main__":
    main()
