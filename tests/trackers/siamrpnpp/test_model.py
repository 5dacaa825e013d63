import json
from pathlib import Path

import numpy as np
import pytest
import torch

from nat2024.errors import InvalidOption
from nat2024_trackers.siamese.correlation import depthwise_correlation
from nat2024_trackers.siamrpnpp.anchors import AnchorDecoder, anchor_boxes
from nat2024_trackers.siamrpnpp.model import SiamRPN
from nat2024_trackers.siamrpnpp.variants import VARIANTS, find_variant

RECIPE = Path(__file__).resolve().parents[2] / "data" / "siamrpn_alex_recipe.json"


@pytest.mark.parametrize(
    ("name", "parameters", "entries"),
    [
        ("alex", 6_251_102, 75),
        ("alex_otb", 6_251_102, 75),
        ("mobilev2", 11_150_446, 450),
        ("r50", 53_950_624, 458),
        ("r50_otb", 53_950_618, 456),
    ],
)
def test_networks_have_the_published_size(name, parameters, entries):
    with torch.device("meta"):
        network = SiamRPN(VARIANTS[name])
    assert sum(parameter.numel() for parameter in network.parameters()) == parameters
    assert len(network.state_dict()) == entries


def test_alex_has_the_official_keys_in_the_official_order():
    official = json.loads(RECIPE.read_text())["tensors"]
    with torch.device("meta"):
        state = SiamRPN(VARIANTS["alex"]).state_dict()
    assert {key: list(value.shape) for key, value in state.items()} == {
        key: entry["shape"] for key, entry in official.items()
    }
    assert list(state) == list(official)


@pytest.mark.parametrize("name", ["alex", "mobilev2", "r50"])
def test_maps_have_the_size_of_the_table(name):
    variant = VARIANTS[name]
    n = variant.constants.map_size
    with torch.device("meta"):
        network = SiamRPN(variant).eval()
        side = variant.constants.instance_size
        classes, offsets = network(torch.empty(2, 3, 127, 127), torch.empty(2, 3, side, side))
    assert classes.shape == (2, 10, n, n)
    assert offsets.shape == (2, 20, n, n)


@pytest.mark.parametrize(
    ("name", "instance", "map_size", "numbers"),
    [
        ("alex", 287, 21, (0.16, 0.40, 0.30)),
        ("alex_otb", 287, 21, (0.16, 0.40, 0.30)),
        ("mobilev2", 255, 25, (0.04, 0.40, 0.50)),
        ("r50", 255, 25, (0.05, 0.42, 0.38)),
        ("r50_otb", 255, 25, (0.24, 0.50, 0.25)),
    ],
)
def test_constants_of_the_official_configurations(name, instance, map_size, numbers):
    constants = find_variant(name).constants
    assert (constants.instance_size, constants.map_size) == (instance, map_size)
    found = (constants.penalty_k, constants.window_influence, constants.learning_rate)
    assert found == numbers


def test_an_unknown_variant_names_the_known_ones():
    with pytest.raises(InvalidOption, match=r"no variant 'r51'; closest: r50.*it has alex,"):
        find_variant("r51")


def test_correlation_gives_each_channel_of_each_sample_its_own_kernel():
    random = torch.Generator().manual_seed(0)
    search = torch.randn(2, 3, 6, 5, generator=random)
    kernel = torch.randn(2, 3, 2, 3, generator=random)
    found = depthwise_correlation(search, kernel)
    assert found.shape == (2, 3, 5, 3)
    for sample, channel, row, column in np.ndindex(2, 3, 5, 3):
        patch = search[sample, channel, row : row + 2, column : column + 3]
        expected = (patch * kernel[sample, channel]).sum()
        torch.testing.assert_close(found[sample, channel, row, column], expected)


def test_gradients_reach_both_branches_of_every_layer():
    network = SiamRPN(VARIANTS["alex"]).train()
    classes, offsets = network(torch.rand(2, 3, 127, 127) * 255, torch.rand(2, 3, 143, 143) * 255)
    (classes.square().mean() + offsets.square().mean()).backward()
    assert all(p.grad is not None and p.grad.abs().sum() > 0 for p in network.parameters())


def test_anchors_have_the_published_shapes_and_places():
    constants = VARIANTS["alex"].constants
    anchors = anchor_boxes(constants)
    assert anchors.shape == (4, 5 * 21 * 21)
    assert anchors.dtype == np.float32
    grid = anchors.reshape(4, 5, 21, 21)
    assert grid[2:, :, 0, 0].T.tolist() == [[104, 32], [88, 40], [64, 64], [40, 80], [32, 96]]
    assert grid[:2, 3, 0, 20].tolist() == [80, -80]
    assert grid[:2, 0, 10, 10].tolist() == [0, 0]


def test_channels_are_read_in_the_official_order():
    constants = VARIANTS["alex"].constants
    decoder = AnchorDecoder(constants)
    classes = np.zeros((2, 10, 21, 21), dtype=np.float32)
    offsets = np.zeros((2, 20, 21, 21), dtype=np.float32)
    anchor, row, column = 3, 4, 17
    index = (anchor * 21 + row) * 21 + column
    classes[1, anchor, row, column] = 1  # background
    classes[1, 5 + anchor, row, column] = 3
    for coordinate, value in enumerate((0.5, -0.25, 0.1, -0.2)):
        offsets[1, 5 * coordinate + anchor, row, column] = value
    found = decoder((classes, offsets))
    assert found.scores.dtype == found.boxes.dtype == np.float32
    assert found.scores.shape == (2, 2205)
    assert found.scores[1].argmax() == index
    assert found.scores[1, index] == pytest.approx(1 / (1 + np.exp(-2)))
    np.testing.assert_allclose(found.scores[0], 0.5)
    expected = [0.5 * 40 + 56, -0.25 * 80 - 48, np.exp(0.1) * 40, np.exp(-0.2) * 80]
    np.testing.assert_allclose(found.boxes[1, :, index], expected, rtol=1e-6)
    np.testing.assert_allclose(found.boxes[0], decoder.anchors)


def test_outputs_without_bound_give_no_warning():
    classes = np.full((1, 10, 21, 21), np.inf, dtype=np.float32)
    offsets = np.full((1, 20, 21, 21), 1e4, dtype=np.float32)
    found = AnchorDecoder(VARIANTS["alex"].constants)((classes, offsets))
    assert np.isnan(found.scores).all()
    assert np.isinf(found.boxes[0, 2]).all()
