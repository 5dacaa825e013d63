"""Measuring what enhancers do while they do it: rows of measures, and whether they adapt."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from nat2024.datasets.frames import IMAGE_EXTENSIONS
from nat2024.enhancing.pictures import read_picture
from nat2024.enhancing.reporting import Observation
from nat2024.errors import DatasetIncomplete, DatasetNotFound, UsageError
from nat2024.images import image_to_batch
from nat2024.measures.adaptivity import BORDER, Adaptivity, Pixels, measure_adaptivity
from nat2024.measures.enhancement import mean_measures, measure_enhancement
from nat2024.types import Image

Row: TypeAlias = dict[str, Any]

QualityMetric: TypeAlias = Callable[[Image, Image | None], float]
"""Gives one number for a BGR image and, where it needs one, a reference."""

Reference: TypeAlias = Callable[[str], Image]
"""Gives the reference, uint8 (H, W, 3) BGR, of the image of a name."""

ADAPTIVITY_IMAGES = 24
"""Adaptivity is measured on at most so many images, evenly spread over the input; they are held
in memory as float32, one enhancer after the other."""


@dataclass
class EnhancementMeasuring:
    """An observer of `enhance_images` that measures; ask `means` and `adaptivity` at the end.

    Attributes:
        images: how many images each enhancer will be given.
        reference: gives the reference of an image, None where there are none.
        metrics: further metrics by name, such as `load_quality_metrics` gives.
        limit: adaptivity is measured on at most so many images.
        rows: one for each image and enhancer: `enhancer`, `image`, the entries of
            `ENHANCEMENT_MEASURES` of the images as they are stored, and the further metrics.
    """

    images: int
    reference: Reference | None = None
    metrics: Mapping[str, QualityMetric] = field(default_factory=dict)
    limit: int = ADAPTIVITY_IMAGES
    rows: list[Row] = field(default_factory=list)
    _pairs: dict[str, list[tuple[Pixels, Pixels]]] = field(default_factory=dict)
    _seen: dict[str, int] = field(default_factory=dict)
    _found: dict[str, Adaptivity] = field(default_factory=dict)

    def __call__(self, observation: Observation) -> None:
        """Measure one image.

        Raises:
            DatasetIncomplete, ArrayContract: it has no reference, or one of another size.
        """
        name, after = observation.name, observation.after
        reference = self.reference(name) if self.reference else None
        measured = measure_enhancement(observation.before, after, reference).as_row()
        more = {key: metric(after, reference) for key, metric in self.metrics.items()}
        row = {"enhancer": observation.title, "image": name, **measured, **more}
        self._keep_pair(observation)
        self.rows.append(row)

    def _keep_pair(self, observation: Observation) -> None:
        title = observation.title
        for other in [known for known in self._pairs if known != title]:
            self._finish(other)  # enhancers come one after the other
        number = self._seen.get(title, 0)
        self._seen[title] = number + 1
        last = self.images - 1
        chosen = np.linspace(0, last, min(self.limit, self.images)).round().astype(int)
        if number in chosen and min(observation.before.shape[:2]) > 2 * BORDER:
            step = -1 if _sees_rgb(observation) else 1
            pair = observation.before[..., ::step], observation.unrounded()[..., ::step]
            self._pairs.setdefault(title, []).append(pair)

    def _finish(self, title: str) -> None:
        self._found[title] = measure_adaptivity(self._pairs.pop(title))

    @property
    def adaptivity(self) -> dict[str, Adaptivity]:
        """By enhancer; curves in the order in which its network was fed.

        An enhancer is absent that was given no image of 5x5 pixels or more.

        Raises:
            ArrayContract: it gave numbers that are not finite.
        """
        for title in list(self._pairs):
            self._finish(title)
        return self._found

    @property
    def means(self) -> list[Row]:
        """One row for each enhancer: `enhancer`, `images`, means over images that define each."""
        return mean_rows(self.rows)


def _sees_rgb(observation: Observation) -> bool:
    if observation.feed == "tracker":
        return getattr(observation.enhancer, "channel_order", "as_given") == "rgb"
    return getattr(observation.enhancer, "image_order", "rgb") == "rgb"


def mean_rows(rows: Iterable[Row]) -> list[Row]:
    """One row for each enhancer: `enhancer`, `images`, and means over images that define each."""
    groups: dict[str, list[Row]] = {}
    for row in rows:
        groups.setdefault(row["enhancer"], []).append(row)
    words = ("enhancer", "image")
    return [
        {
            "enhancer": title,
            "images": len(group),
            **mean_measures({k: v for k, v in row.items() if k not in words} for row in group),
        }
        for title, group in groups.items()
    ]


def references_in(folder: Path) -> Reference:
    """References in a folder: the same name from its top, perhaps with another image ending.

    Raises:
        DatasetNotFound: there is no such folder.
    """
    if not folder.is_dir():
        msg = f"{folder}: no such folder of references"
        raise DatasetNotFound(msg)

    def read(name: str) -> Image:
        path = folder / name
        for candidate in (path, *(path.with_suffix(end) for end in sorted(IMAGE_EXTENSIONS))):
            if candidate.is_file():
                return read_picture(candidate).image
        msg = f"{path}: no such reference; every image needs one of its name"
        raise DatasetIncomplete(msg)

    return read


def load_quality_metrics(names: Sequence[str], device: str = "cpu") -> dict[str, QualityMetric]:
    """Metrics of the library pyiqa by its own names, such as `niqe` or `musiq`.

    pyiqa comes with the extra `iqa`, under the PolyForm Noncommercial licence; many of its metrics
    download weights of their own.

    Raises:
        UsageError: pyiqa is not installed, or has no such metric.
    """
    if not names:
        return {}
    try:
        import pyiqa  # type: ignore[import-not-found, import-untyped, unused-ignore]
    except ImportError:
        msg = "quality metrics need pyiqa (noncommercial use only): pip install 'nat-bench[iqa]'"
        raise UsageError(msg) from None
    known = pyiqa.list_models()
    for name in names:
        if name not in known:
            msg = f"pyiqa has no metric {name!r}; pyiqa.list_models() names all"
            raise UsageError(msg)
    return {name: _metric(name, pyiqa.create_metric(name, device=device), device) for name in names}


def _metric(name: str, metric: Any, device: str) -> QualityMetric:
    import torch

    needs_reference = getattr(metric, "metric_mode", "NR") == "FR"

    def measure(image: Image, reference: Image | None) -> float:
        inputs = [image_to_batch(image, device, reverse=True)]
        if needs_reference:
            if reference is None:
                msg = f"the metric {name} compares with a reference, and there is none"
                raise UsageError(msg)
            inputs.append(image_to_batch(reference, device, reverse=True))
        with torch.no_grad():
            value = float(metric(*inputs))
        return value if math.isfinite(value) else float("nan")

    return measure
