"""The yardsticks are what they claim to be: equal to the official outputs."""

import importlib
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np
import pytest
import torch

from nat2024.registry import create_enhancer
from nat2024.zoo import read_checkpoint

slow = pytest.mark.slow  # yardsticks of benchmarks, not the product
GAINS = {"gain1": 1.0, "gain_sqrt2": float(np.float32(2**0.5))}


@dataclass(frozen=True)
class Case:
    """One output of the official code.

    Attributes:
        folder: of the output in the kit; the enhancer's name is its first word.
        name: of the output: the input's, with the order of channels and more behind.
        checkpoint: of the kit; empty for weights from formulas.
        options: of the yardstick.
        answer: from what is stored to what an enhancer gives.
    """

    folder: str
    name: str
    checkpoint: str = ""
    options: dict[str, Any] = field(default_factory=dict)
    answer: Callable[[Any], Any] = lambda stored: stored["enhanced"]

    @property
    def enhancer(self) -> str:
        return self.folder.split("_")[0]

    def __str__(self) -> str:
        return "-".join([self.folder, self.name, *map(str, self.options.values())])


def cases_of_dcepp():
    for name, scale in (
        ("dt12_287x287_pad_s12", 12),
        ("dt36_127x127_pad_s12", 12),
        ("dt76_101x77_pad_s12", 12),
        ("dt76_101x77_s1", 1),
    ):
        yield Case("dcepp_epoch99", name, "dcepp_epoch99.pth", {"scale": scale})


def cases_of_ruas():
    for variant, name in (("upe", "dt36_127x127"), ("lol", "dt76_101x77"), ("dark", "dt92_96x160")):
        file = f"ruas_{variant}.pt"
        yield Case(file[:-3], name, file, {"denoise": False}, lambda stored: stored["u3"])
        yield Case(file[:-3], name, file, {"denoise": True}, lambda stored: stored["denoised"])


def cases_of_formulas():
    for name in ("dt36_127x127", "dt76_101x77"):
        yield Case("sct_procedural_gain1", name)
    for gain in GAINS:
        yield Case(
            f"enlightengan_procedural_{gain}",
            "dt76_101x77",
            answer=lambda stored: (stored["output"] + 1) / 2,
        )
        yield Case(
            f"llve_procedural_{gain}", "dt76_101x77_bgr", answer=lambda stored: stored["out"]
        )


LDENHANCER = [
    Case("ldenhancer_epoch66", "dt36_127x127_rgb", "ldenhancer_model.pth"),
    Case("ldenhancer_epoch66", "dt36_127x127_bgr", "ldenhancer_model.pth"),
    Case("ldenhancer_epoch66", "dt76_101x77_rgb", "ldenhancer_model.pth"),
    Case("ldenhancer_epoch99", "dt36_127x127_rgb", "ldenhancer_epoch99.pth"),
]
OTHERS = [
    *cases_of_dcepp(),
    Case("darklighter_epoch193", "dt36_127x127", "darklighter_epoch193.pth"),
    Case("darklighter_epoch193", "dt76_101x77", "darklighter_epoch193.pth"),
    Case("darklighter_epoch199", "dt76_101x77", "darklighter_epoch199.pth"),
    Case("highlightnet_epoch99", "dt36_127x127", "highlightnet_epoch99.pth"),
    Case("highlightnet_epoch99", "dt76_101x77", "highlightnet_epoch99.pth"),
    Case("highlightnet_epoch99", "p11_256x256", "highlightnet_epoch99.pth"),
    *cases_of_ruas(),
    *cases_of_formulas(),
]
CASES = [*LDENHANCER, *(pytest.param(case, marks=slow) for case in OTHERS)]
NAMES = ["ldenhancer", *(pytest.param(n, marks=slow) for n in {c.enhancer: None for c in OTHERS})]


def build(enhancer, **options):
    return importlib.import_module(f"peers.{enhancer}").build(**options)


def read_batch(kit, name):
    """The input of an output, in the order of channels that its name tells."""
    image = cv2.imread(str(kit / "inputs" / f"{'_'.join(name.split('_')[:2])}.png"))
    ordered = image if name.endswith("_bgr") else image[..., ::-1]
    return torch.from_numpy(ordered.transpose(2, 0, 1)[None].astype(np.float32) / np.float32(255))


@pytest.mark.shared
@pytest.mark.parametrize("case", CASES, ids=str)
def test_the_yardstick_gives_the_official_outputs(shared, procedural_state, case):
    kit = shared / "parity" / "enhancers"
    network = build(case.enhancer, **case.options)
    assert not network.training
    if case.checkpoint:
        state = read_checkpoint(kit / "checkpoints" / case.checkpoint)
    else:
        state = procedural_state(network, GAINS[case.folder.partition("_procedural_")[2]])
    # the official files of LDEnhancer do not hold every key
    network.load_state_dict(state, strict=case.enhancer != "ldenhancer")
    with torch.no_grad():
        actual = network(read_batch(kit, case.name))[0].numpy()
    with np.load(kit / "outputs" / case.folder / f"{case.name}.npz") as stored:
        np.testing.assert_allclose(actual, case.answer(stored), rtol=0, atol=1e-5)


@pytest.mark.parametrize("enhancer", NAMES)
def test_the_yardstick_has_the_keys_of_the_plugin_network(enhancer):
    ours = create_enhancer(enhancer, weights=False).model.state_dict()
    theirs = build(enhancer).state_dict()
    assert {k: v.shape for k, v in theirs.items()} == {k: v.shape for k, v in ours.items()}
