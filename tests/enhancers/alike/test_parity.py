"""Equality of SCT, EnlightenGAN and LLVE with the official code, by weights from formulas."""

import importlib
import json
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
import torch

from nat2024.registry import create_enhancer

pytestmark = pytest.mark.shared
GAINS = {"gain1": 1.0, "gain_sqrt2": float(np.float32(2**0.5))}
BOTH = [(gain, case) for gain in GAINS for case in ("dt76_101x77", "dt92_96x160")]


def prefixed(state):
    return {f"module.{key}": value for key, value in state.items()}


@dataclass(frozen=True)
class Official:
    """What the official code was run on, and the forms of its files and answers."""

    network: str
    cases: list[tuple[str, str]]
    file: Callable = lambda state: state
    answers: Callable = dict
    order: str = "rgb"
    wider: dict[str, float] | None = None


OFFICIAL = {
    "sct": Official(
        "SCTNet",
        [
            ("gain1", "dt12_287x287"),
            ("gain1", "dt36_127x127"),
            ("gain1", "dt76_101x77"),
            ("gain1", "p11_256x256"),
            ("gain_sqrt2", "dt76_101x77"),
        ],
        # with the larger gain tanh meets values so large that the plain layers differ by 1e-5
        wider={"gain_sqrt2": 5e-5},
    ),
    "enlightengan": Official(
        "EnlightenGANNet",
        BOTH,
        file=prefixed,
        answers=lambda stored: {**stored, "enhanced": (stored["output"] + 1) / 2},
        # the network's own scale is twice as long
        wider={"output": 2e-5, "latent": 2e-5},
    ),
    "llve": Official(
        "LLVENet",
        BOTH,
        file=lambda state: {"state_dict": prefixed(state)},
        answers=lambda stored: {"enhanced": stored["out"]},
        order="bgr",
    ),
}
CASES = [(name, *case) for name, official in OFFICIAL.items() for case in official.cases]


def build(name):
    model = importlib.import_module(f"nat2024_enhancers.{name}.model")
    return getattr(model, OFFICIAL[name].network)()


@pytest.fixture(scope="module")
def create(procedural_state, tmp_path_factory):
    """Creates an enhancer from a file in its official form, once for each gain."""
    created = {}

    def create(name, gain):
        if (name, gain) not in created:
            path = tmp_path_factory.mktemp(name) / f"{gain}.pth"
            torch.save(OFFICIAL[name].file(procedural_state(build(name), GAINS[gain])), path)
            created[name, gain] = create_enhancer(name, weights=path, clamp=False)
        return created[name, gain]

    return create


@pytest.mark.parametrize("name", OFFICIAL)
def test_every_case_of_the_kit_is_tried(kit, name):
    stored = {
        (path.parent.name.removeprefix(f"{name}_procedural_"), path.stem.removesuffix("_bgr"))
        for path in (kit / "outputs").glob(f"{name}_procedural_*/*.npz")
    }
    assert stored == set(OFFICIAL[name].cases)


@pytest.mark.parametrize("name", OFFICIAL)
def test_names_and_shapes_are_the_official_ones(kit, name):
    keys = json.loads((kit / "keys" / f"{name}.json").read_text())
    official = {entry["key"]: (tuple(entry["shape"]), entry["dtype"]) for entry in keys}
    state = build(name).state_dict()
    ours = {k: (tuple(v.shape), str(v.dtype).removeprefix("torch.")) for k, v in state.items()}
    assert ours == official


@pytest.mark.parametrize(("name", "gain", "case"), CASES)
def test_outputs_equal_the_official_ones(kit, kit_batch, create, name, gain, case):
    official, enhancer = OFFICIAL[name], create(name, gain)
    batch, file = kit_batch(case), case
    if official.order == "bgr":
        batch, file = batch.flip(1), f"{case}_bgr"
    found = {**enhancer.maps(batch), "enhanced": enhancer.enhance_batch(batch)}
    with np.load(kit / "outputs" / f"{name}_procedural_{gain}" / f"{file}.npz") as stored:
        expected = official.answers(stored)
    assert expected
    assert expected.keys() <= found.keys()
    wider = official.wider or {}
    for key, value in expected.items():
        tolerance = wider.get(key, wider.get(gain, 1e-5))
        actual = found[key][0].numpy()
        np.testing.assert_allclose(actual, value, rtol=0, atol=tolerance, err_msg=key)
