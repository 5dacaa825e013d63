"""The network of DCE++, also called Zero-DCE++ (Li, Guo, Loy, TPAMI 2021), symbols as in the code.

A network of separable convolutions sees the image reduced by a scale factor and estimates the map
x_r of curve parameters, one a colour; enlarged again, it is used eight times:
x <- x + x_r (x^2 - x).

Images are float32 (N, 3, H, W), sides multiples of the scale factor. Names of modules are those of
the official state dict.
"""

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from nat2024.errors import ArrayContract
from nat2024.networks.bands import bands_of, run_in_bands

_FEATURES = 32
_STEPS = 8
_HALO = 7  # one 3x3 convolution a layer
_CURVE_BAND = 1 << 15  # pixels whose eight steps stay in the processor's cache


class Separable(nn.Module):
    """A 3x3 convolution of each channel, then a 1x1 convolution of all."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.depth_conv = nn.Conv2d(inputs, inputs, 3, padding=1, groups=inputs)
        self.point_conv = nn.Conv2d(inputs, outputs, 1)

    def forward(self, *parts: Tensor) -> Tensor:
        """Features, or several to be put together, to (N, outputs, H, W)."""
        x = parts[0] if len(parts) == 1 else torch.cat(parts, dim=1)
        return self.point_conv(self.depth_conv(x))  # type: ignore[no-any-return]


class DCEppNet(nn.Module):
    """DCE++ for images whose sides are multiples of `scale_factor`.

    Args:
        scale_factor: how much smaller the image is that the convolutions see.
    """

    def __init__(self, *, scale_factor: int = 12) -> None:
        super().__init__()
        self.scale_factor = scale_factor
        self.e_conv1 = Separable(3, _FEATURES)
        self.e_conv2 = Separable(_FEATURES, _FEATURES)
        self.e_conv3 = Separable(_FEATURES, _FEATURES)
        self.e_conv4 = Separable(_FEATURES, _FEATURES)
        self.e_conv5 = Separable(2 * _FEATURES, _FEATURES)
        self.e_conv6 = Separable(2 * _FEATURES, _FEATURES)
        self.e_conv7 = Separable(2 * _FEATURES, 3)

    def forward(self, image: Tensor) -> tuple[Tensor, Tensor]:
        """Enhance images.

        Returns:
            The enhanced images, not clamped, and x_r (-1..1), both (N, 3, H, W).

        Raises:
            ArrayContract: a side is no multiple of the scale factor.
        """
        curve = self._reduced_curve(image)
        if self.scale_factor > 1:
            size = image.shape[-2:]
            curve = F.interpolate(curve, size=size, mode="bilinear", align_corners=True)
        return _apply_curve(image, curve), curve

    def enhance(self, image: Tensor) -> Tensor:
        """The enhanced images of `forward` alone, for inference: in less time and memory."""
        if torch.is_grad_enabled():
            return self(image)[0]  # type: ignore[no-any-return]
        curve = self._reduced_curve(image)
        count, _, height, width = image.shape
        if self.scale_factor > 1:
            # Rows follow band by band.
            size = (curve.shape[-2], width)
            curve = F.interpolate(curve, size=size, mode="bilinear", align_corners=True)
        enhanced = torch.empty_like(image)
        for start, stop in bands_of(count, height, width, pixels=_CURVE_BAND):
            amount = _rows_of_enlarged(curve, height, start, stop)
            _apply_curve_into(enhanced[..., start:stop, :], image[..., start:stop, :], amount)
        return enhanced

    def _reduced_curve(self, image: Tensor) -> Tensor:
        """x_r at the size that the convolutions see."""
        height, width = image.shape[-2:]
        _check_sides(height, width, self.scale_factor)
        if self.scale_factor > 1:
            size = (height // self.scale_factor, width // self.scale_factor)
            image = F.interpolate(image, size=size, mode="bilinear")
        return run_in_bands(self._estimate, image, halo=_HALO)

    def _estimate(self, image: Tensor) -> Tensor:
        # On a CPU separable convolutions take two thirds of the time channels-last.
        x1 = F.relu_(self.e_conv1(image.contiguous(memory_format=torch.channels_last)))
        x2 = F.relu_(self.e_conv2(x1))
        x3 = F.relu_(self.e_conv3(x2))
        x4 = F.relu_(self.e_conv4(x3))
        x5 = F.relu_(self.e_conv5(x3, x4))
        x6 = F.relu_(self.e_conv6(x2, x5))
        return torch.tanh(self.e_conv7(x1, x6)).contiguous()


def _apply_curve(image: Tensor, curve: Tensor) -> Tensor:
    for _ in range(_STEPS):
        image = torch.addcmul(image, curve, image * image - image)
    return image


def _apply_curve_into(enhanced: Tensor, image: Tensor, curve: Tensor) -> None:
    """What `_apply_curve` gives, written to `enhanced`."""
    room = torch.empty_like(curve)
    for _ in range(_STEPS):
        torch.addcmul(image, image, image, value=-1, out=room)
        torch.addcmul(image, curve, room, value=-1, out=enhanced)
        image = enhanced


def _rows_of_enlarged(curve: Tensor, height: int, start: int, stop: int) -> Tensor:
    """Rows `start` to `stop` of `curve` enlarged to `height` rows, the first and last aligned."""
    rows = curve.shape[-2]
    if rows == height:
        return curve[..., start:stop, :].contiguous()
    ratio = torch.full((), (rows - 1) / (height - 1), device=curve.device)
    place = torch.arange(start, stop, device=curve.device) * ratio
    upper = place.floor()
    weight = (place - upper)[:, None]
    first = upper.long()
    return torch.lerp(
        curve.index_select(-2, first),
        curve.index_select(-2, (first + 1).clamp_max(rows - 1)),
        weight,
    )


def _check_sides(height: int, width: int, multiple: int) -> None:
    if height % multiple or width % multiple:
        msg = (
            f"DCE++ with scale factor {multiple} takes sides that are multiples of {multiple}, "
            f"not {width}x{height}; pad or cut the image"
        )
        raise ArrayContract(msg)
