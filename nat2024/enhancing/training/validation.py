"""Numbers that tell how good an enhancer is: measures of held-out pictures, and tracking itself."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, fields

import numpy as np

from nat2024.engine.one_pass import track_sequence
from nat2024.interfaces import Enhancer
from nat2024.measures.enhancement import (
    EnhancementMeasures,
    mean_measures,
    measure_enhancement,
)
from nat2024.measures.pixels import grey
from nat2024.metrics import evaluate_boxes
from nat2024.registry import create_tracker
from nat2024.types import Image, Sequence

_DARK = 0.15
_LIKENESS = ("psnr", "ssim")  # of before and after, which says nothing of quality
_MEASURES = tuple(one.name for one in fields(EnhancementMeasures) if one.name not in _LIKENESS)
_SCORES = ("success", "precision", "success_gain")


@dataclass(frozen=True, slots=True)
class Tracking:
    """Trackers and sequences to validate with; no sequence of the training data.

    Attributes:
        trackers: names; their own best weights are taken.
        sequences: with annotation.
        device: where the trackers run.
    """

    trackers: tuple[str, ...]
    sequences: tuple[Sequence, ...]
    device: str = "cpu"


@dataclass(slots=True)
class EnhancerValidation:
    """Measures an enhancer as it is now."""

    enhancer: Enhancer
    pictures: Collection[Image] = ()
    tracking: Tracking | None = None
    _plain: dict[str, float] = field(default_factory=dict)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the numbers that a call gives."""
        measures = ("dark_lift", *_MEASURES) if self.pictures else ()
        return (*measures, *(() if self.tracking is None else _SCORES))

    def __call__(self, _network: object) -> dict[str, float]:
        """The means over pictures by the names of the measures, and scores of tracking.

        `dark_lift` is the mean factor by which pixels below 0.15 get brighter; `success`,
        `precision` and `success_gain` (over the tracker alone) are there with tracking.
        """
        return {**self._measure(), **self._track()}

    def _measure(self) -> dict[str, float]:
        rows, lifts = [], []
        for picture in self.pictures:
            after = self.enhancer.enhance(picture)
            row = measure_enhancement(picture, after).as_row()
            rows.append({name: row[name] for name in _MEASURES})
            levels, new = grey(picture), grey(after)
            dark = (levels < _DARK) & (levels > 0)
            if dark.any():
                lifts.append(float(new[dark].mean() / levels[dark].mean()))
        if not rows:
            return {}
        lift = float(np.mean(lifts)) if lifts else np.nan
        return {"dark_lift": lift, **mean_measures(rows)}

    def _track(self) -> dict[str, float]:
        if self.tracking is None:
            return {}
        scores = self._score(self.enhancer)
        if not self._plain:  # the tracker alone is always the same
            self._plain = dict(self._score(None))
        return {**scores, "success_gain": scores["success"] - self._plain["success"]}

    def _score(self, enhancer: Enhancer | None) -> Mapping[str, float]:
        assert self.tracking is not None
        success, precision = [], []
        for name in self.tracking.trackers:
            for sequence in self.tracking.sequences:
                tracker = create_tracker(name, enhancer=enhancer, device=self.tracking.device)
                track = track_sequence(tracker, sequence)
                scores = evaluate_boxes(track.boxes, sequence.boxes, visible=sequence.visible)
                success.append(scores.success_auc)
                precision.append(scores.precision_20)
        return {"success": float(np.mean(success)), "precision": float(np.mean(precision))}
