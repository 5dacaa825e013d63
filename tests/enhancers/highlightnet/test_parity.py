"""Equality with the official code: its checkpoint, its images, its maps, what it leaves untrained.

The suggested limit is 1e-4, since the brightness is a divisor; 1e-5 holds here.
"""

import numpy as np
import pytest

from nat2024.images import batch_to_image
from nat2024.registry import create_enhancer

pytestmark = pytest.mark.shared
CASES = {
    "p11_256x256": {"enhanced", "r", "level"},
    "dt36_127x127": {"enhanced", "r", "level"},
    "dt76_101x77": {"enhanced", "r", "level", "t"},
    "dt92_96x160": {"enhanced", "r", "level"},
}


def create(kit, **options):
    path = kit / "checkpoints" / "highlightnet_epoch99.pth"
    return create_enhancer("highlightnet", weights=path, **options)


def test_every_case_of_the_kit_is_tried(kit):
    stored = (kit / "outputs" / "highlightnet_epoch99").glob("*.npz")
    assert {path.stem for path in stored} == set(CASES)


def test_official_state_dict_loads_unchanged(kit, check_official_state):
    enhancer = create(kit)
    assert enhancer.weights.known_as == "Epoch99.pth"
    check_official_state(enhancer)


@pytest.mark.parametrize("case", CASES)
def test_outputs_equal_the_official_ones(kit, kit_batch, case):
    enhancer = create(kit, clamp=False)
    batch = kit_batch(case)
    maps = {**enhancer.maps(batch), "enhanced": enhancer.enhance_batch(batch)}
    with np.load(kit / "outputs" / "highlightnet_epoch99" / f"{case}.npz") as stored:
        assert set(stored) == CASES[case]
        for key, expected in stored.items():
            actual = maps[key][0].numpy()
            np.testing.assert_allclose(actual, expected, rtol=0, atol=1e-5, err_msg=key)


def test_images_are_the_rounded_and_limited_official_ones(kit, kit_batch):
    image = batch_to_image(kit_batch("p11_256x256"))
    with np.load(kit / "outputs" / "highlightnet_epoch99" / "p11_256x256.npz") as stored:
        assert stored["enhanced"].min() < 0
        assert stored["enhanced"].max() > 1
        expected = stored["enhanced"].clip(0, 1).transpose(1, 2, 0) * 255
    assert np.abs(create(kit).enhance(image) - expected).max() <= 0.5 + 0.01
