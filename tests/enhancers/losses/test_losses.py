"""Loss functions: what they say of simple pictures, gradients, and the kit's numbers."""

import json
import zlib
from pathlib import Path

import numpy as np
import pytest
import torch

from nat2024.errors import ArrayContract
from nat2024_enhancers.losses import centre, colour, consistency, exposure, light, ruas, spatial
from nat2024_enhancers.losses import smoothness as smooth

SHAPE = (2, 3, 64, 80)


def uniform(name: str, shape: tuple[int, ...] = SHAPE) -> torch.Tensor:
    random = np.random.Generator(np.random.PCG64(zlib.crc32(name.encode())))
    return torch.from_numpy(random.random(shape).astype(np.float32))


@pytest.fixture(scope="module")
def raw(shared: Path) -> dict:
    text = (shared / "parity" / "enhancers" / "losses" / "losses.json").read_text()
    return json.loads(text)["raw_terms"]


ENHANCED, REFERENCE = uniform("loss.enhanced"), uniform("loss.reference")
A = 2 * uniform("loss.A", (2, 12, 64, 80)) - 1
A3 = 2 * uniform("loss.A3") - 1
A8 = 2 * uniform("loss.A8", (2, 8, 64, 80)) - 1
ONE, OTHER = ENHANCED[:1], REFERENCE[:1]

TERMS = {
    "L_spa_mean": lambda: spatial.spatial_consistency(ENHANCED, REFERENCE),
    "L_exp_k_16_0.6_1.5": lambda: exposure.exposure_smooth_l1(ENHANCED),
    "L_TV_weight1000_A12": lambda: 1000 * smooth.total_variation(A),
    "light_smoothl1": lambda: light.light_distribution(3 * uniform("loss.O2"), REFERENCE),
    "dce_L_exp_16_E0.6": lambda: exposure.exposure_mse(ENHANCED),
    "dce_L_TV_weight1_A3": lambda: smooth.total_variation(A3),
    "darklighter_L_cen_16_0.6_on_256": lambda: centre.central_exposure(
        uniform("loss.enhanced256", (2, 3, 256, 256))
    ),
    "darklighter_L_ill_A8": lambda: smooth.total_variation(A8, factor=1),
    "darklighter_noise_A8_mean": lambda: centre.noise_size(A8),
    "highlight_L_exp_16_0.6": lambda: exposure.exposure_mse(ENHANCED, level=0.6),
    "highlight_L_TV_A8": lambda: smooth.total_variation(A8),
    "ruas_enhance_loss_input=enhanced[0:1]_t=reference[0:1]": lambda: ruas.illumination_loss(
        ONE, OTHER
    ),
    "ruas_denoise_loss_output=enhanced[0:1]_target=reference[0:1]": lambda: ruas.denoising_loss(
        ONE, OTHER
    ),
    "ruas_smooth_loss": lambda: ruas.illumination_smoothness(ONE, OTHER),
}


@pytest.mark.shared
@pytest.mark.parametrize("name", TERMS)
def test_terms_equal_those_of_the_official_code(raw, name):
    assert float(TERMS[name]()) == pytest.approx(raw[name], rel=1e-4)


@pytest.mark.shared
def test_maps_and_colours_of_each_image_equal_those_of_the_official_code(raw):
    contrast = spatial.spatial_map(ENHANCED, REFERENCE)
    assert list(contrast.shape) == raw["L_spa_shape"]
    np.testing.assert_allclose(contrast[0, 0, :4, :4], raw["L_spa_map_corner_4x4"], rtol=1e-4)
    differences = colour.channel_differences(ENHANCED, least=0)
    np.testing.assert_allclose(differences, raw["L_color"], rtol=1e-3)
    norms = colour.norm_differences(uniform("loss.enhanced256", (2, 3, 256, 256)))
    np.testing.assert_allclose(norms, raw["darklighter_L_color"], rtol=1e-3)


@pytest.mark.shared
def test_totals_equal_those_of_the_official_code(raw):
    parts = 10 * TERMS["L_spa_mean"]() + 5 * colour.colour_constancy(ENHANCED)
    whole = parts + 10 * TERMS["L_exp_k_16_0.6_1.5"]() + TERMS["light_smoothl1"]()
    assert float(whole + TERMS["L_TV_weight1000_A12"]()) == pytest.approx(
        raw["total_lde"], rel=1e-4
    )
    dce = 1600 * smooth.total_variation(A3) + spatial.spatial_consistency(ENHANCED, REFERENCE)
    dce += 5 * colour.colour_constancy(ENHANCED) + 10 * exposure.exposure_mse(ENHANCED)
    assert float(dce) == pytest.approx(raw["dce_total"], rel=1e-4)


def test_spatial_consistency_is_about_contrast_not_level():
    image = uniform("a", (1, 3, 16, 16))
    inner = spatial.spatial_map(image + 0.2, image)[..., 1:-1, 1:-1]
    torch.testing.assert_close(inner, torch.zeros_like(inner), atol=1e-6, rtol=0)
    assert spatial.spatial_consistency(2 * image, image) > 0


def test_colour_constancy_of_grey_is_zero_and_has_a_gradient():
    grey = torch.full((1, 3, 4, 4), 0.3, requires_grad=True)
    colour.colour_constancy(grey, least=1e-12).backward()
    assert grey.grad is not None
    assert grey.grad.isfinite().all()
    tinted = torch.tensor([0.5, 0.3, 0.3]).view(1, 3, 1, 1).expand(1, 3, 4, 4)
    assert float(colour.colour_constancy(tinted)) == pytest.approx(np.sqrt(2) * 0.04, rel=1e-5)


def test_exposure_has_its_optimum_at_level_over_gain():
    losses = [
        float(exposure.exposure_smooth_l1(torch.full((1, 3, 32, 32), level), level=0.6, gain=1.5))
        for level in (0.3, 0.4, 0.5)
    ]
    assert losses[1] == pytest.approx(0, abs=1e-9)
    assert min(losses[0], losses[2]) > 1e-3
    assert float(exposure.exposure_mse(torch.full((1, 3, 32, 32), 0.5))) == pytest.approx(0.01)


def test_total_variation_of_a_ramp():
    ramp = torch.arange(8.0).expand(1, 1, 4, 8)
    assert float(smooth.total_variation(ramp, factor=1)) == pytest.approx(1.0)
    assert float(smooth.total_variation(ramp.expand(2, 3, 4, 8))) == pytest.approx(6.0)
    assert float(smooth.mean_total_variation(ramp.expand(2, 3, 4, 8))) == pytest.approx(2.0)


def test_the_centre_counts_most_and_other_sizes_are_refused():
    weights = centre.centre_weights()
    assert weights[0, 0] == 1
    assert weights.max() == weights[7, 8] == weights[8, 7]
    with pytest.raises(ArrayContract, match="256x256 images, not 80x64"):
        centre.central_exposure(ENHANCED)


def test_the_meant_smoothness_spares_edges_of_the_image():
    step = torch.zeros(1, 3, 8, 8)
    step[..., 4:] = 1
    flat = torch.zeros_like(step)
    spared = ruas.illumination_smoothness(step, step, fixed=True)
    assert spared < 0.9 * ruas.illumination_smoothness(flat, step, fixed=True)


def test_warp_moves_by_the_flow():
    image = uniform("warp", (1, 3, 9, 9))
    still = consistency.warp(image, torch.zeros(1, 2, 9, 9))
    assert still.shape == image.shape
    flow = torch.zeros(1, 2, 9, 9)
    flow[:, 0] = 2
    torch.testing.assert_close(
        consistency.warp(image, flow)[..., 4, 3], still[..., 4, 5], atol=1e-5, rtol=0
    )
