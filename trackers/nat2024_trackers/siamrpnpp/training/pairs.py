"""A training pair, and the mix of generators that makes it.

A pair follows from the seed and its number alone, so a number is all the state that a
training run has to keep to go on where it stopped.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields

import numpy as np
import numpy.typing as npt

from nat2024.errors import UsageError
from nat2024.types import Box, Image
from nat2024_trackers.siamrpnpp.training.clips import BoxedClip, clip_pair
from nat2024_trackers.siamrpnpp.training.movement import Ranges
from nat2024_trackers.siamrpnpp.training.scenes import cut_pair, still_pair


@dataclass(frozen=True, slots=True)
class Pair:
    """One training example.

    Attributes:
        template: uint8 (127, 127, 3) BGR.
        search: uint8 (s, s, 3) BGR.
        box: float64 (4,): offset x, y of the target's centre from the crop's, width, height; NaN
            where the target is not in the search crop.
    """

    template: Image
    search: Image
    box: Box


@dataclass(frozen=True, slots=True)
class Mix:
    """Shares of the generators; those without material are left out, the rest counts as a whole.

    Attributes:
        procedural: drawn objects, mostly on plain grounds.
        composite: objects cut from photographs and laid on others.
        still: regions of photographs as they are.
        clips: two frames of a sequence with boxes.
    """

    procedural: float = 0.36
    composite: float = 0.24
    still: float = 0.04
    clips: float = 0.36


@dataclass(frozen=True, slots=True)
class PairSource:
    """An endless list of pairs: `source[n]` is the same for the same seed, whenever it is asked.

    Attributes:
        photographs: uint8 (H, W, 3) BGR each.
        clips: sequences with boxes.
        seed: what all chance follows from.
        mix: how often which generator is asked.
        ranges: how targets move.
    """

    photographs: Sequence[Image] = ()
    clips: Sequence[BoxedClip] = ()
    seed: int = 0
    mix: Mix = field(default_factory=Mix)
    ranges: Ranges = field(default_factory=Ranges)

    def __post_init__(self) -> None:
        """Refuse what could make no pair."""
        if sum(self.shares().values()) <= 0:
            msg = "nothing to make training pairs of: give photographs, or sequences with boxes"
            raise UsageError(msg)

    def shares(self) -> Mapping[str, float]:
        """The share of each generator that has its material; they need not sum to 1."""
        lacks = set()
        if not self.photographs:
            lacks |= {"procedural", "composite", "still"}  # all lie on photographs
        if not self.clips:
            lacks.add("clips")
        given = {one.name: float(getattr(self.mix, one.name)) for one in fields(self.mix)}
        return {name: 0.0 if name in lacks else share for name, share in given.items()}

    def __getitem__(self, number: int) -> Pair:
        """Pair `number`, any from 0 on."""
        rng = np.random.default_rng([self.seed, number])
        return self.make(self.draw_kind(rng), rng)

    def draw_kind(self, rng: np.random.Generator) -> str:
        """One generator by its share."""
        shares = self.shares()
        weights = np.array(list(shares.values()))
        return str(rng.choice(list(shares), p=weights / weights.sum()))

    def make(self, kind: str, rng: np.random.Generator) -> Pair:
        """A pair of one generator: procedural, composite, still or clips."""
        if kind == "clips":
            return Pair(*clip_pair(rng, self.clips, self.ranges, self.photographs))
        if kind == "still":
            return Pair(*still_pair(rng, self.photographs, self.ranges))
        is_procedural = kind == "procedural"
        return Pair(*cut_pair(rng, self.photographs, self.ranges, procedural=is_procedural))

    def batch(self, number: int, size: int) -> dict[str, npt.NDArray[np.generic]]:
        """Pairs `number * size` and the `size - 1` after it.

        Returns:
            template uint8 (n, 127, 127, 3), search uint8 (n, s, s, 3), box float32 (n, 4).
        """
        pairs = [self[number * size + place] for place in range(size)]
        return {
            "template": np.stack([pair.template for pair in pairs]),
            "search": np.stack([pair.search for pair in pairs]),
            "box": np.stack([pair.box for pair in pairs]).astype(np.float32),
        }
