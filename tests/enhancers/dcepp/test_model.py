"""The network of DCE++: official names and shapes, numbers, both forms, and training."""

import json
from pathlib import Path

import pytest
import torch
import torch.nn.functional as F

from nat2024.errors import ArrayContract
from nat2024.networks import bands
from nat2024_enhancers.dcepp import model as module
from nat2024_enhancers.dcepp.model import DCEppNet

GOLDEN = json.loads(
    (Path(__file__).parents[2] / "data" / "dcepp_golden.json").read_text(encoding="utf-8")
)


def test_state_dict_has_the_official_names_and_shapes():
    network = DCEppNet()
    assert {k: list(v.shape) for k, v in network.state_dict().items()} == GOLDEN["state_dict"]
    assert sum(p.numel() for p in network.parameters()) == 10_561


def test_the_image_is_stepped_eight_times_along_its_curve(procedural_network, procedural_batch):
    network = procedural_network(DCEppNet())
    batch = procedural_batch("dcepp.steps", (2, 3, 36, 48))
    with torch.no_grad():
        enhanced, curve = network(batch)
    image = batch
    for _ in range(8):
        image = image + curve * (image**2 - image)
    torch.testing.assert_close(enhanced, image, rtol=0, atol=1e-6)


@pytest.mark.parametrize("scale", [1, 4, 12])
@pytest.mark.parametrize("size", [(12, 12), (36, 48), (132, 24)])
def test_inference_and_training_forms_agree(procedural_network, procedural_batch, scale, size):
    network = procedural_network(DCEppNet(scale_factor=scale))
    batch = procedural_batch("dcepp.forms", (2, 3, *size))
    with torch.no_grad():
        enhanced = network.enhance(batch)
    torch.testing.assert_close(enhanced, network(batch)[0].detach(), rtol=0, atol=1e-6)
    torch.testing.assert_close(network.enhance(batch), enhanced, rtol=0, atol=1e-6)


@pytest.mark.parametrize("scale", [1, 12])
def test_bands_equal_the_whole_image(procedural_network, procedural_batch, monkeypatch, scale):
    network = procedural_network(DCEppNet(scale_factor=scale))
    batch = procedural_batch("dcepp.bands", (2, 3, 84, 24))
    with torch.no_grad():
        whole = network.enhance(batch)
        monkeypatch.setattr(bands, "BAND_PIXELS", 1)
        monkeypatch.setattr(module, "_CURVE_BAND", 1)
        torch.testing.assert_close(network.enhance(batch), whole, rtol=0, atol=1e-6)


def test_enlarged_rows_are_those_of_the_library(procedural_batch):
    curve = procedural_batch("dcepp.rows", (1, 3, 90, 7))
    expected = F.interpolate(curve, size=(1080, 7), mode="bilinear", align_corners=True)
    for start, stop in ((0, 1080), (0, 1), (517, 640), (1079, 1080)):
        rows = module._rows_of_enlarged(curve, 1080, start, stop)
        torch.testing.assert_close(rows, expected[..., start:stop, :], rtol=0, atol=1e-6)


def test_the_input_is_left_alone(procedural_network, procedural_batch):
    network = procedural_network(DCEppNet())
    batch = procedural_batch("dcepp.input", (1, 3, 24, 24))
    given = batch.clone()
    with torch.no_grad():
        network.enhance(batch)
    assert torch.equal(batch, given)


@pytest.mark.parametrize("size", [(24, 30), (30, 24), (1, 12)])
def test_sides_off_the_scale_factor_are_refused(size):
    with pytest.raises(ArrayContract, match=r"multiples of 12, not \d+x\d+"):
        DCEppNet()(torch.zeros(1, 3, *size))


@pytest.mark.parametrize("scale", [1, 12])
def test_gradient_reaches_every_parameter_and_the_image(
    procedural_network, procedural_batch, scale
):
    network = procedural_network(DCEppNet(scale_factor=scale)).train()
    batch = procedural_batch("dcepp.gradient", (2, 3, 24, 36)).requires_grad_()
    enhanced, curve = network(batch)
    (enhanced.square().mean() + curve.square().mean()).backward()
    for name, tensor in (*network.named_parameters(), ("image", batch)):
        assert tensor.grad is not None, name
        assert tensor.grad.isfinite().all(), name
        assert tensor.grad.any(), name


def test_a_few_steps_lower_the_loss(procedural_batch, train_a_little):
    torch.manual_seed(0)
    network = DCEppNet(scale_factor=1).train()
    batch = procedural_batch("dcepp.train", (2, 3, 24, 24))
    losses = train_a_little(network, batch, rate=1e-3)
    assert losses[-1] < losses[0]
