"""Equality with the official code: its checkpoint, its images, its curve parameters."""

import numpy as np
import pytest

from nat2024.images import batch_to_image
from nat2024.registry import create_enhancer

pytestmark = pytest.mark.shared
CASES = {
    "p11_256x256_pad_s12": {},
    "dt12_287x287_pad_s12": {},
    "dt36_127x127_pad_s12": {},
    "dt36_127x127_crop_s12": {"size_rule": "crop"},
    "dt76_101x77_pad_s12": {},
    "dt92_96x160_pad_s12": {},
    "dt76_101x77_s1": {"scale_factor": 1},
}


def create(kit, **options):
    return create_enhancer("dcepp", weights=kit / "checkpoints" / "dcepp_epoch99.pth", **options)


def test_every_case_of_the_kit_is_tried(kit):
    assert {path.stem for path in (kit / "outputs" / "dcepp_epoch99").glob("*.npz")} == set(CASES)


def test_official_state_dict_loads_unchanged(kit, check_official_state):
    enhancer = create(kit)
    assert enhancer.weights.known_as == "Epoch99.pth"
    check_official_state(enhancer)


@pytest.mark.parametrize("case", CASES)
def test_outputs_equal_the_official_ones(kit, kit_batch, case):
    enhancer = create(kit, clamp=False, **CASES[case])
    batch = kit_batch("_".join(case.split("_")[:2]))
    maps = {**enhancer.maps(batch), "enhanced": enhancer.enhance_batch(batch)}
    with np.load(kit / "outputs" / "dcepp_epoch99" / f"{case}.npz") as stored:
        assert set(stored) == {"enhanced", "x_r"}
        for key, expected in stored.items():
            actual = maps[key][0].numpy()
            step = actual.shape[-1] // expected.shape[-1]  # large ones keep every 12th pixel
            assert step in (1, 12)
            actual = actual[:, ::step, ::step]
            np.testing.assert_allclose(actual, expected, rtol=0, atol=1e-5, err_msg=key)


def test_images_are_the_rounded_official_ones(kit, kit_batch):
    image = batch_to_image(kit_batch("dt76_101x77"))
    with np.load(kit / "outputs" / "dcepp_epoch99" / "dt76_101x77_pad_s12.npz") as stored:
        expected = stored["enhanced"].clip(0, 1).transpose(1, 2, 0) * 255
    assert np.abs(create(kit).enhance(image) - expected).max() <= 0.5 + 0.01
