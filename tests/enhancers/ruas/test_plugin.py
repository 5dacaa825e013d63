"""What is RUAS's own for users: its variants and the maps of its stages."""

import pytest
import torch

from nat2024.errors import InvalidOption
from nat2024.registry import create_enhancer


@pytest.fixture(scope="module")
def enhancer(procedural_enhancer):
    return procedural_enhancer("ruas")


@pytest.mark.parametrize(
    ("variant", "answer"), [("upe", "u3"), ("dark", "u3"), ("lol", "denoised")]
)
def test_the_variant_chooses_the_answer(procedural_enhancer, procedural_batch, variant, answer):
    batch = procedural_batch("ruas.variant", (1, 3, 30, 40))
    enhancer = procedural_enhancer("ruas", variant=variant, clamp=False)
    expected = enhancer.maps(batch)[answer]
    torch.testing.assert_close(enhancer.enhance_batch(batch), expected, rtol=1e-5, atol=1e-5)
    with pytest.raises(InvalidOption, match="variant"):
        create_enhancer("ruas", weights=False, variant="lime")


def test_maps_hold_all_stages(enhancer, procedural_batch):
    maps = enhancer.maps(procedural_batch("ruas.maps", (2, 3, 33, 50)))
    names = {f"{kind}{stage}" for kind in "ut" for stage in (1, 2, 3)}
    assert maps.keys() == names | {"denoised"}
    assert {tuple(value.shape) for value in maps.values()} == {(2, 3, 33, 50)}
