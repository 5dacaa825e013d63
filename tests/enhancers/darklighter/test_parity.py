"""Equality with the official code: its checkpoints, its images, its maps."""

import numpy as np
import pytest

from nat2024.images import batch_to_image
from nat2024.registry import create_enhancer

pytestmark = pytest.mark.shared
CASES = [
    (193, "p11_256x256"),
    (193, "dt36_127x127"),
    (193, "dt76_101x77"),
    (193, "dt92_96x160"),
    (199, "dt76_101x77"),
]


def create(kit, epoch, **options):
    path = kit / "checkpoints" / f"darklighter_epoch{epoch}.pth"
    return create_enhancer("darklighter", weights=path, **options)


def test_every_case_of_the_kit_is_tried(kit):
    stored = (kit / "outputs").glob("darklighter_*/*.npz")
    assert {(path.parent.name, path.stem) for path in stored} == {
        (f"darklighter_epoch{epoch}", case) for epoch, case in CASES
    }


@pytest.mark.parametrize("epoch", [193, 199])
def test_official_state_dict_loads_unchanged(kit, epoch, check_official_state):
    enhancer = create(kit, epoch)
    assert enhancer.weights.known_as == f"Epoch{epoch}.pth"
    check_official_state(enhancer)


@pytest.mark.parametrize(("epoch", "case"), CASES)
def test_outputs_equal_the_official_ones(kit, kit_batch, epoch, case):
    enhancer = create(kit, epoch, clamp=False)
    batch = kit_batch(case)
    maps = {**enhancer.maps(batch), "enhanced": enhancer.enhance_batch(batch)}
    with np.load(kit / "outputs" / f"darklighter_epoch{epoch}" / f"{case}.npz") as stored:
        assert set(stored) == ({"enhanced", "r", "n"} if case == "dt76_101x77" else {"enhanced"})
        for key, expected in stored.items():
            actual = maps[key][0].numpy()
            np.testing.assert_allclose(actual, expected, rtol=0, atol=1e-5, err_msg=key)


def test_images_are_the_rounded_and_limited_official_ones(kit, kit_batch):
    image = batch_to_image(kit_batch("dt36_127x127"))
    with np.load(kit / "outputs" / "darklighter_epoch193" / "dt36_127x127.npz") as stored:
        assert stored["enhanced"].max() > 3
        expected = stored["enhanced"].clip(0, 1).transpose(1, 2, 0) * 255
    assert np.abs(create(kit, 193).enhance(image) - expected).max() <= 0.5 + 0.01
