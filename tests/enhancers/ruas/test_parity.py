"""Equality with the official code: its three checkpoints, its outputs, its maps."""

import json

import numpy as np
import pytest

from nat2024.errors import WeightsMismatch
from nat2024.registry import create_enhancer
from nat2024.zoo import read_checkpoint

pytestmark = pytest.mark.shared
VARIANTS = ("upe", "lol", "dark")
CASES = ("dt36_127x127", "dt76_101x77", "dt92_96x160")


@pytest.fixture(scope="module")
def official(kit):
    return {
        variant: create_enhancer(
            "ruas", weights=kit / "checkpoints" / f"ruas_{variant}.pt", variant=variant, clamp=False
        )
        for variant in VARIANTS
    }


def test_every_case_of_the_kit_is_tried(kit):
    stored = {(path.parent.name, path.stem) for path in (kit / "outputs").glob("ruas_*/*.npz")}
    assert stored == {(f"ruas_{variant}", case) for variant in VARIANTS for case in CASES}


@pytest.mark.parametrize("variant", VARIANTS)
def test_official_state_dict_loads_unchanged(kit, official, variant, check_official_state):
    assert official[variant].weights.known_as == f"{variant}.pt"
    state = read_checkpoint(kit / "checkpoints" / f"ruas_{variant}.pt")
    assert {value.device.type for value in state.values()} == {"cpu"}
    check_official_state(official[variant])


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("case", CASES)
def test_outputs_equal_the_official_ones(kit, kit_batch, official, variant, case):
    batch = kit_batch(case)
    found = official[variant].maps(batch)
    with np.load(kit / "outputs" / f"ruas_{variant}" / f"{case}.npz") as stored:
        expected = dict(stored)
    for name, value in expected.items():
        actual = found[name][0].numpy()
        np.testing.assert_allclose(actual, value, rtol=0, atol=1e-5, err_msg=name)
    index = json.loads((kit / "outputs" / "index_torch.json").read_text())
    answer = index[f"ruas_{variant}"][case]["official_output"]
    enhanced = official[variant].enhance_batch(batch)[0].numpy()
    np.testing.assert_allclose(enhanced, expected[answer], rtol=0, atol=1e-5)


@pytest.mark.parametrize(("file", "variant"), [("lol", "upe"), ("upe", "lol"), ("dark", "upe")])
def test_a_published_file_of_another_variant_is_refused(kit, file, variant):
    path = kit / "checkpoints" / f"ruas_{file}.pt"
    with pytest.raises(WeightsMismatch, match=rf"this is {file}.pt.*; pass variant={file}"):
        create_enhancer("ruas", weights=path, variant=variant)
