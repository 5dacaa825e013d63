"""AlexNet: sizes of its stages, and folded layers that follow the weights."""

import copy

import pytest
import torch

from nat2024_trackers.siamese.alexnet import AlexNet


@pytest.fixture
def network():
    torch.manual_seed(0)
    return AlexNet().eval()


def test_sizes_and_channels_of_the_stages(network):
    with torch.no_grad():
        template = network.stages(torch.rand(2, 3, 127, 127))
        search = network.stages(torch.rand(1, 3, 287, 287))
    assert [tuple(f.shape[1:]) for f in template] == [
        (96, 29, 29),
        (256, 12, 12),
        (384, 10, 10),
        (384, 8, 8),
        (256, 6, 6),
    ]
    assert [f.shape[-1] for f in search] == [69, 32, 30, 28, 26]


def test_the_official_keys(network):
    keys = {key.rsplit(".", 1)[0] for key in network.state_dict()}
    assert keys == {f"layer{stage}.{part}" for stage in range(1, 6) for part in (0, 1)}


def test_inference_equals_training_form(network):
    crops = 255 * torch.rand(1, 3, 127, 127)
    plain = network(crops)
    with torch.no_grad():
        folded = network(crops)
    for one, other in zip(plain, folded, strict=True):
        torch.testing.assert_close(one.detach(), other, rtol=1e-4, atol=1e-4)


def test_new_weights_take_effect_at_once(network):
    crops = 255 * torch.rand(1, 3, 127, 127)
    torch.manual_seed(1)
    other = AlexNet().eval()
    with torch.no_grad():
        before = network(crops)[2]
        twin = copy.deepcopy(network)
        network.load_state_dict(other.state_dict())
        assert torch.equal(network(crops)[2], other(crops)[2])
        assert torch.equal(twin(crops)[2], before)
