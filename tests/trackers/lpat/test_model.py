import pytest
import torch
from torch import nn

from nat2024.interfaces import load_weights
from nat2024.zoo import find_weights
from nat2024_trackers.lpat.model import CorrectionNet, LPATNetwork, far_mask
from nat2024_trackers.lpat.plugin import LPAT

NORMS = "grader.transformer.encoder{}.norm.weight"


@pytest.fixture(scope="module")
def network():
    with torch.device("meta"):
        return LPATNetwork()


def test_the_mask_adds_one_outside_the_neighbourhood():
    mask = far_mask(11, 11)
    assert mask.dtype == torch.float32
    assert mask.shape == (121, 121)
    seen = mask.view(11, 11, 11, 11)
    for row, column in ((0, 0), (5, 5), (10, 3), (1, 9)):
        for other_row in range(11):
            for other_column in range(11):
                near = abs(row - other_row) <= 2 and abs(column - other_column) <= 2
                assert seen[row, column, other_row, other_column] == (0 if near else 1)
    assert int((mask[0] == 0).sum()) == 9


def test_heads_and_layers_of_the_paper(network):
    transformer = network.grader.transformer
    stacks = (transformer.encoder1, transformer.encoder2, transformer.decoder)
    assert [len(stack.layers) for stack in stacks] == [1, 1, 1]
    assert {stack.layers[0].self_attn.heads for stack in stacks} == {8}
    assert transformer.decoder.layers[0].multihead_attn.heads == 8


def test_batch_norms_of_the_local_coder_have_a_large_epsilon(network):
    coder = network.grader.transformer.encoder1.layers[0].loc
    norms = [m for m in coder.modules() if isinstance(m, nn.BatchNorm2d)]
    assert [norm.eps for norm in norms] == [1e-3] * 6
    assert network.grader.conv1.parts[1].eps == 1e-5


@torch.no_grad()
def test_the_correction_adds_to_its_input():
    net = CorrectionNet(6).eval()
    maps = torch.randn(1, 6, 4, 4)
    net.conv_linear.weight.zero_()
    torch.testing.assert_close(net(maps), torch.relu(maps))


def test_both_encoders_end_in_one_norm_that_is_listed_twice(network):
    transformer = network.grader.transformer
    assert transformer.encoder1.norm is transformer.encoder2.norm
    state = network.state_dict()
    assert all(NORMS.format(number) in state for number in (1, 2))
    assert "grader.transformer.encoder1.layers.0.norm0.weight" in state


@pytest.mark.parametrize("through_file", [False, True])
def test_where_both_norms_differ_the_second_counts(tmp_path, through_file):
    """As with the official loader, in whichever order the file lists them."""
    network = LPATNetwork()
    state = network.state_dict()
    state[NORMS.format(1)] = torch.full((192,), 1.0)
    state[NORMS.format(2)] = torch.full((192,), 2.0)
    state = dict(reversed(state.items()))
    if through_file:
        torch.save({"state_dict": state}, tmp_path / "model.pth")
        load_weights(network, find_weights("lpat", tmp_path / "model.pth", LPAT.card))
    else:
        network.load_state_dict(state)
    loaded = network.state_dict()
    for number in (1, 2):
        assert torch.equal(loaded[NORMS.format(number)], torch.full((192,), 2.0))


def test_gradients_reach_all_layers_but_the_unused(crops):
    torch.manual_seed(0)
    network = LPATNetwork().train()
    template, search = crops(2)
    sum(one.square().mean() for one in network(template, search)).backward()
    without = {key for key, p in network.named_parameters() if p.grad is None}
    assert without == {key for key, _ in network.named_parameters() if ".norm0." in key}
