"""The trackers that a worker keeps: those of its last units, not all that ever passed through."""

import gc
from collections.abc import Sequence

from nat2024.engine.plan import Combination
from nat2024.engine.planning import TOGETHER
from nat2024.engine.units import Trackers
from nat2024.memory import return_freed_memory


class KeptTrackers(Trackers):
    """Trackers of which those used longest ago are given up, beyond so many.

    A worker sees units of all combinations of a study, and each holds a network, on a GPU too.
    """

    def __init__(self, most: int = TOGETHER) -> None:
        """Keep so many at most, or as many as one unit needs where that is more."""
        super().__init__()
        self._most = most
        self._used: dict[str, Combination] = {}

    def make_room(self, combinations: Sequence[Combination]) -> None:
        """Give up what is too much beside these combinations, which are needed next."""
        for one in combinations:
            self._used.pop(one.run, None)
            self._used[one.run] = one
        surplus = len(self._used) - max(self._most, len(combinations))
        old = list(self._used)[: max(0, surplus)]
        for run in old:
            del self._used[run]
            self._made.pop(run, None)
            self._asked.pop(run, None)
        titles = {one.enhancer.title for one in self._used.values() if one.enhancer}
        for title in self._enhancers.keys() - titles:
            del self._enhancers[title]
        if old:
            _return_memory()

    def clear(self) -> None:
        """Give up all."""
        plugins = [*self._made.values(), *(enhancer for enhancer, _ in self._enhancers.values())]
        had_networks = any(getattr(plugin, "model", None) is not None for plugin in plugins)
        del plugins
        for kept in (self._used, self._made, self._asked, self._enhancers):
            kept.clear()
        if had_networks:  # collecting takes half a second in which no thread does anything else
            _return_memory()


def _return_memory() -> None:
    """Networks refer to themselves in circles, and both torch and the C library keep what is free.

    Where nothing was returned, a worker that builds one network after another would grow and grow.
    """
    gc.collect()
    import torch

    torch.cuda.empty_cache()  # nothing where CUDA was never used
    return_freed_memory()
