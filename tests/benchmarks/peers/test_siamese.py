"""The yardsticks of the Siamese trackers are what they claim to be: equal to official outputs."""

import importlib
import importlib.util
import json
from pathlib import Path

import numpy as np
import pytest
import torch

import nat2024

pytestmark = pytest.mark.slow  # yardsticks of benchmarks, not the product

CONFTEST = Path(__file__).parents[2] / "trackers" / "conftest.py"
PROPOSALS = ("cls1", "cls2", "cls3", "loc", "anchors")
# tracker, name of the official outputs, their order
PEERS = [
    ("siamrpnpp", "siamrpn_alex_dwxcorr", ("cls", "loc")),
    ("siamapn", "siamapn", PROPOSALS),
    ("siamapnpp", "siamapnpp", PROPOSALS),
    ("hift", "hift", ("cls1", "cls2", "loc")),
    ("lpat", "lpat", ("cls2", "cls3", "loc")),
]


@pytest.fixture(scope="module")
def procedural_state():
    spec = importlib.util.spec_from_file_location("tracker_conftest", CONFTEST)
    helpers = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(helpers)
    return helpers.make_procedural_state


def build(name):
    return importlib.import_module(f"peers.{name}").build()


def batch_of(crop):
    return torch.from_numpy(crop.transpose(2, 0, 1)[None].astype(np.float32))


@pytest.mark.shared
@pytest.mark.parametrize(("name", "official", "outputs"), PEERS)
def test_the_yardstick_gives_the_official_outputs(
    shared, procedural_state, name, official, outputs
):
    kit = shared / "parity" / "trackers"
    network = build(name)
    assert not network.training
    recipe = json.loads((kit / "weights" / f"{official}.plain.json").read_text())
    network.load_state_dict(procedural_state(recipe))
    pair = np.load(kit / "net" / f"{official}.plain.npz")
    with torch.no_grad():
        maps = network(batch_of(pair["template"]), batch_of(pair["search"]))
    assert len(maps) == len(outputs)
    for found, output in zip(maps, outputs, strict=True):
        expected = pair[f"out_{output}"]
        limit = 2e-4 * max(1, np.abs(expected).max())
        assert np.abs(found[0].numpy() - expected).max() <= limit, output


@pytest.mark.parametrize("name", [name for name, *_ in PEERS])
def test_the_yardstick_has_the_keys_of_the_tracker(name):
    with torch.device("meta"):
        theirs = build(name).state_dict()
    ours = nat2024.create_tracker(name, weights=False).model.state_dict()
    assert {k: v.shape for k, v in theirs.items()} == {k: v.shape for k, v in ours.items()}
