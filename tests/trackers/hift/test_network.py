import pytest
import torch
from torch import nn

from nat2024_trackers.hift.network import DistanceNetwork, Grader
from nat2024_trackers.siamese.correlation import depthwise_correlation


class Joined(nn.Module):
    """Stands in for a transformer: tells what it is given, answers with one of it."""

    def forward(self, code, third, fourth, fifth):
        self.given = (code, third, fourth, fifth)
        return code + third


@pytest.fixture
def grader():
    torch.manual_seed(0)
    return Grader(Joined()).eval()


@pytest.fixture
def levels():
    torch.manual_seed(1)
    sizes = ((384, 10, 30), (384, 8, 28), (256, 6, 26))
    template = tuple(torch.randn(1, c, size, size) for c, size, _ in sizes)
    search = tuple(torch.randn(1, c, size, size) for c, _, size in sizes)
    return template, search


def test_the_position_code_tells_columns_before_rows(grader):
    code = grader.position_code(3, 5)
    assert code.shape == (1, 192, 3, 5)
    for row, column in ((0, 0), (2, 1), (1, 4)):
        assert torch.equal(code[0, :96, row, column], grader.col_embed.weight[column])
        assert torch.equal(code[0, 96:, row, column], grader.row_embed.weight[row])


@torch.no_grad()
def test_conv3_belongs_to_the_fourth_stage_and_conv2_to_the_fifth(grader, levels):
    template, search = levels
    classes, logit, distances = grader(template, search)
    code, *given = grader.transformer.given
    assert torch.equal(code, grader.position_code(11, 11))
    layers = (grader.conv1, grader.conv3, grader.conv2)
    for found, layer, one, other in zip(given, layers, search, template, strict=True):
        assert found.shape == (1, 192, 11, 11)
        plain = nn.Sequential(*layer.parts, nn.ReLU())(depthwise_correlation(one, other))
        torch.testing.assert_close(found, plain, rtol=1e-4, atol=1e-4)
    assert [m.shape[1] for m in (classes, logit, distances)] == [2, 1, 4]


def test_with_gradients_layers_run_one_by_one_and_give_the_same(grader, levels):
    plain = grader(*levels)
    assert all(one.requires_grad for one in plain)
    with torch.no_grad():
        merged = grader(*levels)
    for one, other in zip(plain, merged, strict=True):
        torch.testing.assert_close(one, other, rtol=1e-4, atol=1e-4)


@torch.no_grad()
def test_statistics_that_are_loaded_later_count(grader, levels):
    before = grader(*levels)[0]
    state = {key: value + 0.5 for key, value in grader.state_dict().items() if "running_v" in key}
    grader.load_state_dict(state, strict=False)
    fresh = Grader(Joined()).eval()
    fresh.load_state_dict(grader.state_dict())
    found = grader(*levels)[0]
    assert not torch.allclose(found, before, atol=1e-3)
    assert torch.equal(found, fresh(*levels)[0])


def test_what_is_kept_of_a_template_are_the_features_of_three_stages():
    with torch.device("meta"):
        network = DistanceNetwork(Joined()).eval()
        kept = network.embed(torch.empty(2, 3, 127, 127))
        maps = network.match(kept, torch.empty(2, 3, 287, 287))
    assert [tuple(one.shape) for one in kept] == [(2, 384, 10, 10), (2, 384, 8, 8), (2, 256, 6, 6)]
    assert [tuple(one.shape) for one in maps] == [(2, n, 11, 11) for n in (2, 1, 4)]
