"""Light labels: the kit's maps, and what every label must be."""

import cv2
import numpy as np
import pytest
import torch

from nat2024_enhancers.ldenhancer.light_label import light_labels, separate
from nat2024_enhancers.ldenhancer.settings import LabelSettings


def scene(height: int = 48, width: int = 64) -> torch.Tensor:
    random = np.random.default_rng(3)
    y, x = np.mgrid[:height, :width]
    glow = np.exp(-((x - 20) ** 2 + (y - 15) ** 2) / 300)[..., None] * [0.8, 0.6, 0.4]
    blocks = np.kron(random.random((height // 8, width // 8, 1)), np.ones((8, 8, 1))) * 0.1
    return torch.from_numpy((glow + blocks).clip(0, 1).transpose(2, 0, 1)[None])


def read(path) -> torch.Tensor:
    image = cv2.imread(str(path))
    assert image is not None, path
    return torch.from_numpy(image[..., ::-1].transpose(2, 0, 1)[None] / np.float32(255))


@pytest.mark.shared
@pytest.mark.parametrize("case", ["dt36_127x127", "dt92_96x160"])
@pytest.mark.parametrize("lam", [50, 500, 25000])
def test_maps_equal_those_of_the_kit(shared, case, lam):
    kit = shared / "parity" / "enhancers"
    wanted = np.load(kit / "light_label" / f"{case}.npz")[f"light_lam{lam}"]
    image = read(kit / "inputs" / f"{case}.png")
    light, content = light_labels(image, LabelSettings(lam=lam))
    np.testing.assert_allclose(light[0].permute(1, 2, 0), wanted, atol=1e-4, rtol=0)
    torch.testing.assert_close(light + content, image, atol=1e-6, rtol=0)


@pytest.mark.shared
def test_a_batch_of_frames_equals_the_kit(shared):
    kit = shared / "parity" / "enhancers"
    images = torch.cat([read(kit / "train_batch" / f"NAT_{number}.png") for number in (0, 3)])
    light, _ = light_labels(images)
    for number, found in zip((0, 3), light, strict=True):
        wanted = np.load(kit / "light_label" / f"NAT_{number}_lam500_sub4.npz")["light_sub4"]
        found = found.permute(1, 2, 0)[::4, ::4]
        np.testing.assert_allclose(found, wanted, atol=1e-4, rtol=0)


@pytest.mark.parametrize("rule", ["excess", "published"])
def test_both_parts_are_in_range_and_light_is_smoother(rule):
    image = scene()
    light, content = light_labels(image, LabelSettings(rule=rule))
    for part in (light, content):
        assert part.dtype == torch.float32
        assert 0 <= part.min() <= part.max() <= 1
    torch.testing.assert_close((light + content).double(), image, atol=1e-6, rtol=0)

    def roughness(x):
        return float((x.roll(1, -1) + x.roll(-1, -1) - 2 * x).square().mean())

    assert roughness(light) < 0.05 * roughness(image)
    assert light.mean() > 0.1 * image.mean()


def test_more_lambda_leaves_less_light():
    image = scene()
    means = [float((image - separate(image, lam)).mean()) for lam in (50, 500, 25000)]
    assert means[0] > means[1] > means[2] > 0


def test_the_rule_excess_takes_nothing_off_in_sum():
    image = scene()
    light = image - separate(image, 500, passes=1)
    assert 0 < light.mean() < image.mean()
    assert not torch.equal(separate(image, passes=1), separate(image, passes=3))


def test_demo_labels_and_gain():
    image = scene()
    demo = LabelSettings(labels="demo")
    light, content = light_labels(image, demo)
    assert torch.equal(content, light_labels(image, LabelSettings(lam=50))[1])
    assert torch.equal(light, light_labels(image, LabelSettings(lam=25000))[0])
    double, _ = light_labels(image, LabelSettings(labels="demo", save_gain=2))
    torch.testing.assert_close(double, (2 * light).clamp(max=1))


def test_titles_tell_the_parameters_apart():
    made = [
        LabelSettings(),
        LabelSettings(lam=50),
        LabelSettings(passes=2),
        LabelSettings(rule="published"),
        LabelSettings(labels="demo"),
        LabelSettings(save_gain=2),
    ]
    assert made[0].title == "light-lam500-passes3-excess"
    assert len({one.title for one in made}) == len(made)


@pytest.mark.parametrize("value", [0.0, 1.0])
def test_uniform_images_have_finite_labels(value):
    light, content = light_labels(torch.full((2, 3, 16, 16), value))
    assert bool(light.isfinite().all())
    torch.testing.assert_close(light + content, torch.full((2, 3, 16, 16), value))
