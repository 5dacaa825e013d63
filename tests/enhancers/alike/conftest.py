"""SCT, EnlightenGAN, LLVE and RUAS in one table: what each does its own way."""

import importlib
from dataclasses import dataclass, field

import numpy as np
import pytest
import torch

from nat2024.registry import create_enhancer


@dataclass(frozen=True)
class Row:
    """One enhancer.

    Attributes:
        name: registered name.
        network: class of its network.
        parameters: how many numbers it learns.
        official: name of the published file.
        sees_bgr: whether images reach the network in BGR.
        unbounded: options with which its raw output leaves 0..1.
        trained: options of the network with which all of it is trained.
        rate: a learning rate at which three steps help.
        band: rows of an image in one band, small enough for several bands.
    """

    name: str
    network: str
    parameters: int
    official: str
    sees_bgr: bool = False
    unbounded: dict = field(default_factory=dict)
    trained: dict = field(default_factory=dict)
    rate: float = 1e-3
    band: int = 8

    def build(self, **options):
        """A fresh network."""
        model = importlib.import_module(f"nat2024_enhancers.{self.name}.model")
        return getattr(model, self.network)(**options)

    def order(self, image):
        """The image in the order in which the network sees it, and back."""
        return np.ascontiguousarray(image[..., ::-1] if self.sees_bgr else image)


ROWS = [
    Row("sct", "SCTNet", 7_913_774, "model_latest.pth", rate=1e-4),
    Row("enlightengan", "EnlightenGANNet", 8_636_675, "200_net_G_A.pth"),
    Row("llve", "LLVENet", 4_316_259, "checkpoint.pth", sees_bgr=True),
    Row(
        "ruas",
        "RUASNet",
        3_438,
        "upe.pt",
        unbounded={"variant": "lol"},
        trained={"denoise": True},
        rate=1e-2,
        band=6,
    ),
]


@pytest.fixture(scope="module", params=ROWS, ids=lambda row: row.name)
def row(request):
    return request.param


@pytest.fixture(scope="module")
def state(row, procedural_state):
    return procedural_state(row.build())


@pytest.fixture(scope="module")
def weights(state, tmp_path_factory):
    path = tmp_path_factory.mktemp("weights") / "procedural.pth"
    torch.save(state, path)
    return path


@pytest.fixture(scope="module")
def enhancer(row, weights):
    return create_enhancer(row.name, weights=weights)
