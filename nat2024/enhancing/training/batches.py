"""Batches of pictures: each a pure function of the seed and the step, so that resuming is exact."""

from collections.abc import Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from nat2024.enhancing.training.pictures import PictureStore
from nat2024.enhancing.training.settings import PictureSettings
from nat2024.errors import InvalidOption

if TYPE_CHECKING:
    import torch

_ORDER, _RECALIBRATION = 1, 2


@dataclass(slots=True)
class PictureBatches:
    """Draws batches `image` and targets (N, 3, H, W) in 0..1, RGB, with `place` where cropped.

    Attributes:
        store: the pictures.
        numbers: which of them.
        settings: order and augmentation.
        batch_size: pictures a batch.
        seed: of order and augmentation.
        steps: of the whole training, which tells where its last steps begin.
    """

    store: PictureStore
    numbers: range
    settings: PictureSettings
    batch_size: int
    seed: int
    steps: int
    _ahead: dict[int, "Future[Mapping[str, Any]]"] = field(default_factory=dict)
    _pool: ThreadPoolExecutor | None = None

    def __post_init__(self) -> None:
        settings = self.settings
        if settings.crop > settings.size:
            msg = f"training setting crop={settings.crop} is larger than size={settings.size}"
            raise InvalidOption(msg)
        if settings.workers:
            self._pool = ThreadPoolExecutor(settings.workers)

    @property
    def steps_per_epoch(self) -> int:
        """Steps of one round through the pictures."""
        return max(len(self.numbers) // self.batch_size, 1)

    def draw(self, step: int, /) -> Mapping[str, Any]:
        """The batch of a step."""
        if self._pool is None:
            return self._draw(step)
        last = min(step + 2 * self.settings.workers, self.steps)
        for number in range(step, max(last, step + 1)):
            if number not in self._ahead:
                self._ahead[number] = self._pool.submit(self._draw, number)
        return self._ahead.pop(step).result()

    def whole(self, number: int) -> "torch.Tensor":
        """Images of a batch that is neither cropped nor changed, for statistics."""
        random = np.random.default_rng([self.seed, _RECALIBRATION, number])
        chosen = random.integers(len(self.numbers), size=self.batch_size)
        return _to_tensor(self._stacks(chosen, random)[:, 0])

    def close(self) -> None:
        """Let the threads go."""
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)

    def _draw(self, step: int) -> Mapping[str, Any]:
        settings = self.settings
        random = np.random.default_rng([self.seed, 0, step])
        stacks = self._stacks(self._chosen(step, random), random)
        mirrored = random.random(self.batch_size) < settings.mirror
        swapped = random.random() < settings.swap_red_blue
        row, column = 0, 0
        if settings.crop and step < self.steps - settings.full_size_steps:
            places = (settings.size - settings.crop) // settings.crop_multiple + 1
            row, column = (random.integers(places, size=2) * settings.crop_multiple).tolist()
            rows, columns = slice(row, row + settings.crop), slice(column, column + settings.crop)
            stacks = stacks[:, :, rows, columns]
        stacks = np.where(mirrored[:, None, None, None, None], stacks[..., ::-1, :], stacks)
        if swapped:
            stacks = stacks[..., ::-1]
        names = ("image", *self.store.names)
        tensors = {name: _to_tensor(stacks[:, place]) for place, name in enumerate(names)}
        return {**tensors, "place": (row, column)}

    def _chosen(self, step: int, random: np.random.Generator) -> npt.NDArray[np.intp]:
        count = len(self.numbers)
        if self.settings.draw == "uniform":
            return random.integers(count, size=self.batch_size)
        epoch, place = divmod(step, self.steps_per_epoch)
        order = np.random.default_rng([self.seed, _ORDER, epoch]).permutation(count)
        order = np.resize(order, max(count, self.batch_size))
        return order[place * self.batch_size : (place + 1) * self.batch_size]

    def _stacks(
        self, chosen: npt.NDArray[np.intp], random: np.random.Generator
    ) -> npt.NDArray[np.uint8]:
        """(N, 1 + targets, size, size, 3), windows of larger pictures at random places."""
        size = self.settings.size
        stacks = []
        for number in chosen:
            stack = self.store.load(self.numbers[number])
            height, width = stack.shape[1:3]
            top, left = random.integers(height - size + 1), random.integers(width - size + 1)
            stacks.append(stack[:, top : top + size, left : left + size])
        return np.stack(stacks)


def _to_tensor(images: npt.NDArray[np.uint8]) -> "torch.Tensor":
    import torch

    pixels = np.ascontiguousarray(images.transpose(0, 3, 1, 2), dtype=np.float32)
    return torch.from_numpy(pixels / np.float32(255))
