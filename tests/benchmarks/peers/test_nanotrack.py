"""The yardstick is what it claims to be: equal to the official outputs."""

import numpy as np
import pytest
import torch
from peers import nanotrack

from nat2024.registry import create_tracker
from nat2024.zoo import read_checkpoint

pytestmark = pytest.mark.slow  # yardsticks of benchmarks, not the product

VARIANTS = ["v1", "v2", "v3"]


@pytest.mark.shared
@pytest.mark.parametrize("variant", VARIANTS)
def test_the_yardstick_gives_the_official_outputs(shared, variant):
    kit = shared / "parity" / "trackers"
    network = nanotrack.build(variant)
    assert not network.training
    network.load_state_dict(read_checkpoint(kit / "nanotrack" / f"nanotrack{variant}.pth"))
    pair = np.load(kit / "net" / f"nanotrack{variant}.npz")
    crops = [
        torch.from_numpy(pair[name].transpose(2, 0, 1)[None].astype(np.float32))
        for name in ("template", "search")
    ]
    with torch.inference_mode():
        maps = network.match(network.embed(crops[0]), crops[1])
    for found, name in zip(maps, ("out_cls", "out_loc"), strict=True):
        expected = pair[name]
        limit = 2e-4 * max(1, np.abs(expected).max())
        np.testing.assert_allclose(found[0].numpy(), expected, rtol=0, atol=limit)


@pytest.mark.parametrize("variant", VARIANTS)
def test_the_yardstick_has_the_keys_of_the_plugin_network(variant):
    ours = create_tracker("nanotrack", weights=False, variant=variant).model.state_dict()
    theirs = nanotrack.build(variant).state_dict()
    assert {k: v.shape for k, v in theirs.items()} == {k: v.shape for k, v in ours.items()}
