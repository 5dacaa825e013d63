"""What an enhancer is, and how a tracker asks one: for its crops, or for the whole frame."""

from typing import TYPE_CHECKING, Any, ClassVar, Protocol, runtime_checkable

from nat2024.cards import Card
from nat2024.devices import check_device, explain_lack_of_memory
from nat2024.errors import ArrayContract
from nat2024.images import batch_to_image, check_batch, check_image, image_to_batch
from nat2024.types import Image
from nat2024.zoo import Weights

if TYPE_CHECKING:
    import torch


@runtime_checkable
class BatchEnhancer(Protocol):
    """All that a tracker asks of an enhancer."""

    def enhance_batch(self, batch: "torch.Tensor", /) -> "torch.Tensor":
        """float32 (N, 3, H, W) in 0..1 to the same shape and range."""
        ...


class Enhancer:
    """A low-light enhancer. Write either `enhance` or `enhance_batch`; the other follows.

    Attributes:
        name: registered name, set by `register_enhancer`.
        card: what it is and whose work it is.
        device: where batches live.
        weights: what it was created with, None for methods without weights.
    """

    name: ClassVar[str] = ""
    card: ClassVar[Card]
    device: str
    weights: Weights | None = None

    def __init__(self, *, device: str = "cpu") -> None:
        self.device = check_device(device)

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        if cls.enhance is Enhancer.enhance and cls.enhance_batch is Enhancer.enhance_batch:
            msg = f"{cls.__name__} must define enhance or enhance_batch"
            raise TypeError(msg)

    def enhance(self, image: Image, *, bgr: bool = False) -> Image:
        """Enhance one image, uint8 (H, W, 3) to uint8 (H, W, 3), rounded to nearest.

        The method sees RGB, as the authors' stand-alone tests feed it.

        Args:
            image: any height and width of at least 1; not modified.
            bgr: whether `image` (and the answer) is in BGR order, as OpenCV reads it.

        Raises:
            ArrayContract: `image` is not uint8 (H, W, 3).
            OutOfMemory: the image is too large for the device.
        """
        height, width = check_image(image).shape[:2]
        with explain_lack_of_memory(self.name, height, width):
            batch = image_to_batch(image, self.device, reverse=bgr)
            return batch_to_image(self.enhance_batch(batch), reverse=bgr)

    def enhance_batch(self, batch: "torch.Tensor") -> "torch.Tensor":
        """Enhance float32 (N, 3, H, W) in 0..1, channels fed in the order given.

        Trackers call it on BGR crops, or on the BGR frame where the scope is "frame".

        Raises:
            ArrayContract: `batch` is not float32 (N, 3, H, W).
        """
        import torch

        check_batch(batch)
        images = [self.enhance(batch_to_image(one.unsqueeze(0))) for one in batch]
        return torch.cat([image_to_batch(image, self.device) for image in images])

    def maps(self, batch: "torch.Tensor") -> "dict[str, torch.Tensor]":
        """Intermediate maps by name, channels fed in the order given; empty where there are none.

        Raises:
            ArrayContract: `batch` is not float32 (N, 3, H, W).
        """
        check_batch(batch)
        return {}


def enhance_frame(enhancer: BatchEnhancer, frame: Image, device: str) -> Image:
    """Enhance a uint8 BGR frame, fed to `enhance_batch` as BGR, rounded to nearest.

    An enhancer that has a method `enhance_frame` of its own is asked that instead.
    """
    own = getattr(enhancer, "enhance_frame", None)
    if own is not None:
        enhanced: Image = own(frame)
        return enhanced
    name = getattr(enhancer, "name", "") or "the enhancer"
    with explain_lack_of_memory(name, *frame.shape[:2]):
        return batch_to_image(run_enhancer(enhancer, image_to_batch(frame), device))


def run_enhancer(enhancer: BatchEnhancer, batch: "torch.Tensor", device: str) -> "torch.Tensor":
    """Enhance crops or a frame on the enhancer's own device; without gradients.

    Args:
        enhancer: anything with `enhance_batch`.
        batch: float32 (N, 3, H, W) in 0..1.
        device: where an enhancer that tells no device gets it.

    Returns:
        A tensor of the same shape, on the enhancer's device; its range is the enhancer's.

    Raises:
        ArrayContract: the enhancer gives no tensor, or one of another shape.
    """
    import torch

    with torch.no_grad():
        enhanced = enhancer.enhance_batch(batch.to(getattr(enhancer, "device", device)))
    if not isinstance(enhanced, torch.Tensor):
        msg = f"the enhancer must give a tensor, not {type(enhanced).__name__}"
        raise ArrayContract(msg)
    if enhanced.shape != batch.shape:
        msg = (
            f"the enhancer turned a batch of shape {tuple(batch.shape)} into "
            f"{tuple(enhanced.shape)}; it must keep the shape"
        )
        raise ArrayContract(msg)
    return enhanced.detach()
