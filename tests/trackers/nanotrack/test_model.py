import copy

import numpy as np
import pytest
import torch

from nat2024.errors import InvalidOption
from nat2024_trackers.nanotrack.heads import PixelCorrelation
from nat2024_trackers.nanotrack.mobilenet import divisible
from nat2024_trackers.nanotrack.model import NanoTrackNetwork
from nat2024_trackers.nanotrack.points import PointDecoder, grid_points
from nat2024_trackers.nanotrack.variants import VARIANTS, find_variant

VERSIONS = ("v1", "v2", "v3")


def crops(count=1):
    random = torch.Generator().manual_seed(3)
    return [torch.rand(count, 3, side, side, generator=random) * 255 for side in (127, 255)]


@pytest.fixture(params=VERSIONS)
def network(request):
    torch.manual_seed(0)
    made = NanoTrackNetwork(request.param).eval()
    for part in made.modules():
        if isinstance(part, torch.nn.BatchNorm2d):  # fresh statistics would fold to nothing
            part.running_mean.normal_(std=0.1)
            part.running_var.uniform_(0.5, 2)
            part.weight.data.uniform_(0.5, 1.5)
            part.bias.data.normal_(std=0.1)
    return made


@pytest.mark.parametrize(
    ("version", "parameters", "entries"),
    [("v1", 292_190, 231), ("v2", 338_302, 298), ("v3", 550_854, 438)],
)
def test_networks_have_the_published_size(version, parameters, entries):
    with torch.device("meta"):
        network = NanoTrackNetwork(version)
    assert sum(parameter.numel() for parameter in network.parameters()) == parameters
    assert len(network.state_dict()) == entries


def test_the_folded_form_equals_the_plain_one(network):
    template, search = crops(2)
    plain = network(template, search)
    with torch.no_grad():
        folded = network(template, search)
    for one, other in zip(plain, folded, strict=True):
        assert one.grad_fn is not None
        torch.testing.assert_close(other, one.detach(), rtol=1e-4, atol=1e-4)


def test_weights_loaded_later_count_from_the_next_embed(network):
    template, search = crops()
    other = copy.deepcopy(network)
    for parameter in other.parameters():
        parameter.data.mul_(1.1)
    with torch.no_grad():
        kernels = network.embed(template)
        before = network.match(kernels, search)
        expected = other(template, search)
        network.load_state_dict(other.state_dict())
        # Both sides of a sequence that has begun stay of one set of weights.
        assert torch.equal(network.match(kernels, search)[0], before[0])
        after = network(template, search)
    assert not torch.equal(before[0], after[0])
    torch.testing.assert_close(after, expected)


def test_a_folded_copy_made_in_inference_mode_serves_ordinary_code_too(network):
    template, search = crops()
    with torch.inference_mode():
        network(template, search)
    with torch.no_grad():
        found = network(template, search)[0]
    assert not found.is_inference()


def test_gradients_reach_every_layer_but_the_unused_neck(network):
    network.train()
    classes, distances = network(*crops(2))
    (classes.square().mean() + distances.log().square().mean()).backward()
    reached = {
        name
        for name, p in network.named_parameters()
        if p.grad is not None and p.grad.abs().sum() > 0
    }
    missed = {name for name, _ in network.named_parameters()} - reached
    # A bias before a batch norm changes nothing, up to rounding.
    biases = {name for name in missed if name.endswith(".0.bias") or name.endswith(".3.bias")}
    assert {name for name in missed - biases if not name.startswith("neck.")} == set()
    assert any(name.startswith("neck.") for name in missed)


def test_pixel_correlation_is_a_dot_product_for_each_template_position():
    layer = PixelCorrelation()
    layer.CA_layer = torch.nn.Identity()
    random = torch.Generator().manual_seed(0)
    template = torch.randn(2, 5, 8, 8, generator=random)
    search = torch.randn(2, 5, 16, 16, generator=random)
    found = layer(layer.embed(template), search)
    assert found.shape == (2, 64, 16, 16)
    for sample, row, column, y, x in [(0, 0, 0, 0, 0), (1, 3, 5, 2, 9), (1, 7, 0, 15, 4)]:
        expected = template[sample, :, row, column] @ search[sample, :, y, x]
        torch.testing.assert_close(found[sample, row * 8 + column, y, x], expected)


@pytest.mark.parametrize(
    ("version", "map_size", "numbers"),
    [
        ("v1", 16, (0.148, 0.462, 0.390)),
        ("v2", 16, (0.150, 0.490, 0.385)),
        ("v3", 15, (0.138, 0.455, 0.348)),
    ],
)
def test_constants_of_the_official_configurations(version, map_size, numbers):
    constants = find_variant(version)
    assert (constants.instance_size, constants.exemplar_size) == (255, 127)
    assert (constants.map_size, constants.stride) == (map_size, 16)
    found = (constants.penalty_k, constants.window_influence, constants.learning_rate)
    assert found == numbers


def test_an_unknown_variant_names_the_known_ones():
    with pytest.raises(InvalidOption, match=r"no variant 'v4'.*it has v1, v2, v3"):
        find_variant("v4")


@pytest.mark.parametrize(("version", "last"), [("v1", 112), ("v3", 112)])
def test_the_grid_of_points(version, last):
    constants = VARIANTS[version]
    points = grid_points(constants)
    n = constants.map_size
    assert points.shape == (2, n * n)
    assert points[:, 0].tolist() == [-(n // 2) * 16] * 2
    assert points[:, n - 1].tolist() == [last, -(n // 2) * 16]
    assert points[:, -1].tolist() == [last, last]


def test_maps_are_decoded_to_scores_and_boxes():
    constants = VARIANTS["v1"]
    classes = np.zeros((2, 2, 16, 16), dtype=np.float32)
    distances = np.ones((2, 4, 16, 16), dtype=np.float32)
    row, column = 3, 12
    index = row * 16 + column
    classes[1, 0, row, column], classes[1, 1, row, column] = -1, 2
    distances[1, :, row, column] = (10, 20, 30, 50)
    found = PointDecoder(constants)((classes, distances))
    assert found.scores.argmax(1)[1] == index
    assert found.scores[1, index] == pytest.approx(1 / (1 + np.exp(-3)))
    np.testing.assert_allclose(found.scores[0], 0.5)
    # The point is (64, -80), the box from (54, -100) to (94, -30).
    np.testing.assert_allclose(found.boxes[1, :, index], [74, -65, 40, 70])


def test_maps_without_bound_give_no_warning():
    classes = np.full((1, 2, 15, 15), np.inf, dtype=np.float32)
    distances = np.full((1, 4, 15, 15), np.inf, dtype=np.float32)
    assert np.isnan(PointDecoder(VARIANTS["v3"])((classes, distances)).scores).all()


@pytest.mark.parametrize(("channels", "expected"), [(4, 8), (24, 24), (30, 32), (36, 40), (72, 72)])
def test_channels_become_multiples_of_eight(channels, expected):
    assert divisible(channels) == expected
