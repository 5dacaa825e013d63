"""The workers of a Dask cluster: how many can take work now, and why where none can."""

import logging
import time
from collections.abc import Callable, Iterable, Mapping
from typing import Any, TypeAlias

Client: TypeAlias = Any
"""A `distributed.Client`; most of that package is untyped."""

log = logging.getLogger("nat2024")

GPU = "GPU"  # the name of the resource that Dask's own pages use

_LOOK_SECONDS = 1.0  # between two questions to the scheduler, which has better things to do
_PATIENCE_SECONDS = 3.0  # a worker that restarts, or frees its memory at once, is no news


class Workforce:
    """The workers of a cluster as its scheduler last told of them; they may join and leave.

    Attributes:
        needs_gpu: whether the work is for GPUs; where no worker ever told of one, all may have one.
    """

    def __init__(
        self, client: Client, *, needs_gpu: bool, restore: Callable[[], object] | None = None
    ) -> None:
        """Nobody is asked yet; `restore` is called where workers are missing that were there."""
        self.needs_gpu = needs_gpu
        self._client, self._restore = client, restore
        self._most = 0
        self._workers: Mapping[str, Mapping[str, Any]] = {}
        self._has_gpus = False
        self._looked = self._fit_since = float("-inf")
        self._told = ""

    def look(self) -> None:
        """Ask the scheduler, unless it was asked just now, and tell what keeps work from going on.

        Others may come and memory may be freed, but nobody should wait unknowingly.
        """
        now = time.monotonic()
        if now - self._looked < _LOOK_SECONDS:
            return
        self._workers = self._client.scheduler_info(n_workers=-1)["workers"]
        self._looked = time.monotonic()
        self._has_gpus |= any(_gpus(worker) for worker in self._workers.values())
        self._most = max(self._most, len(self._workers))
        if self._restore and len(self._workers) < self._most:
            self._restore()
        trouble, line = self.trouble()
        if not trouble:
            self._told, self._fit_since = "", self._looked
        elif trouble != self._told and self._looked - self._fit_since >= _PATIENCE_SECONDS:
            self._told = trouble
            log.warning("%s; Ctrl-C keeps what is finished", line)

    def room(self, busy: Iterable[str] = ()) -> int:
        """How many more units can be worked on now.

        Args:
            busy: for each unit that is on its way, the address of its worker as far as is known.
        """
        running = {a: w for a, w in self._workers.items() if w["status"] == "running"}
        threads: int = sum(
            min(worker["nthreads"], _gpus(worker)) if self.asks_for_gpus else worker["nthreads"]
            for worker in running.values()
        )
        elsewhere = self._workers.keys() - running.keys()  # a paused one ends what it is on
        return threads - sum(address not in elsewhere for address in busy)

    @property
    def asks_for_gpus(self) -> bool:
        """Whether units must wait for workers that told of a GPU."""
        return self.needs_gpu and self._has_gpus

    def trouble(self) -> tuple[str, str]:
        """What keeps workers from working, in a word and in a line; empty where nothing does."""
        count = len(self._workers)
        if not count:
            return "deserted", "no worker is there; waiting for one"
        paused = [worker for worker in self._workers.values() if worker["status"] == "paused"]
        if paused:
            memory = max(worker["metrics"].get("memory", 0) for worker in paused) / 1e6
            limit = min(worker["memory_limit"] or 0 for worker in paused) / 1e6
            line = (
                f"{len(paused)} of {count} workers are paused by Dask, which gives them nothing "
                f"new: they hold {memory:,.0f} MB of {limit:,.0f} MB each; start fewer workers on "
                "a machine, or with a higher --memory-limit"
            )
            return f"paused {'all' if len(paused) == count else 'some'}", line
        if self.asks_for_gpus and not any(map(_gpus, self._workers.values())):
            return "no GPU", f"none of {count} workers tells of a GPU any more; waiting for one"
        return "", ""


def _gpus(worker: Mapping[str, Any]) -> int:
    return int(worker["resources"].get(GPU, 0))
