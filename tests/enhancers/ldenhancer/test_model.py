"""The network: official names and shapes, numbers, memory-saving forms, and training."""

import copy
import json
from pathlib import Path

import pytest
import torch
from torch._subclasses.fake_tensor import FakeTensorMode
from torch.nn.attention import SDPBackend, sdpa_kernel
from torch.utils._python_dispatch import TorchDispatchMode

from nat2024.errors import ArrayContract
from nat2024.networks import bands
from nat2024.networks.macs import count_macs
from nat2024_enhancers.ldenhancer.attention import fused_attention
from nat2024_enhancers.ldenhancer.model import LDEnhancerNet

GOLDEN = json.loads(
    (Path(__file__).parents[2] / "data" / "ldenhancer_golden.json").read_text(encoding="utf-8")
)


@pytest.fixture
def network(procedural_state):
    net = LDEnhancerNet().eval()
    net.load_state_dict(procedural_state(net))
    return net


@pytest.fixture(scope="module")
def batch(procedural_batch):
    return procedural_batch("ldenhancer.input", (2, 3, 48, 80))


def test_state_dict_has_the_official_names_and_shapes():
    net = LDEnhancerNet()
    assert {k: list(v.shape) for k, v in net.state_dict().items()} == GOLDEN["state_dict"]
    assert sum(p.numel() for p in net.parameters()) == 33_522


@pytest.mark.parametrize("name", list(GOLDEN["maps"]))
def test_procedural_weights_give_the_stored_numbers(network, batch, describe, name):
    with torch.inference_mode():
        array = network(batch)[0] if name == "enhanced" else network.maps(batch)[name]
    actual, expected = describe(array), GOLDEN["maps"][name]
    assert actual["shape"] == expected["shape"]
    for key in ("mean", "std", "samples"):
        assert actual[key] == pytest.approx(expected[key], abs=1e-5), key


def test_forward_gives_image_light_and_amounts(network, batch):
    with torch.inference_mode():
        enhanced, light, amount = network(batch)
        maps = network.maps(batch)
    assert set(maps) == {"F0", "F1", "M", "O1", "O2", "P_S", "P_E", "A"}
    torch.testing.assert_close(light, maps["O2"], rtol=0, atol=0)
    torch.testing.assert_close(amount, maps["P_E"] - maps["P_S"], rtol=0, atol=1e-6)
    image = batch
    for n in range(4):
        image = image + amount[:, 3 * n : 3 * n + 3] * (image**2 - image)
    torch.testing.assert_close(enhanced, image, rtol=0, atol=1e-6)


def test_paper_sign_turns_the_step_round(network, batch, procedural_state):
    paper = LDEnhancerNet(iteration_sign="paper").eval()
    paper.load_state_dict(network.state_dict())
    with torch.inference_mode():
        enhanced, _, amount = paper(batch)
        image = batch
        for n in range(4):
            image = image + amount[:, 3 * n : 3 * n + 3] * image * (1 - image)
    torch.testing.assert_close(enhanced, image, rtol=0, atol=1e-6)


@pytest.mark.parametrize("iterations", [1, 8])
def test_every_iteration_has_its_own_parameters(batch, iterations):
    net = LDEnhancerNet(iterations=iterations).eval()
    assert net.light_estimation.e_conv5.weight.shape[0] == 3 * iterations
    with torch.inference_mode():
        enhanced, _, amount = net(batch)
    assert enhanced.shape == batch.shape
    assert amount.shape == (2, 3 * iterations, 48, 80)


def test_bands_of_rows_equal_the_whole_image(network, procedural_batch, monkeypatch):
    tall = procedural_batch("ldenhancer.tall", (2, 3, 112, 32))
    with torch.inference_mode():
        whole = network(tall)
        monkeypatch.setattr(bands, "BAND_PIXELS", 1)
        banded = network(tall)
    for one, other in zip(whole, banded, strict=True):
        torch.testing.assert_close(one, other, rtol=0, atol=1e-6)


def test_inference_and_gradient_forms_agree(network, batch):
    with torch.inference_mode():
        inferred = network(batch)
    for one, other in zip(inferred, network(batch), strict=True):
        torch.testing.assert_close(one, other.detach(), rtol=0, atol=1e-6)


def _load(net, state):
    net.load_state_dict(state)


def _assign(net, state):
    net.load_state_dict(state, assign=True)


def _replace(net, state):
    for name, part in LDEnhancerNet().eval().named_children():
        setattr(net, name, part)
    net.load_state_dict(state)


def _step(net, state):
    # One step of gradient descent that lands at the other weights.
    for name, parameter in net.named_parameters():
        parameter.grad = parameter.detach() - state[name]
    torch.optim.SGD(net.parameters(), lr=1.0).step()
    with torch.no_grad():
        for name, buffer in net.named_buffers():
            buffer.copy_(state[name])


@pytest.mark.parametrize("change", [_load, _assign, _replace, _step])
def test_no_derived_weight_goes_stale(network, batch, change):
    torch.manual_seed(5)
    target = LDEnhancerNet().eval()
    with torch.no_grad():
        for name, buffer in target.named_buffers():
            if name.endswith("running_mean"):
                buffer.uniform_(-0.1, 0.1)
        network(batch)
        twin = copy.deepcopy(network)
        before = twin(batch)
        change(network, {key: value.clone() for key, value in target.state_dict().items()})
        after = zip(network(batch), target(batch), twin(batch), before, strict=True)
        for now, expected, of_twin, earlier in after:
            torch.testing.assert_close(now, expected, rtol=0, atol=1e-5)
            assert not torch.allclose(now, earlier, atol=1e-3)
            assert torch.equal(of_twin, earlier)


def test_training_in_between_is_seen_at_the_next_inference(network, batch):
    with torch.no_grad():
        before = network(batch)[0]
        network.train()(batch)  # moves the statistics of every BatchNorm
        network.eval()
        after = network(batch)[0]
    assert not torch.allclose(after, before, atol=1e-4)
    torch.testing.assert_close(after, network(batch)[0].detach(), rtol=0, atol=1e-6)


def test_its_cost_is_the_published_one_even_where_only_shapes_are_known(network):
    assert count_macs(network, torch.zeros(1, 3, 256, 256)) == 1_722_695_680
    with torch.device("meta"):
        assert count_macs(LDEnhancerNet().eval(), torch.zeros(1, 3, 256, 256)) == 1_722_695_680
    with FakeTensorMode(allow_non_fake_inputs=True):
        assert count_macs(network, torch.zeros(1, 3, 256, 256)) == 1_722_695_680
    with torch.no_grad():  # no value of the fake mode was kept
        assert type(network(torch.zeros(1, 3, 32, 32))[0]) is torch.Tensor


def test_its_cost_does_not_depend_on_its_weights(network):
    """Keys that are nearly the same let attention do with fewer products."""
    with torch.no_grad():
        network.CrossAttention.layer.multihead_attn.in_proj_weight.mul_(1e-3)
    assert count_macs(network, torch.zeros(1, 3, 256, 256)) == 1_722_695_680


def test_inference_leaves_its_input_and_its_weights_alone(network, batch):
    given, state = batch.clone(), copy.deepcopy(network.state_dict())
    with torch.no_grad():
        once, again = network(batch), network(batch)
    assert torch.equal(batch, given)
    assert all(torch.equal(value, state[key]) for key, value in network.state_dict().items())
    assert all(torch.equal(one, other) for one, other in zip(once, again, strict=True))


def test_many_tokens_give_what_the_plain_attention_gives(network, procedural_batch, monkeypatch):
    wide = procedural_batch("ldenhancer.wide", (1, 3, 320, 640))
    expected = [each.detach() for each in network(wide)]  # with gradients: nothing interpolated
    with torch.no_grad():
        for one, other in zip(network(wide), expected, strict=True):
            torch.testing.assert_close(one, other, rtol=0, atol=2e-6)


@pytest.mark.parametrize(("heads", "multiple"), [(8, 1), (8, 8), (2, 1), (2, 8)])
def test_fused_attention_is_attention(heads, multiple):
    generator = torch.Generator().manual_seed(1)
    q, k, v = (torch.randn(2, heads, 30, 8 // heads, generator=generator) for _ in range(3))
    weights = (q @ k.transpose(-1, -2) * (8 // heads) ** -0.5).softmax(dim=-1)
    attended = fused_attention(q, k, v, head_multiple=multiple)
    torch.testing.assert_close(attended, weights @ v, rtol=0, atol=1e-6)


@pytest.mark.parametrize("heads", [8, 2])
def test_attention_equals_the_module_that_holds_its_weights(heads):
    torch.manual_seed(2)
    layer = LDEnhancerNet(heads=heads).eval().CrossAttention.layer
    query, key, value = torch.randn(3, 2, 15, 8)
    with torch.no_grad():
        expected = layer.multihead_attn(query, key, value, need_weights=True)[0]
        torch.testing.assert_close(layer._attend(query, key, value), expected, rtol=0, atol=1e-6)


def test_inference_can_do_without_the_attention_matrix(network, batch):
    # Raises where no fused kernel takes the arguments.
    with torch.inference_mode(), sdpa_kernel(SDPBackend.FLASH_ATTENTION):
        network(batch)


@pytest.mark.parametrize("size", [(24, 32), (32, 40), (1, 16)])
def test_sides_off_the_stride_are_refused(size):
    with pytest.raises(ArrayContract, match=r"multiples of 16, not \d+x\d+"):
        LDEnhancerNet().eval()(torch.zeros(1, 3, *size))


def test_sides_beyond_the_position_tables_are_refused():
    net = LDEnhancerNet().eval()
    with torch.inference_mode():
        assert net(torch.zeros(1, 3, 16, 8000))[0].shape == (1, 3, 16, 8000)
        for size in ((16, 8016), (8016, 16)):
            with pytest.raises(ArrayContract, match="at most 8000 pixels a side"):
                net.maps(torch.zeros(1, 3, *size))


def test_training_has_dropout_and_batch_statistics(batch):
    torch.manual_seed(3)
    net = LDEnhancerNet().train()
    first, second = net(batch)[0], net(batch)[0]
    assert not torch.equal(first, second)
    assert net.downsamplenet.d1.conv[1].num_batches_tracked == 2
    without = LDEnhancerNet(dropout=0.0).train()
    assert torch.equal(without(batch)[0], without(batch)[0])


def test_gradient_reaches_every_parameter(network, batch):
    network.train()
    enhanced, light, amount = network(batch)
    (enhanced.square().mean() + light.square().mean() + amount.square().mean()).backward()
    without = [name for name, p in network.named_parameters() if p.grad is None]
    assert not without
    assert all(p.grad.isfinite().all() for p in network.parameters())


def test_a_few_steps_lower_the_loss(batch, train_a_little):
    torch.manual_seed(4)
    net = LDEnhancerNet(dropout=0.0).train()
    losses = train_a_little(net, batch, rate=1e-3)
    assert losses[-1] < losses[0]


class LargestTensor(TorchDispatchMode):
    """Remembers how many numbers the largest tensor has that an operation gave."""

    numbers = 0

    def __torch_dispatch__(self, function, types, args=(), kwargs=None):
        answer = function(*args, **(kwargs or {}))
        if isinstance(answer, torch.Tensor):
            self.numbers = max(self.numbers, answer.numel())
        return answer


def test_images_alone_are_the_same_and_come_without_all_amounts(network):
    image, largest = torch.rand(1, 3, 1024, 512), LargestTensor()
    with torch.no_grad():
        expected, _, amount = network(image)
        with largest:
            enhanced = network.enhance(image)
    assert torch.equal(enhanced, expected)
    assert image.numel() < largest.numbers < amount.numel()


def test_images_alone_have_gradients(network, batch):
    enhanced = network.enhance(batch)
    assert enhanced.requires_grad
    assert torch.equal(enhanced, network(batch)[0])


@pytest.mark.parametrize("layout", [torch.contiguous_format, torch.channels_last])
def test_batch_statistics_are_as_exact_as_in_double_precision(
    procedural_state, procedural_batch, layout
):
    # They are not where a BatchNorm gets channels-last data: its float sums run too long there.
    net = LDEnhancerNet(dropout=0.0).train()
    net.load_state_dict(procedural_state(net))
    batch = procedural_batch("ldenhancer.train", (2, 3, 256, 256)).contiguous(memory_format=layout)
    with torch.no_grad():
        single = net(batch)[2].diff(dim=-1).square().mean()
        double = net.double()(batch.double())[2].diff(dim=-1).square().mean()
    assert single.item() == pytest.approx(double.item(), rel=1e-5)
