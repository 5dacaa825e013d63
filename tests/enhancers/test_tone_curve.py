import cv2
import numpy as np
import pytest
import torch

from nat2024.errors import ArrayContract, UsageError, WeightsMismatch, WeightsMissing
from nat2024.images import image_to_batch
from nat2024.measures import adaptivity
from nat2024.measures.adaptivity import measure_adaptivity
from nat2024.registry import create_enhancer
from nat2024.testing import check_enhancer
from nat2024.testing.enhancers import night_image
from nat2024.zoo.curve_files import write_tone_curve

LEVELS = np.arange(256) / 255
POWERS = (0.5, 0.8, 1.5)


@pytest.fixture
def curve_file(tmp_path):
    path = tmp_path / "curve.safetensors"
    write_tone_curve(np.stack([LEVELS**power for power in POWERS]), path)
    return path


def fit(enhancer, images):
    pairs = []
    for image in images:
        answer = enhancer.enhance_batch(image_to_batch(image))[0].permute(1, 2, 0).numpy()
        pairs.append((image, answer))
    return measure_adaptivity(pairs)


def test_fresh_weights_are_the_identity():
    enhancer = create_enhancer("tone_curve", weights=False)
    batch = torch.rand(2, 3, 5, 7)
    assert torch.allclose(enhancer.enhance_batch(batch), batch, atol=1e-6)
    image = night_image(9, 8)
    assert np.array_equal(enhancer.enhance(image), image)


def test_every_channel_has_its_curve_exactly_at_8_bit_levels(curve_file):
    enhancer = create_enhancer("tone_curve", weights=curve_file)
    check_enhancer(enhancer)
    batch = torch.arange(256).div(255).view(1, 1, 1, 256).repeat(1, 3, 1, 1)
    answer = enhancer.enhance_batch(batch)[0, :, 0].numpy()
    assert np.abs(answer - np.stack([LEVELS**power for power in POWERS])).max() < 1e-6


def test_between_levels_the_curve_is_linear(curve_file):
    enhancer = create_enhancer("tone_curve", weights=curve_file)
    values = torch.rand(1, 3, 20, 30, generator=torch.Generator().manual_seed(0))
    answer = enhancer.enhance_batch(values).numpy()
    for channel, power in enumerate(POWERS):
        expected = np.interp(values[0, channel].numpy(), LEVELS, LEVELS**power)
        assert np.abs(answer[0, channel] - expected).max() < 1e-5


def test_curves_belong_to_channels_as_they_are_fed(curve_file):
    image = night_image(12, 14)
    plain = create_enhancer("tone_curve", weights=curve_file)
    turned = create_enhancer("tone_curve", weights=curve_file, channel_order="rgb")
    on_bgr = create_enhancer("tone_curve", weights=curve_file, image_order="bgr")
    rgb, bgr = image_to_batch(image), image_to_batch(image, reverse=True)
    first = (image[..., 0] / 255.0) ** POWERS[0]
    assert np.abs(plain.enhance_batch(rgb)[0, 0].numpy() - first).max() < 1e-6
    on_blue = (image[..., 2] / 255.0) ** POWERS[0]
    assert np.abs(plain.enhance_batch(bgr)[0, 0].numpy() - on_blue).max() < 1e-6
    assert torch.equal(turned.enhance_batch(bgr), plain.enhance_batch(rgb).flip(1))
    assert np.array_equal(plain.enhance(image)[..., 0], (first * 255).round())
    assert np.array_equal(on_bgr.enhance(image)[..., 2], (on_blue * 255).round())


def test_values_beyond_the_range_and_nan(curve_file):
    enhancer = create_enhancer("tone_curve", weights=curve_file, clamp=False)
    batch = torch.full((1, 3, 1, 3), float("nan"))
    batch[..., 0], batch[..., 1] = -3.0, 7.0
    answer = enhancer.enhance_batch(batch)
    assert answer[0, :, 0, 0].tolist() == [0.0] * 3
    assert answer[0, :, 0, 1].tolist() == [1.0] * 3
    assert answer[..., 2].isnan().all()


def test_a_curve_loaded_into_the_model_is_used_at_once(curve_file):
    enhancer = create_enhancer("tone_curve", weights=False)
    other = create_enhancer("tone_curve", weights=curve_file)
    batch = torch.rand(1, 3, 4, 4)
    before = enhancer.enhance_batch(batch)
    enhancer.model.load_state_dict(other.model.state_dict())
    assert torch.equal(enhancer.enhance_batch(batch), other.enhance_batch(batch))
    assert not torch.allclose(before, other.enhance_batch(batch), atol=1e-3)


def test_wrong_curves_and_files_are_refused(tmp_path):
    with pytest.raises(ArrayContract, match=r"not an array of shape \(3, 255\)"):
        write_tone_curve(np.zeros((3, 255)), tmp_path / "a.safetensors")
    with pytest.raises(ArrayContract):
        write_tone_curve(np.full((3, 256), np.nan), tmp_path / "a.safetensors")
    with pytest.raises(UsageError, match="safetensors"):
        write_tone_curve(np.zeros((3, 256)), tmp_path / "a.pth")
    assert not list(tmp_path.iterdir())
    with pytest.raises(WeightsMissing):
        create_enhancer("tone_curve")
    torch.save({"curve": torch.zeros(3, 9)}, tmp_path / "b.pth")
    with pytest.raises(WeightsMismatch, match="curve is"):
        create_enhancer("tone_curve", weights=tmp_path / "b.pth")


def test_gamma_is_found_and_reproduced(tmp_path):
    gamma = create_enhancer("gamma", gamma=0.4)
    images = [night_image(64, 80, seed) for seed in range(3)]
    found = fit(gamma, images)
    assert found.explained == pytest.approx(1.0, abs=1e-9)
    assert found.verdict == adaptivity.FIXED
    write_tone_curve(found.curve, tmp_path / "gamma.safetensors")
    curve = create_enhancer("tone_curve", weights=tmp_path / "gamma.safetensors")
    for image in images:
        batch = image_to_batch(image)
        assert (curve.enhance_batch(batch) - gamma.enhance_batch(batch)).abs().max() < 1e-6


@pytest.mark.parametrize(
    ("name", "verdict"),
    [
        ("none", adaptivity.NONE),
        ("he", adaptivity.BETWEEN),
        ("adtrack_tonemap", adaptivity.BETWEEN),
        ("clahe", adaptivity.INSIDE),
        ("msrcr", adaptivity.INSIDE),
    ],
)
def test_classical_enhancers_are_told_apart(name, verdict):
    # smooth light in few colours, as in real nights; noise of every pixel would hide repetitions
    images = [cv2.GaussianBlur(night_image(96, 128), (0, 0), 3), night_image(96, 128, 1) // 8 * 4]
    found = fit(create_enhancer(name), images)
    assert found.verdict == verdict
    assert not found.explained > 0.999


@pytest.mark.shared
def test_ldenhancer_as_released_is_a_fixed_tone_curve(shared, tmp_path):
    kit = shared / "parity" / "enhancers"
    network = create_enhancer("ldenhancer", weights=kit / "checkpoints" / "ldenhancer_model.pth")
    paths = sorted((shared / "realdata" / "night_first_frames").glob("*.jpg"))
    images = []
    for path in paths:
        small = cv2.resize(cv2.imread(str(path)), (160, 96), interpolation=cv2.INTER_AREA)
        images.append(np.ascontiguousarray(small[..., ::-1]))
    found = fit(network, images[::2])
    assert found.explained > 0.99999
    assert found.verdict == adaptivity.FIXED
    assert found.mean_residual < 1e-4
    assert found.max_residual < 0.0066
    assert found.border_max_residual > found.max_residual
    assert found.gain_inside < 0.002
    assert abs(found.gain_per_stop) < 0.001
    known = {26: (0.185, 0.350, 0.735), 51: (0.221, 0.403, 0.769), 128: (0.134, 0.260, 0.590)}
    curves = dict(zip("RGB", found.curve, strict=True))
    for channel, values in zip("RGB", known.values(), strict=True):
        levels = (0.1 * 255, 0.2 * 255, 0.5 * 255)
        assert np.interp(levels, range(256), curves[channel]) == pytest.approx(values, abs=0.002)
    write_tone_curve(found.curve, tmp_path / "lde.safetensors")
    curve = create_enhancer("tone_curve", weights=tmp_path / "lde.safetensors")
    for image in images[1::2]:  # images that it was not fitted to, in the order of trackers too
        for reverse in (False, True):
            batch = image_to_batch(image, reverse=reverse)
            difference = (curve.enhance_batch(batch) - network.enhance_batch(batch)).abs()
            assert difference.mean() < 2e-4
            assert difference[..., 2:-2, 2:-2].max() < 0.01
