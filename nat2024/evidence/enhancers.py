"""Making the enhancers of runs again, from what their manifests say."""

from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from nat2024.errors import NatBenchError, WeightsMissing
from nat2024.interfaces import enhance_frame
from nat2024.measures import MEASURE_SIZE, TARGET_CONTEXT, over_enhancement, resize_area
from nat2024.measures.light import crop_around
from nat2024.registry import create_enhancer
from nat2024.store import Manifest, PluginRecord
from nat2024.types import Box, Image

if TYPE_CHECKING:
    from nat2024.interfaces import Enhancer
    from nat2024.zoo.weights import WeightsSpec


def make_again(record: PluginRecord, device: str = "cpu") -> "Enhancer":
    """The enhancer of a run, with equal options and weights.

    Raises:
        WeightsMissing: the weights are no longer there, or are others.
        NatBenchError: it cannot be created, as `create_enhancer` says.
    """
    options = {key: value for key, value in record.options.items() if value is not None}
    if record.weights is None:
        return create_enhancer(record.name, device=device, **options)
    if record.weights.origin == "fresh":
        msg = f"{record.title} had fresh initial weights, which cannot be made again"
        raise WeightsMissing(msg)
    for spec in _places(record):
        try:
            made = create_enhancer(record.name, weights=spec, device=device, **options)
        except NatBenchError:
            continue
        if made.weights is not None and made.weights.sha256 == record.weights.sha256:
            return made
    # The name alone: pages that show this are passed on, and paths tell about one's machine.
    name = Path(record.weights.path).name
    msg = f"the weights that {record.title} had are no longer at hand ({name})"
    raise WeightsMissing(msg)


def _places(record: PluginRecord) -> "list[WeightsSpec]":
    path = record.weights.path if record.weights else ""
    at_hand: list[Any] = [None]
    return [*at_hand, path] if path else at_hand


class RunEnhancer:
    """The enhancer of one run, made when it is first needed."""

    def __init__(self, manifest: Manifest | None) -> None:
        """Keep what made the run; None where nothing tells."""
        self.record = manifest.enhancer if manifest else None
        self.scope: Literal["patch", "frame"] = (
            "frame" if manifest and manifest.scope == "frame" else "patch"
        )
        self.problem = ""
        self._made: Enhancer | None = None

    @property
    def identity(self) -> Any:
        """Plain values that tell it from others."""
        if self.record is None:
            return None
        weights = self.record.weights
        return [
            self.record.name,
            self.record.options,
            weights.sha256 if weights else "",
            self.scope,
        ]

    def over_enhancement(self, frame: Image, around: Box) -> float:
        """`over_enhancement` of the region in which a tracker searches around a box.

        The region has 4 times the side of the box, as Siamese trackers cut it, and is enhanced
        alone unless the run enhanced frames; wider ones are reduced to 256 pixels. NaN where it
        cannot be told; `problem` says then why.
        """
        side = TARGET_CONTEXT * float(np.sqrt(max(0.0, around[2] * around[3])))
        region = crop_around(frame, around, (side, side)) if side >= 1 else None
        if self.record is None or region is None:
            return float("nan")
        try:
            if self._made is None and not self.problem:
                self._made = make_again(self.record)
            if self._made is None:
                return float("nan")
            if self.scope == "frame":
                whole = enhance_frame(self._made, frame, "cpu")
                after = crop_around(whole, around, (side, side))
                return over_enhancement(region, after) if after is not None else float("nan")
            before = _bounded(region)
            return over_enhancement(before, enhance_frame(self._made, before, "cpu"))
        except NatBenchError as error:
            self.problem = str(error)
            return float("nan")


def _bounded(region: Image) -> Image:
    """The region as contiguous uint8, reduced where it is larger than 256 pixels."""
    largest = max(MEASURE_SIZE)
    scale = largest / max(region.shape[:2])
    if scale >= 1:
        return np.ascontiguousarray(region)
    height, width = (max(1, round(side * scale)) for side in region.shape[:2])
    return resize_area(region, (width, height))
