import pytest
import torch

from nat2024_trackers.hift.model import HiFTNetwork, Modulation


@pytest.fixture
def modulation():
    torch.manual_seed(0)
    return Modulation().eval()


@pytest.fixture(scope="module")
def network():
    with torch.device("meta"):
        return HiFTNetwork()


def test_unused_layers_of_the_checkpoint_are_kept(network):
    prefix = "grader.transformer.encoder.layers.0.eles"
    shapes = {k: tuple(v.shape) for k, v in network.state_dict().items() if k.startswith(prefix)}
    assert shapes == {
        f"{prefix}.0.weight": (192, 192, 3, 3),
        f"{prefix}.0.bias": (192,),
        f"{prefix}.1.weight": (192,),
        f"{prefix}.1.bias": (192,),
    }


def test_heads_and_layers_of_the_paper(network):
    encoder = network.grader.transformer.encoder.layers
    decoder = network.grader.transformer.decoder.layers
    assert (len(encoder), len(decoder)) == (1, 2)
    attentions = [encoder[0].self_attn]
    attentions += [a for layer in decoder for a in (layer.self_attn, layer.multihead_attn)]
    assert {attention.heads for attention in attentions} == {6}


@torch.no_grad()
def test_tokens_leave_the_modulation_in_another_order(modulation):
    tokens, other = torch.randn(2, 121, 192), torch.randn(2, 121, 192)
    found = modulation(tokens, other, (11, 11))  # gamma is 0: nothing else changes
    for sample, token, channel in ((0, 0, 0), (0, 1, 0), (1, 120, 191), (1, 37, 100)):
        place = channel * 121 + token
        assert found[sample, token, channel] == tokens[sample].flatten()[place]
    assert not torch.equal(found, tokens)


@torch.no_grad()
def test_modulation_is_done_sample_by_sample(modulation):
    modulation.gamma.fill_(0.7)
    tokens, other = torch.randn(3, 121, 192), torch.randn(3, 121, 192)
    together = modulation(tokens, other, (11, 11))
    for sample in range(3):
        one = slice(sample, sample + 1)
        alone = modulation(tokens[one], other[one], (11, 11))
        torch.testing.assert_close(together[one], alone, rtol=1e-5, atol=1e-5)


@torch.no_grad()
def test_modulation_reads_memory_whatever_the_strides(modulation):
    modulation.gamma.fill_(0.7)
    tokens = torch.randn(1, 121, 192)
    turned = tokens.transpose(1, 2).contiguous().transpose(1, 2)
    assert torch.equal(modulation(turned, turned, (11, 11)), modulation(tokens, tokens, (11, 11)))


@torch.no_grad()
def test_the_channel_weight_has_no_sigmoid(modulation):
    modulation.gamma.fill_(1.0)
    modulation.conv1[0].weight.zero_()
    modulation.conv1[0].bias.fill_(1.0)
    modulation.linear1.weight.fill_(1.0)
    modulation.linear2.weight.fill_(1.0)
    ones = torch.ones(1, 121, 192)
    # 192 ones, summed over 32 channels: a weight of 6144 for every number
    torch.testing.assert_close(modulation(ones, ones, (11, 11)), torch.full_like(ones, 6145.0))


def test_gradients_reach_all_layers_but_the_unused(crops):
    torch.manual_seed(0)
    network = HiFTNetwork().train()
    template, search = crops(2)
    sum(one.square().mean() for one in network(template, search)).backward()
    without = {key for key, p in network.named_parameters() if p.grad is None}
    assert without == {key for key, _ in network.named_parameters() if ".eles." in key}
