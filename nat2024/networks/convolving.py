"""Convolutions of inputs that lie side by side, without copying them together first."""

import torch.nn.functional as F
from torch import Tensor, nn


def convolve_pair(layer: nn.Conv2d, first: Tensor, second: Tensor) -> Tensor:
    """What `layer` gives for the channels of `first` followed by those of `second`.

    The sum over input channels is taken in two parts, so that results differ from those of the
    concatenated inputs by rounding only.

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
