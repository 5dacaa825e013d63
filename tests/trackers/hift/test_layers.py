import pytest
import torch
from torch import nn

from nat2024_trackers.hift.layers import MergedConv, halving_conv, head


@pytest.mark.parametrize(
    ("height", "width", "stride"), [(1, 1, 1), (1, 3, 1), (3, 1, 1), (3, 3, 2)]
)
def test_a_merged_convolution_gives_what_its_parts_give(height, width, stride):
    torch.manual_seed(0)
    padding = (height // 2, width // 2)
    convolution = nn.Conv2d(5, 7, (height, width), stride, padding, bias=False)
    norm = nn.BatchNorm2d(7, eps=1e-3)
    nn.init.normal_(norm.running_mean)
    nn.init.uniform_(norm.running_var, 0.001, 2)
    layer = MergedConv(convolution, norm, ("conv", "bn")).eval()
    maps = torch.randn(2, 5, 7, 7)
    plain = layer(maps)
    assert plain.requires_grad
    with torch.no_grad():
        torch.testing.assert_close(layer(maps), plain, rtol=1e-4, atol=1e-4)
        norm.running_mean += 1  # nothing merged may outlive its parts
        after = torch.relu(norm(convolution(maps)))
        torch.testing.assert_close(layer(maps), after, rtol=1e-4, atol=1e-4)


def test_keys_are_the_names_given():
    layer = MergedConv(nn.Conv2d(2, 3, 1, bias=False), nn.BatchNorm2d(3), ("conv", "bn"))
    assert set(layer.state_dict()) == {
        "conv.weight",
        *(f"bn.{name}" for name in ("weight", "bias", "running_mean", "running_var")),
        "bn.num_batches_tracked",
    }


def test_in_training_statistics_are_gathered():
    layer = halving_conv(3, 4).train()
    with torch.no_grad():
        assert layer(torch.randn(2, 3, 21, 21)).shape == (2, 4, 11, 11)
    assert layer.parts[1].num_batches_tracked == 1


def test_heads_keep_the_size_and_have_official_places():
    with torch.device("meta"):
        classes, boxes = head(64), head(64, 4)
    assert [name for name, m in boxes.named_children() if isinstance(m, nn.Conv2d)] == list("0369")
    assert [m.num_groups for m in classes if isinstance(m, nn.GroupNorm)] == [32, 32, 32]
    assert boxes(torch.empty(1, 64, 11, 11, device="meta")).shape == (1, 4, 11, 11)
    assert isinstance(classes[-1], nn.ReLU)
