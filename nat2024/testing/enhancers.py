"""The contract of an enhancer as a set of checks on a created one."""

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from nat2024.errors import ArrayContract, BrokenPlugin
from nat2024.images import batch_to_image, image_to_batch
from nat2024.interfaces import Enhancer
from nat2024.types import Image

if TYPE_CHECKING:
    import torch

SIZES = ((1, 1), (1, 7), (37, 53), (65, 71), (5, 300))
"""(height, width) of the images that are tried: below, between and beside usual strides."""

_BATCH_TOLERANCE = 1e-5


def check_enhancer(enhancer: Enhancer) -> None:
    """Check that a created enhancer keeps the contract of `Enhancer`.

    It answers in the shape and type of its input at odd sizes, leaves its input alone, stays in
    0..1 (unless it was created with `clamp=False`), refuses what is no image or batch with
    `ArrayContract`, and, unless its card says that it is not repeatable, gives the same answer
    again, whether images come in RGB or BGR, one by one, as images or in a batch.

    Example:
        >>> from nat2024.registry import create_enhancer
        >>> check_enhancer(create_enhancer("gamma"))

    Raises:
        BrokenPlugin: a part of the contract is not kept; says which and for what input.
    """
    images = [night_image(height, width) for height, width in SIZES]
    # answers are kept for later checks: large networks are slow
    answers = []
    for image in images:
        answer = _check_image_answer(enhancer, image)
        if enhancer.card.repeatable:
            _check_repeats(enhancer, image, answer)
        answers.append((image, answer, _check_batch_answer(enhancer, image)))
    if enhancer.card.repeatable:
        for image, answer, of_batch in answers:
            _check_colour_order(enhancer, image, answer)
            _check_image_equals_batch(enhancer, image, answer, of_batch)
            _check_batch_of_two(enhancer, image, of_batch)
    _check_refusals(enhancer)


def night_image(height: int, width: int, seed: int = 0) -> Image:
    """Make a dark uint8 (height, width, 3) RGB image with a lamp, its warm light, and noise."""
    random = np.random.Generator(np.random.PCG64(seed))
    rows, columns = np.mgrid[0:height, 0:width]
    distance = np.hypot((rows + 0.5) / height - 0.3, (columns + 0.5) / width - 0.6)
    light = 20 + 235 * np.exp(-((distance / 0.12) ** 2)) + 50 * np.exp(-3 * distance)
    noisy = light[..., None] * (1.0, 0.85, 0.6) + random.normal(0, 6, (height, width, 3))
    image: Image = noisy.clip(0, 255).round().astype(np.uint8)
    return image


def _fail(enhancer: Enhancer, reason: str) -> BrokenPlugin:
    return BrokenPlugin(f"enhancer {enhancer.name or type(enhancer).__name__} {reason}")


def _text(image: Image) -> str:
    return f"an image of {image.shape[1]}x{image.shape[0]}"


def _check_image_answer(enhancer: Enhancer, image: Image) -> Image:
    """The checked answer, copied: an enhancer may use its memory again."""
    given = image.copy()
    answer: Any = enhancer.enhance(given)
    if not isinstance(answer, np.ndarray) or answer.dtype != np.uint8:
        kind = getattr(answer, "dtype", type(answer).__name__)
        raise _fail(enhancer, f"must answer {_text(image)} with a uint8 array, not {kind}")
    if answer.shape != image.shape:
        raise _fail(enhancer, f"answers {_text(image)} with the shape {answer.shape}")
    if not np.array_equal(given, image):
        raise _fail(enhancer, f"modifies its input, {_text(image)}")
    checked: Image = answer.copy()
    return checked


def _check_batch_answer(enhancer: Enhancer, image: Image) -> "torch.Tensor":
    """The checked answer, copied as that for an image."""
    import torch

    batch = image_to_batch(image, enhancer.device)
    given = batch.clone()
    answer: Any = enhancer.enhance_batch(given)
    if not isinstance(answer, torch.Tensor) or answer.dtype != torch.float32:
        kind = getattr(answer, "dtype", type(answer).__name__)
        raise _fail(enhancer, f"must answer a batch with a float32 tensor, not {kind}")
    if answer.shape != batch.shape:
        shapes = f"{tuple(batch.shape)} with the shape {tuple(answer.shape)}"
        raise _fail(enhancer, f"answers a batch of the shape {shapes}")
    if answer.device != batch.device:
        raise _fail(enhancer, f"answers a batch on {batch.device} on {answer.device}")
    if not torch.equal(given, batch):
        raise _fail(enhancer, f"modifies its input, a batch of the shape {tuple(batch.shape)}")
    low, high = answer.min().item(), answer.max().item()
    if getattr(enhancer, "clamp", True) and not (low >= 0.0 and high <= 1.0):
        raise _fail(enhancer, f"leaves 0..1: {_text(image)} becomes {low:g}..{high:g}")
    return answer.clone()


def _check_repeats(enhancer: Enhancer, image: Image, answer: Image) -> None:
    if not np.array_equal(answer, enhancer.enhance(image.copy())):
        raise _fail(enhancer, f"is not deterministic: {_text(image)} has two answers")


def _check_colour_order(enhancer: Enhancer, image: Image, answer: Image) -> None:
    bgr = enhancer.enhance(np.ascontiguousarray(image[..., ::-1]), bgr=True)
    if not np.array_equal(answer, bgr[..., ::-1]):
        raise _fail(enhancer, f"ignores bgr=True: {_text(image)} has another answer in BGR")


def _check_image_equals_batch(
    enhancer: Enhancer, image: Image, answer: Image, of_batch: "torch.Tensor"
) -> None:
    from_batch = batch_to_image(of_batch)
    difference = _largest_difference(answer, from_batch)
    if difference > 1:  # some networks are meant to see images in BGR
        in_bgr = enhancer.enhance(image.copy(), bgr=True)
        difference = min(difference, _largest_difference(in_bgr, from_batch))
    if difference > 1:
        reason = f"disagree by {difference} of 255 for {_text(image)}"
        raise _fail(enhancer, f"is inconsistent: enhance and enhance_batch {reason}")


def _largest_difference(first: Image, second: Image) -> int:
    return int(np.abs(first.astype(int) - second).max())


def _check_batch_of_two(enhancer: Enhancer, image: Image, of_batch: "torch.Tensor") -> None:
    import torch

    singles = [
        image_to_batch(one, enhancer.device) for one in (image, np.ascontiguousarray(255 - image))
    ]
    together = enhancer.enhance_batch(torch.cat(singles))
    apart = torch.cat([of_batch, enhancer.enhance_batch(singles[1])])
    if together.shape != apart.shape:
        shapes = f"{tuple(together.shape)} instead of {tuple(apart.shape)}"
        raise _fail(enhancer, f"mixes a batch of two: its answer has the shape {shapes}")
    difference = (together - apart).abs().max().item()
    if not difference <= _BATCH_TOLERANCE:
        reason = f"differs from single answers by {difference:g} for {_text(image)}"
        raise _fail(enhancer, f"mixes a batch of two: it {reason}")


def _check_refusals(enhancer: Enhancer) -> None:
    for what, call in _wrong_inputs(enhancer):
        try:
            call()
        except ArrayContract:
            continue
        except Exception as error:  # a foreign enhancer may fail in any way
            reason = f"raises {type(error).__name__} ({error})"
            raise _fail(enhancer, f"must refuse {what} with ArrayContract, but {reason}") from error
        raise _fail(enhancer, f"must refuse {what} with ArrayContract, but takes it")


def _wrong_inputs(enhancer: Enhancer) -> Iterator[tuple[str, Callable[[], object]]]:
    import torch

    image = night_image(37, 53)
    images: dict[str, Any] = {
        "a float image": image.astype(np.float32),
        "an image without channels": image[..., 0],
        "an image of four channels": np.zeros((37, 53, 4), np.uint8),
        "an image without rows": image[:0],
        "a list instead of an image": image.tolist(),
    }
    for what, wrong in images.items():
        yield what, lambda wrong=wrong: enhancer.enhance(wrong)  # type: ignore[misc]
    batch: torch.Tensor = image_to_batch(image, enhancer.device)
    batches: dict[str, Any] = {
        "a uint8 batch": batch.to(torch.uint8),
        "a float64 batch": batch.to(torch.float64),
        "a batch of four channels": torch.cat([batch, batch[:, :1]], dim=1),
        "a batch of three dimensions": batch[0],
        "an empty batch": batch[:0],
        "an array instead of a batch": batch.cpu().numpy(),
    }
    for what, wrong in batches.items():
        yield what, lambda wrong=wrong: enhancer.enhance_batch(wrong)  # type: ignore[misc]
