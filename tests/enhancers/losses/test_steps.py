"""Whole training steps with the kit's weights and images: terms, gradients, updates, buffers."""

import json
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from torch import nn

from nat2024.zoo import read_checkpoint
from nat2024_enhancers.darklighter.model import DarkLighterNet
from nat2024_enhancers.darklighter.settings import DarkLighterSettings
from nat2024_enhancers.darklighter.training import loss_terms as darklighter_terms
from nat2024_enhancers.dcepp.model import DCEppNet
from nat2024_enhancers.dcepp.settings import DCEppSettings
from nat2024_enhancers.dcepp.training import loss_terms as dcepp_terms
from nat2024_enhancers.highlightnet.model import HighlightNet
from nat2024_enhancers.highlightnet.settings import HighlightNetSettings
from nat2024_enhancers.highlightnet.training import loss_terms as highlightnet_terms
from nat2024_enhancers.ldenhancer.model import LDEnhancerNet
from nat2024_enhancers.ldenhancer.settings import LDEnhancerSettings
from nat2024_enhancers.ldenhancer.training import loss_terms, prepare_network
from nat2024_enhancers.llve.model import LLVENet
from nat2024_enhancers.losses.consistency import flow_consistency, warp
from nat2024_enhancers.losses.perceptual import TrackingAlexNet, perceptual_terms
from nat2024_enhancers.ruas.model import RUASNet
from nat2024_enhancers.ruas.settings import RUASSettings
from nat2024_enhancers.ruas.training import loss_terms as ruas_terms

pytestmark = pytest.mark.shared

OFFICIAL = {"dropout": 0.0, "colour_least": 0.0}


@pytest.fixture(scope="module")
def expected(kit: Path) -> dict:
    return json.loads((kit / "losses" / "losses.json").read_text())


@pytest.fixture(scope="module")
def batch(kit: Path) -> dict[str, torch.Tensor]:
    def read(kind: str) -> torch.Tensor:
        paths = [kit / "train_batch" / f"NAT{kind}_{number}.png" for number in range(4)]
        stack = np.stack([cv2.imread(str(path))[..., ::-1].transpose(2, 0, 1) for path in paths])
        return torch.from_numpy(stack.astype(np.float32) / 255)

    return {"image": read(""), "light": read("_G"), "content": read("_J")}


def total_of(terms: dict[str, torch.Tensor]) -> torch.Tensor:
    return torch.stack(list(terms.values())).sum()


def check_terms(terms: dict[str, torch.Tensor], wanted: dict, names: dict[str, str]) -> None:
    for mine, theirs in names.items():
        tolerance = 1e-3 if "col" in mine else 1e-4
        assert float(terms[mine].detach()) == pytest.approx(wanted[theirs], rel=tolerance), mine


def check_gradients(network: nn.Module, wanted: dict, total: float | None = None) -> None:
    norms = {
        name: None if one.grad is None else float(one.grad.norm())
        for name, one in network.named_parameters()
    }
    assert norms.keys() == wanted.keys()
    largest = max(value for value in wanted.values() if value is not None)
    for name, value in wanted.items():
        if value is None:
            assert norms[name] is None, name
            continue
        # Biases before a BatchNorm have a gradient of rounding noise.
        assert norms[name] == pytest.approx(value, rel=1e-3, abs=2e-6 * largest), name
    if total is not None:
        found = torch.stack([torch.tensor(one) for one in norms.values() if one is not None]).norm()
        assert float(found) == pytest.approx(total, rel=1e-4)


LDE_NAMES = {
    "smoothness": "L_TV",
    "colour": "col",
    "exposure": "ie",
    "spatial": "spa",
    "light": "light",
}


@pytest.mark.parametrize("weights", ["epoch66", "procedural"])
def test_ldenhancer_step(kit, expected, batch, procedural_state, weights):
    wanted = expected[f"lde_step_{weights}"]
    settings = LDEnhancerSettings(**OFFICIAL)
    network = LDEnhancerNet()
    prepare_network(network, settings)
    official = kit / "checkpoints" / "ldenhancer_model.pth"
    state = read_checkpoint(official) if weights == "epoch66" else procedural_state(network)
    network.load_state_dict(state)
    network.train()
    optimiser = torch.optim.AdamW(network.parameters(), lr=1e-6, weight_decay=1e-4)
    terms = loss_terms(network, batch, settings)
    check_terms(terms, wanted["terms_weighted"], LDE_NAMES)
    total_of(terms).backward()
    assert float(total_of(terms).detach()) == pytest.approx(wanted["loss"], rel=1e-4)
    check_gradients(
        network, wanted["grad_norm_per_parameter"], wanted["total_grad_norm_before_clip"]
    )
    before = {name: one.detach().clone() for name, one in network.named_parameters()}
    torch.nn.utils.clip_grad_norm_(network.parameters(), 0.1)
    optimiser.step()
    for name, value in wanted["abs_update_sum_per_parameter"].items():
        moved = float((network.get_parameter(name).detach() - before[name]).abs().sum())
        if not name.endswith((".conv.0.bias", ".upsample.0.bias")):  # rounding noise, as above
            assert moved == pytest.approx(value, rel=2e-2), name
    buffers = dict(network.named_buffers())
    for name, value in wanted["bn_buffers_after_step"].items():
        np.testing.assert_allclose(buffers[name].numpy(), value, rtol=1e-4, atol=1e-6, err_msg=name)


def test_ldenhancer_terms_in_evaluation_mode(kit, expected, batch):
    network = LDEnhancerNet().eval()
    network.load_state_dict(read_checkpoint(kit / "checkpoints" / "ldenhancer_model.pth"))
    with torch.no_grad():
        terms = loss_terms(network, batch, LDEnhancerSettings(**OFFICIAL))
    check_terms(terms, expected["lde_eval_epoch66"], LDE_NAMES)


def test_dcepp_step(kit, expected, batch):
    wanted = expected["dcepp_step_epoch99_scale1_256"]
    network = DCEppNet()
    network.load_state_dict(read_checkpoint(kit / "checkpoints" / "dcepp_epoch99.pth"))
    terms = dcepp_terms(network, batch, DCEppSettings(colour_least=0.0))
    names = {"smoothness": "tv", "spatial": "spa", "colour": "col", "exposure": "exp"}
    check_terms(terms, wanted["terms"], names)
    total_of(terms).backward()
    assert float(total_of(terms).detach()) == pytest.approx(wanted["loss"], rel=1e-4)
    check_gradients(
        network, wanted["grad_norm_per_parameter"], wanted["total_grad_norm_before_clip"]
    )
    assert network.scale_factor == 12


def test_darklighter_step(kit, expected, batch):
    wanted = expected["darklighter_step_epoch193_without_perceptual"]
    network = DarkLighterNet()
    network.load_state_dict(read_checkpoint(kit / "checkpoints" / "darklighter_epoch193.pth"))
    terms = darklighter_terms(network, batch, DarkLighterSettings())
    names = {"illumination": "ill", "exposure": "cen", "colour": "col", "noise": "noise"}
    check_terms(terms, wanted["terms"], names)
    total_of(terms).backward()
    assert float(total_of(terms).detach()) == pytest.approx(wanted["loss"], rel=1e-4)
    check_gradients(
        network, wanted["grad_norm_per_parameter"], wanted["total_grad_norm_before_clip"]
    )


def test_highlightnet_step(kit, expected, batch):
    wanted = expected["highlightnet_step_epoch99_dropout_off"]
    network = HighlightNet(dropout=0.0).train()
    network.load_state_dict(read_checkpoint(kit / "checkpoints" / "highlightnet_epoch99.pth"))
    terms = highlightnet_terms(network, batch, HighlightNetSettings())
    names = {"smoothness": "tv", "spatial": "spa", "exposure": "exp", "darkness": "dna"}
    assert terms.keys() == names.keys()
    check_terms(terms, wanted["terms"], names)
    total_of(terms).backward()
    assert float(total_of(terms).detach()) == pytest.approx(wanted["loss"], rel=1e-4)
    check_gradients(
        network, wanted["grad_norm_per_parameter"], wanted["total_grad_norm_before_clip"]
    )


def test_ruas_step(kit, expected, batch):
    wanted = expected["ruas_lol_step_NAT_0_top_left_128"]
    network = RUASNet()
    network.load_state_dict(read_checkpoint(kit / "checkpoints" / "ruas_lol.pt"))
    image = batch["image"][:1, :, :128, :128].contiguous()
    terms = ruas_terms(network, {"image": image}, RUASSettings(denoising=1.0))
    light = terms["fidelity"] + terms["smoothness"]
    assert float(light.detach()) == pytest.approx(wanted["enhance_loss"], rel=1e-4)
    assert float(terms["denoising"].detach()) == pytest.approx(wanted["denoise_loss"], rel=1e-4)
    total_of(terms).backward()  # at once: no loss reaches the other's weights
    check_gradients(network.enhance_net, wanted["grad_norm_enhance"])
    check_gradients(network.denoise_net, wanted["grad_norm_denoise"])


def test_llve_step(expected, batch, procedural_state):
    wanted = expected["llve_step_procedural_gain_sqrt2"]
    network = LLVENet()
    network.load_state_dict(procedural_state(network, float(np.float32(np.sqrt(2)))))
    image = batch["image"][:1, :, 64:128, 64:128].flip(1)
    random = np.random.Generator(np.random.PCG64(zlib.crc32(b"llve.flow")))
    flow = torch.from_numpy((random.random((1, 2, 64, 64)) * 6 - 3).astype(np.float32))
    moved = warp(image, flow)
    assert float(moved.mean()) == pytest.approx(wanted["warped_input_mean"], rel=1e-4)
    assert float(moved.std()) == pytest.approx(wanted["warped_input_std"], rel=1e-4)
    terms = flow_consistency(network, image, (3 * image).clamp(0, 1), flow)
    assert float(terms.image.detach()) == pytest.approx(wanted["l1"], rel=1e-4)
    assert float(terms.consistency.detach()) == pytest.approx(wanted["consistency"], rel=1e-4)
    total = terms.image + 20 * terms.consistency
    assert float(total.detach()) == pytest.approx(wanted["total"], rel=1e-4)
    total.backward()
    check_gradients(network, wanted["grad_norm_per_parameter"])


@pytest.mark.parametrize("mode", ["train", "eval"])
def test_sct_perceptual_terms(expected, procedural_state, mode):
    network = TrackingAlexNet()
    network.load_state_dict(procedural_state(network, float(np.float32(np.sqrt(2)))))
    network.train(mode == "train")
    random = np.random.Generator(np.random.PCG64(zlib.crc32(b"loss.enhanced256")))
    image = torch.from_numpy(random.random((2, 3, 256, 256)).astype(np.float32))
    with torch.no_grad():
        terms = perceptual_terms(network, image, (0.5 * image + 0.25).clamp(0, 1))
    wanted = expected[f"sct_perceptual_procedural_alexnet_gain_sqrt2_{mode}"]["terms"]
    # In training mode BatchNorm takes the change of contrast out, what is left is rounding.
    tolerance = {"rel": 1e-4} if mode == "eval" else {"rel": 0.2, "abs": 1e-10}
    assert [float(term) for term in terms] == pytest.approx(wanted, **tolerance)
