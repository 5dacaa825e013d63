import pytest
import torch

from nat2024_trackers.siamapn.model import SiamAPNNetwork
from nat2024_trackers.siamapnpp.model import SiamAPNppNetwork


@pytest.mark.parametrize(
    ("make", "kernels"),
    [
        (SiamAPNNetwork, [(256, 4, 4), (384, 6, 6)]),
        (SiamAPNppNetwork, [(256, 6, 6), (384, 8, 8), (256, 6, 6)]),
    ],
)
def test_all_that_depends_on_the_template_is_embedded_once(make, kernels):
    with torch.device("meta"):
        network = make().eval()
        embedded = network.embed(torch.empty(2, 3, 127, 127))
        maps = network.match(embedded, torch.empty(2, 3, 287, 287))
    assert [tuple(kernel.shape) for kernel in embedded] == [(2, *shape) for shape in kernels]
    assert [tuple(one.shape) for one in maps] == [(2, n, 21, 21) for n in (2, 2, 1, 4, 4)]


@pytest.mark.parametrize(
    ("make", "unused"),
    [(SiamAPNNetwork, ()), (SiamAPNppNetwork, ("new.channel.conv1",))],
)
def test_gradients_reach_all_layers_but_the_unused_one(make, unused):
    torch.manual_seed(0)
    network = make().train()
    for name, parameter in network.named_parameters():
        if "gamma" in name:  # they start at zero, which lets nothing through
            torch.nn.init.constant_(parameter, 0.5)
    maps = network(torch.rand(2, 3, 127, 127) * 255, torch.rand(2, 3, 159, 159) * 255)
    sum(one.square().mean() for one in maps).backward()
    without = {
        name.rsplit(".", 2)[0]
        for name, parameter in network.named_parameters()
        if parameter.grad is None or not parameter.grad.any()
    }
    assert without == set(unused)
