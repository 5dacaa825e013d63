"""Convolutions at inference, in the form that is fastest for them."""

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from nat2024.networks.folding import Derived, fold_batch_norm, may_derive
from nat2024.networks.plain_form import is_plain
from nat2024.networks.winograd import WinogradConvolution

_KERNELS = (3, 5)
_CHANNELS = 64**2
"""Channels in times channels out from which fewer multiplications save more than they cost."""

_CELLS = 64
"""Outputs of a channel, likewise."""


class Convolution:
    """A convolution whose weights stay as they are; for inference.

    Channels-last, which is faster on a CPU, and there in Winograd's form where that saves time: in
    float32, with stride 1, many channels and kernels of 3 or 5. Its numbers differ by rounding
    only. Keep it in a `Derived`.
    """

    def __init__(
        self,
        weight: Tensor,
        bias: Tensor | None = None,
        stride: tuple[int, ...] | int = 1,
        padding: tuple[int, ...] | int = 0,
        dilation: tuple[int, ...] | int = 1,
        groups: int = 1,
    ) -> None:
        """Take the weights.

        Args:
            weight: (channels out, channels in / groups, height, width) of the kernel.
            bias: (channels out,).
            stride: of both dimensions, or of each.
            padding: zeros on each side, likewise.
            dilation: distance between a kernel's taps, likewise.
            groups: into how many the channels are divided.
        """
        self.weight = weight.detach().contiguous(memory_format=torch.channels_last)
        self.bias = None if bias is None else bias.detach()
        self.stride, self.padding, self.dilation = map(_pair, (stride, padding, dilation))
        self.groups = groups
        self._may_transform = self._has_winograd_form()
        self._transformed: WinogradConvolution | None = None

    @classmethod
    def of(cls, layer: nn.Conv2d, norm: nn.BatchNorm2d | None = None) -> "Convolution":
        """The convolution of a layer that pads with zeros, with the norm after it in eval mode."""
        assert not isinstance(layer.padding, str)
        folded = (layer.weight, layer.bias) if norm is None else fold_batch_norm(layer, norm)
        return cls(*folded, layer.stride, layer.padding, layer.dilation, layer.groups)

    def __call__(self, maps: Tensor) -> Tensor:
        """From (n, channels in, h, w) to (n, channels out, ...), channels-last."""
        if not self._may_transform or is_plain() or not self._pays(maps):
            maps = maps.contiguous(memory_format=torch.channels_last)
            return F.conv2d(
                maps,
                self.weight,
                self.bias,
                self.stride,
                self.padding,
                self.dilation,
                self.groups,
            )
        if self._transformed is None:
            # Ordinary tensors, whatever mode asks first.
            with torch.inference_mode(mode=False), torch.no_grad():
                self._transformed = WinogradConvolution(self.weight, self.bias)
        return self._transformed(maps, self.padding[0])

    def _has_winograd_form(self) -> bool:
        """Whether there is one, and enough channels for it to pay."""
        channels_out, channels_in, height, width = self.weight.shape
        return (
            height == width
            and height in _KERNELS
            and self.stride == self.dilation == (1, 1)
            and self.padding[0] == self.padding[1]
            and self.groups == 1
            and self.weight.dtype == torch.float32
            and channels_in * channels_out >= _CHANNELS
        )

    def _pays(self, maps: Tensor) -> bool:
        height, width = (
            side + 2 * self.padding[0] - self.weight.shape[-1] + 1 for side in maps.shape[-2:]
        )
        return (
            type(maps) is Tensor  # none that only has a shape
            and maps.device.type == "cpu"
            and maps.dtype == torch.float32
            and not torch.is_autocast_enabled("cpu")  # which computes in fewer digits
            and len(maps) > 0
            and height * width >= _CELLS
        )


class FastConv2d(nn.Conv2d):
    """`nn.Conv2d` without groups or dilation that is a `Convolution` at inference."""

    def __init__(
        self,
        in_channels: int,
        out_channels: int,
        kernel_size: int,
        *,
        stride: int = 1,
        padding: int = 0,
        bias: bool = True,
    ) -> None:
        """Build with fresh weights, as `nn.Conv2d` does."""
        super().__init__(in_channels, out_channels, kernel_size, stride, padding, bias=bias)
        self._prepared = Derived(self, self._prepare)

    def forward(self, input: Tensor) -> Tensor:
        """(n, channels in, h, w) to (n, channels out, ...)."""
        return self._prepared()(input) if may_derive(self) else super().forward(input)

    def _prepare(self) -> Convolution:
        return Convolution.of(self)


def _pair(value: tuple[int, ...] | int) -> tuple[int, int]:
    both = (value, value) if isinstance(value, int) else value
    vertical, horizontal = both
    return vertical, horizontal


def convolve_pair(layer: nn.Conv2d, first: Tensor, second: Tensor) -> Tensor:
    """What `layer` gives for the channels of `first` followed by those of `second`.

    Neither is copied to lie beside the other. The sum over input channels is taken in two parts,
    so that results differ from those of the concatenated inputs by rounding only.

    Args:
        layer: a convolution without groups, with zero padding.
        first: (N, C1, H, W).
        second: (N, C2, H, W), with C1 + C2 input channels of the layer.
    """
    inputs = first.shape[1]
    of_first, of_second = layer.weight[:, :inputs], layer.weight[:, inputs:]
    answer = F.conv2d(first, of_first, layer.bias, layer.stride, layer.padding, layer.dilation)
    more = F.conv2d(second, of_second, None, layer.stride, layer.padding, layer.dilation)
    return answer.add_(more)
