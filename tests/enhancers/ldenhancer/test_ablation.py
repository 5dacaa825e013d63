"""The variants of the paper's Table V: their networks, their weights, their losses."""

import pytest
import torch

from nat2024 import create_enhancer
from nat2024.errors import InvalidOption
from nat2024.training import write_weights
from nat2024_enhancers.ldenhancer.model import LDEnhancerNet
from nat2024_enhancers.ldenhancer.settings import ABLATION

PARAMETERS = {"baseline": 14301, "+TB": 28106, "+TB+LS": 28106, "+TB+LS+TF": 33522}


@pytest.mark.parametrize("name", ABLATION)
def test_a_variant_has_a_part_of_the_full_names_and_comes_back(name, tmp_path, procedural_state):
    fresh = create_enhancer("ldenhancer", weights=False, **ABLATION[name])
    names = fresh.model.state_dict().keys()
    assert names <= LDEnhancerNet().state_dict().keys()
    assert sum(one.numel() for one in fresh.model.parameters()) == PARAMETERS[name]
    fresh.model.load_state_dict(procedural_state(fresh.model))
    write_weights(tmp_path / "w.safetensors", fresh.model)
    again = create_enhancer("ldenhancer", weights=tmp_path / "w.safetensors", **ABLATION[name])
    batch = torch.rand(1, 3, 40, 33, generator=torch.Generator().manual_seed(0))
    assert torch.equal(again.enhance_batch(batch), fresh.enhance_batch(batch))


@pytest.mark.parametrize("name", ABLATION)
def test_inference_gives_what_training_mode_gives(name, procedural_state):
    fresh = create_enhancer("ldenhancer", weights=False, clamp=False, **ABLATION[name])
    network = fresh.model
    network.load_state_dict(procedural_state(network))
    batch = torch.rand(2, 3, 32, 48, generator=torch.Generator().manual_seed(0))
    with torch.no_grad():
        derived = network(batch, (2, 1))
    plain = network(batch, (2, 1))  # with gradients nothing is derived
    for fast, slow in zip(derived, plain, strict=True):
        torch.testing.assert_close(fast, slow.detach(), atol=2e-5, rtol=1e-4)
    maps = network.maps(batch)
    assert ("P_S" in maps, "M" in maps) == (
        ABLATION[name].get("two_branch"),
        ABLATION[name].get("cross_attention"),
    )


def test_the_full_model_is_the_sum_of_the_parts():
    full = create_enhancer("ldenhancer", weights=False)
    assert full.light_loss
    assert create_enhancer("ldenhancer", weights=False, **ABLATION["+TB+LS+TF"]).light_loss


def test_place_changes_which_positions_are_used(procedural_state):
    network = LDEnhancerNet().eval()
    network.load_state_dict(procedural_state(network))
    batch = torch.rand(1, 3, 32, 32, generator=torch.Generator().manual_seed(0))
    with torch.no_grad():
        assert torch.equal(network(batch)[0], network(batch, (0, 0))[0])
        assert not torch.equal(network(batch)[0], network(batch, (8, 3))[0])


@pytest.mark.parametrize("name", ABLATION)
def test_losses_have_the_terms_of_the_variant(name):
    enhancer = create_enhancer("ldenhancer", weights=False, **ABLATION[name])
    image = torch.rand(2, 3, 32, 32) * 0.3
    batch = {"image": image}
    if enhancer.light_loss:
        batch |= enhancer.targets(image)
        assert enhancer.targets_title == "light-lam500-passes3-excess"
    else:
        assert enhancer.targets_title == ""
    terms = enhancer.loss(batch)
    assert ("light" in terms) == enhancer.light_loss
    assert terms.keys() >= {"spatial", "colour", "smoothness", "exposure"}
    sum(terms.values()).backward()
    unused = [n for n, p in enhancer.model.named_parameters() if p.grad is None]
    assert unused == []


def test_attention_needs_two_branches():
    with pytest.raises(InvalidOption, match="two_branch=false needs light_loss=false"):
        create_enhancer("ldenhancer", weights=False, two_branch=False)
