"""What enhancing tells: of each image while it runs, and of all of them at its end."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import msgspec

from nat2024.enhancing.feeding import Feed, enhance_unrounded
from nat2024.interfaces import Enhancer
from nat2024.types import Image


@dataclass(frozen=True, slots=True)
class Observation:
    """One image before and after an enhancer, handed to an observer.

    Attributes:
        title: `NAME[@LABEL]` of the enhancer.
        name: of the image, from the top of the input.
        enhancer: that made it.
        before: uint8 (H, W, 3) BGR.
        after: uint8 (H, W, 3) BGR, as it is stored.
        feed: how the enhancer was fed.
    """

    title: str
    name: str
    enhancer: Enhancer
    before: Image
    after: Image
    feed: Feed

    def unrounded(self) -> Any:
        """`after` as float32 (H, W, 3) BGR in 0..1 before rounding; enhances once more."""
        return enhance_unrounded(self.enhancer, self.before, self.feed)


Observer: TypeAlias = Callable[[Observation], Any]


class Failure(msgspec.Struct, frozen=True):
    """An image that could not be enhanced, and why."""

    enhancer: str
    image: str
    reason: str


class Enhanced(msgspec.Struct, frozen=True):
    """What one enhancer did.

    Attributes:
        enhancer: `NAME[@LABEL]`.
        folder: of its images.
        written: images, or frames of videos, that were enhanced now.
        finished_before: that were there already.
        failed: that could not be enhanced.
    """

    enhancer: str
    folder: str
    written: int
    finished_before: int
    failed: int


class EnhancementReport(msgspec.Struct, frozen=True):
    """What `enhance_images` did.

    Attributes:
        source: the input.
        kind: how it was read: `image`, `images`, `video` or `dataset`.
        images: number of images, or frames of videos.
        enhancers: what each enhancer did.
        failures: images that could not be enhanced.
    """

    source: str
    kind: str
    images: int
    enhancers: tuple[Enhanced, ...]
    failures: tuple[Failure, ...]
