"""Layers merged for inference, and how what was computed from weights stays true to them."""

from collections.abc import Callable, Iterator
from typing import Generic, TypeVar

import torch
from torch import Tensor, nn

T = TypeVar("T")


class Derived(Generic[T]):
    """Something computed from a module's weights, computed anew when any of them has changed.

    It notices weights that were loaded, replaced, stepped by an optimizer or moved to another
    device, since each of these changes a tensor's version or storage. (Writing through `.data`
    hides from PyTorch, and from this.) In training mode or where gradients are wanted nothing
    should be derived: ask `may_derive` first.

    Where the module itself holds this, `compute` must be one of its methods: `copy.deepcopy` and
    pickling carry a method over to the copy, but leave a lambda with the weights of the original.
    Weights created under `torch.inference_mode` have no versions, and those of `FakeTensorMode` no
    storage; from them every call computes.

    Example:
        >>> layer = nn.Linear(2, 2)
        >>> transposed = Derived(layer, lambda: layer.weight.detach().t().contiguous())
        >>> transposed().shape
        torch.Size([2, 2])
    """

    def __init__(self, module: nn.Module, compute: Callable[[], T]) -> None:
        # In a tuple, so that nn.Module does not take it for a child of whoever holds this.
        self._holder = (module,)
        self._compute = compute
        self._state: list[tuple[Tensor, int, int]] | None = None
        self._value: T

    def __call__(self) -> T:
        """The value for the weights as they are now."""
        (module,) = self._holder
        # The tensors themselves are kept: a freed one's address might be another's tomorrow.
        tensors = list(_tensors(module))
        # Where tensors are traced or only have shapes, nothing can be compared or kept.
        plain = {type(torch.empty(0)), *map(type, tensors)} <= {Tensor, nn.Parameter}
        if not plain or any(tensor.is_inference() for tensor in tensors):
            return self._compute()
        state = [(tensor, tensor.data_ptr(), tensor._version) for tensor in tensors]
        if self._state is None or not _same(state, self._state):
            with torch.no_grad():
                self._value = self._compute()
            self._state = state
        return self._value


def _tensors(module: nn.Module) -> Iterator[Tensor]:
    """All parameters and buffers, in a tenth of the time that PyTorch takes to name them too."""
    for held in (module._parameters, module._buffers):
        for tensor in held.values():
            if tensor is not None:
                yield tensor
    for child in module._modules.values():
        if child is not None:
            yield from _tensors(child)


def _same(now: list[tuple[Tensor, int, int]], then: list[tuple[Tensor, int, int]]) -> bool:
    return len(now) == len(then) and all(
        a is b and address == old_address and version == old_version
        for (a, address, version), (b, old_address, old_version) in zip(now, then, strict=True)
    )


def may_derive(module: nn.Module) -> bool:
    """Whether `module` runs for inference: in eval mode and without gradients."""
    return not module.training and not torch.is_grad_enabled()


def fold_batch_norm(
    layer: nn.Conv2d | nn.ConvTranspose2d, norm: nn.BatchNorm2d
) -> tuple[Tensor, Tensor]:
    """Weight and bias of the one convolution that equals `layer` followed by `norm` in eval mode.

    Computed in float64, since the product of both is rounded only once then.
    """
    if norm.running_var is None or norm.running_mean is None:
        msg = "a BatchNorm without running statistics cannot be folded"
        raise ValueError(msg)
    variance, mean = norm.running_var.double(), norm.running_mean.double()
    scale = (variance + norm.eps).rsqrt()
    shift = torch.zeros_like(mean)
    if norm.affine:
        scale = scale * norm.weight.double()
        shift = norm.bias.double()
    shape = [1, -1, 1, 1] if isinstance(layer, nn.ConvTranspose2d) else [-1, 1, 1, 1]
    weight = layer.weight.double() * scale.view(shape)
    bias = layer.bias.double() if layer.bias is not None else torch.zeros_like(mean)
    dtype = layer.weight.dtype
    return weight.to(dtype), ((bias - mean) * scale + shift).to(dtype)
