"""Every card is complete, counts its network rightly and tells its checkpoints from all others."""

import pytest
import torch
from torch._subclasses.fake_tensor import DataDependentOutputException, FakeTensorMode

from nat2024.networks.macs import count_macs, count_parameters
from nat2024.registry import (
    create_enhancer,
    create_tracker,
    list_enhancers,
    list_trackers,
    load_plugin,
    plugin_kind,
)
from nat2024.zoo import entries_of, recognise

CARDS = {
    **{name: load_plugin(name, "enhancer").card for name in list_enhancers()},
    **{name: load_plugin(name, "tracker").card for name in list_trackers()},
}
NETWORKS = [
    pytest.param(name, network, id=f"{name}-{network.variant}".rstrip("-"))
    for name, card in CARDS.items()
    for network in card.networks
    if name != "opencv_nano"  # OpenCV's own, in files
]


def create(name, network):
    options = {"variant": network.variant} if network.variant else {}
    options |= CARDS[name].macs_options
    make = create_tracker if plugin_kind(name) == "tracker" else create_enhancer
    return make(name, weights=False, **options)


def counted(plugin):
    """MACs of one 256x256 image; or of a search crop and of the template crop."""
    try:
        # nothing is computed, so that the largest network is counted in seconds as well
        with FakeTensorMode(allow_non_fake_inputs=True):
            return counted_now(plugin)
    except DataDependentOutputException:  # a network that looks at its numbers
        return counted_now(plugin)


def counted_now(plugin):
    if plugin_kind(plugin.name) == "enhancer":
        return count_macs(plugin.enhance_batch, torch.rand(1, 3, 256, 256)), 0
    model, constants = plugin.model, plugin.constants
    template = torch.rand(1, 3, constants.exemplar_size, constants.exemplar_size)
    search = torch.rand(1, 3, constants.instance_size, constants.instance_size)
    neck = getattr(model, "neck", torch.nn.Identity())
    of_template = count_macs(lambda crop: neck(model.backbone(crop)), template)
    return count_macs(model, template, search) - of_template, of_template


@pytest.mark.parametrize(("name", "network"), NETWORKS)
def test_the_card_counts_its_network_and_knows_its_checkpoint(name, network):
    plugin = create(name, network)
    entries = entries_of(plugin.model.state_dict())
    assert network.keys, f"{name}: card.keys names no entry that tells its checkpoint from others"
    assert entries >= set(network.keys), f"{name}: card.keys names entries that it has not"
    for other in CARDS:
        hint = recognise(entries, "", CARDS, name=other, variant=network.variant)
        if other != name:
            assert hint.startswith(f"it looks like a checkpoint of {name}"), f"{name}: {hint}"
    assert count_parameters(plugin.model) == network.parameters, f"{name}: card.parameters"
    macs, template_macs = counted(plugin)
    assert (macs, template_macs) == (network.macs, network.template_macs), f"{name}: card.macs"


@pytest.mark.parametrize("name", CARDS)
def test_the_card_is_complete(name):
    card = CARDS[name]
    wanted = ["title", "summary", "colour_order"]
    if card.weights or plugin_kind(name) == "enhancer":
        wanted.append("size_rule")
    if card.weights:
        wanted += ["paper", "code", "code_licence", "state", "needs_weights"]
        # No number is told of what could not be run.
        wanted += [] if card.state.startswith("untested") else ["parameters"]
    missing = [field for field in wanted if not getattr(card, field)]
    assert not missing, f"{name}: the card has no {', '.join(missing)}"
    for file in card.weights:
        assert file.name, name
        assert file.where, name
        assert file.licence, name
        assert not file.sha256 or len(file.sha256) == 64, name
    for line in (card.title, card.summary, card.state, card.paper):
        assert "\n" not in line, name


def test_networks_are_counted_for_all_that_have_one():
    names = {param.values[0] for param in NETWORKS}
    with_model = {name for name in CARDS if hasattr(load_plugin(name, plugin_kind(name)), "build")}
    assert with_model | {"siamrpnpp"} <= names


# counted with hooks on the official networks, in G, to the digits that are known
@pytest.mark.parametrize(
    ("name", "variant", "search", "template"),
    [
        ("siamrpnpp", "alex", 6.47, 0.71),
        ("siamrpnpp", "mobilev2", 7.00, 0.86),
        ("siamrpnpp", "r50", 48.81, 10.65),
        ("siamapn", "", 10.15, 0.71),
        ("hift", "", 6.60, 0.71),
        ("lpat", "", 6.52, 0.71),
        ("nanotrack", "v1", 0.069, 0.012),
        ("nanotrack", "v2", 0.078, 0.012),
        ("nanotrack", "v3", 0.109, 0.015),
    ],
)
def test_trackers_agree_with_independent_counts(name, variant, search, template):
    (network,) = (n for n in CARDS[name].networks if n.variant == variant)
    digits = 2 if search > 1 else 3
    assert round(network.macs / 1e9, digits) == search
    assert round(network.template_macs / 1e9, digits) == template


def test_siamapnpp_agrees_with_an_independent_count():
    # 9.2549 here; the independent count, to the digits that are known, lies just above the rounding
    assert CARDS["siamapnpp"].macs / 1e9 == pytest.approx(9.26, abs=0.006)


@pytest.mark.parametrize(
    ("name", "parameters", "giga"),
    [
        ("ldenhancer", 33_522, "1.723"),
        ("dcepp", 10_561, "0.00488"),
        ("darklighter", 74_768, "4.888"),
        ("highlightnet", 14_951, "0.0766"),
        ("sct", 7_913_774, "3.258"),
        ("ruas", 3_438, "0.214"),
        ("enlightengan", 8_636_675, "16.39"),
        ("llve", 4_316_259, "10.03"),
    ],
)
def test_enhancers_agree_with_independent_counts(name, parameters, giga):
    card = CARDS[name]
    digits = len(giga.partition(".")[2])
    assert f"{card.macs / 1e9:.{digits}f}" == giga
    assert card.parameters == parameters


def test_kindpp_agrees_with_independent_counts():
    assert CARDS["kindpp"].parameters == 8_274_508
    assert CARDS["kindpp"].macs / 1e9 == pytest.approx(3.96 + 365.8 + 1.26, abs=0.06)
