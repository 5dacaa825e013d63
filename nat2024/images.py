"""Between uint8 images (H, W, 3) and float32 batches (N, 3, H, W) in 0..1."""

from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from nat2024.errors import ArrayContract
from nat2024.types import Image

if TYPE_CHECKING:
    import torch


def check_image(image: Any, what: str = "image") -> Image:
    """Return `image` if it is uint8 (H, W, 3) and not empty, else raise `ArrayContract`."""
    if not isinstance(image, np.ndarray) or image.dtype != np.uint8:
        kind = getattr(image, "dtype", type(image).__name__)
        msg = f"{what} must be a uint8 array of shape (H, W, 3), not {kind}"
        raise ArrayContract(msg)
    if image.ndim != 3 or image.shape[2] != 3 or not image.size:
        msg = f"{what} must have the shape (H, W, 3) with H, W of at least 1, not {image.shape}"
        raise ArrayContract(msg)
    return image


def image_to_batch(image: Image, device: Any = "cpu", *, reverse: bool = False) -> "torch.Tensor":
    """Make a batch of one, float32 (1, 3, H, W) in 0..1; `reverse` turns RGB into BGR and back."""
    import torch

    source = image[..., ::-1] if reverse else image
    pixels = torch.from_numpy(source.transpose(2, 0, 1).copy()).to(device)
    return pixels.unsqueeze(0).to(torch.float32).div_(255.0)


def batch_to_image(
    batch: "torch.Tensor",
    *,
    reverse: bool = False,
    quantise: Literal["round", "truncate"] = "round",
) -> Image:
    """Turn a batch of one in 0..1 into uint8 (H, W, 3), rounded to nearest or cut; NaN to 0."""
    import torch

    pixels = torch.nan_to_num(batch[0], nan=0.0).clamp(0.0, 1.0).mul(255.0)
    if quantise == "round":
        pixels = pixels.round_()
    image: Image = pixels.to(torch.uint8).permute(1, 2, 0).cpu().numpy()
    return np.ascontiguousarray(image[..., ::-1] if reverse else image)


def check_batch(batch: Any) -> None:
    """Raise `ArrayContract` unless `batch` is a float32 tensor (N, 3, H, W) and not empty."""
    import torch

    if not isinstance(batch, torch.Tensor) or batch.dtype != torch.float32:
        kind = getattr(batch, "dtype", type(batch).__name__)
        msg = f"batch must be a float32 tensor of shape (N, 3, H, W), not {kind}"
        raise ArrayContract(msg)
    if batch.ndim != 4 or batch.shape[1] != 3 or not batch.numel():
        msg = f"batch must have the shape (N, 3, H, W), not {tuple(batch.shape)}"
        raise ArrayContract(msg)
