"""Weights and inputs that are made from formulas, and short descriptions of arrays."""

import json
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import torch
from torch import nn

from nat2024.interfaces import NeuralEnhancer
from nat2024.registry import create_enhancer
from nat2024.zoo import read_checkpoint

_NORMS = (nn.modules.batchnorm._BatchNorm, nn.LayerNorm, nn.InstanceNorm2d)


def make_procedural_state(model: nn.Module, gain: float = 1.0) -> dict[str, torch.Tensor]:
    """The parity kit's procedural weights for a network: every tensor drawn from its own name."""
    norms = {f"{name}.weight" for name, part in model.named_modules() if isinstance(part, _NORMS)}
    state = {}
    for key, value in model.state_dict().items():
        if not value.is_floating_point():
            state[key] = value.clone()
            continue
        seed = zlib.crc32(key.encode())
        z = np.random.Generator(np.random.PCG64(seed)).standard_normal(tuple(value.shape))
        if key.endswith("running_mean"):
            z = 0.1 * z
        elif key.endswith("running_var"):
            z = 1 + 0.1 * np.abs(z)
        elif value.ndim >= 2:
            z = gain * z / np.sqrt(np.prod(value.shape[1:]))
        else:
            z = 1 + 0.1 * z if key in norms else 0.05 * z
        state[key] = torch.from_numpy(np.asarray(z, dtype=np.float32))
    return state


def make_procedural_batch(name: str, shape: tuple[int, ...]) -> torch.Tensor:
    """A float32 batch in 0..1, mostly dark, drawn from `name`."""
    random = np.random.Generator(np.random.PCG64(zlib.crc32(name.encode())))
    return torch.from_numpy((random.random(shape) ** 2).astype(np.float32))


def describe_array(array: Any, samples: int = 24) -> dict[str, Any]:
    """Shape, mean, standard deviation and evenly spread values, as stored in tests/data."""
    values = np.asarray(array, dtype=np.float64)
    places = np.linspace(0, values.size - 1, samples).astype(int)
    return {
        "shape": list(values.shape),
        "mean": round(float(values.mean()), 8),
        "std": round(float(values.std()), 8),
        "samples": [round(float(value), 7) for value in values.reshape(-1)[places]],
    }


@pytest.fixture(scope="session")
def procedural_state() -> Callable[..., dict[str, torch.Tensor]]:
    return make_procedural_state


@pytest.fixture(scope="session")
def procedural_network() -> Callable[[nn.Module], nn.Module]:
    """Gives a network procedural weights, in evaluation mode."""

    def fill(network: nn.Module) -> nn.Module:
        network.load_state_dict(make_procedural_state(network))
        return network.eval()

    return fill


@pytest.fixture(scope="session")
def procedural_enhancer(
    procedural_network: Callable[[nn.Module], nn.Module],
) -> Callable[..., NeuralEnhancer]:
    """Creates an enhancer by name and options, with procedural weights."""

    def create(name: str, **options: Any) -> NeuralEnhancer:
        enhancer = create_enhancer(name, weights=False, **options)
        assert isinstance(enhancer, NeuralEnhancer)
        procedural_network(enhancer.model)
        return enhancer

    return create


@pytest.fixture(scope="session")
def train_a_little() -> Callable[..., list[float]]:
    """Trains a network towards an even image in a few steps; gives their losses."""

    def train(
        network: nn.Module, batch: torch.Tensor, *, rate: float, steps: int = 8
    ) -> list[float]:
        optimiser = torch.optim.Adam(network.parameters(), lr=rate)
        losses = []
        for _ in range(steps):
            answer = network(batch)
            enhanced = answer[0] if isinstance(answer, tuple) else answer
            loss = nn.functional.mse_loss(enhanced, torch.full_like(batch, 0.6))
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            losses.append(loss.item())
        return losses

    return train


@pytest.fixture(scope="session")
def procedural_batch() -> Callable[[str, tuple[int, ...]], torch.Tensor]:
    return make_procedural_batch


@pytest.fixture(scope="session")
def check_official_state(kit: Path) -> Callable[[NeuralEnhancer], None]:
    """Holds an enhancer's state dict against the checkpoint it came from and the official keys."""

    def check(enhancer: NeuralEnhancer) -> None:
        assert enhancer.weights is not None
        assert enhancer.weights.path is not None
        state = read_checkpoint(enhancer.weights.path)
        loaded = enhancer.model.state_dict()
        assert loaded.keys() >= state.keys()
        assert all(torch.equal(loaded[key], state[key]) for key in state)
        keys = json.loads((kit / "keys" / f"{enhancer.name}.json").read_text())
        shapes = {entry["key"]: tuple(entry["shape"]) for entry in keys}
        assert {key: tuple(value.shape) for key, value in loaded.items()} == shapes

    return check


@pytest.fixture(scope="session")
def describe() -> Callable[..., dict[str, Any]]:
    return describe_array


@pytest.fixture(scope="session")
def kit(shared: Path) -> Path:
    """The parity kit of enhancers: official keys, checkpoints, inputs, outputs."""
    return shared / "parity" / "enhancers"


@pytest.fixture(scope="session")
def kit_batch(kit: Path) -> Callable[[str], torch.Tensor]:
    """Reads an input of the parity kit as float32 (1, 3, H, W), RGB."""

    def read(name: str) -> torch.Tensor:
        image = cv2.imread(str(kit / "inputs" / f"{name}.png"))
        assert image is not None, name
        pixels = image[..., ::-1].transpose(2, 0, 1)[None].astype(np.float32)
        return torch.from_numpy(pixels / np.float32(255))

    return read
