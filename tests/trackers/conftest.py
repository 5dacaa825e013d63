"""Procedural weights, generated clips and stand-in enhancers for the trackers' tests."""

import json
import math
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

DATA = Path(__file__).resolve().parents[1] / "data"


def make_procedural_state(recipe: dict[str, Any]) -> dict[str, Any]:
    """A state dict from a recipe: every number follows from the salt and its key.

    `values` are taken as they are, `same_as` takes those of another key; anything but float32 is
    zero; all else is `offset + scale * g` with g standard normal from PCG64 seeded by the crc32 of
    salt + key, absolute where `abs`.
    """
    import torch

    state = {}
    for key, entry in recipe["tensors"].items():
        shape = entry["shape"]
        source = entry.get("same_as", key)
        entry = recipe["tensors"][source]
        if entry["dtype"] != "float32":
            state[key] = torch.zeros(shape, dtype=getattr(torch, entry["dtype"]))
            continue
        if "values" in entry:
            values = np.array(entry["values"], dtype=np.float32).reshape(shape)
        else:
            seed = zlib.crc32((recipe["salt"] + source).encode())
            normal = np.random.Generator(np.random.PCG64(seed)).standard_normal(shape)
            normal = np.abs(normal) if entry.get("abs") else normal
            values = (entry["offset"] + entry["scale"] * normal).astype(np.float32)
        state[key] = torch.from_numpy(values)
    return state


def make_recipe(
    network: Any, salt: str, special: Mapping[str, Mapping[str, Any]]
) -> dict[str, Any]:
    """A recipe for any network: entries follow from kind and shape, `special` overrides some.

    Weights of layers keep the spread of their input, norms and their statistics are near 1 and 0,
    biases are small. What a first layer and a last one need is `special`, by key.
    """
    kinds = {
        "running_var": {"offset": 1.0, "scale": 0.1, "abs": True},
        "running_mean": {"offset": 0.0, "scale": 0.1},
        "bias": {"offset": 0.0, "scale": 0.05},
        "in_proj_bias": {"offset": 0.0, "scale": 0.05},
        "weight": {"offset": 1.0, "scale": 0.1},
    }
    tensors = {}
    for key, value in network.state_dict().items():
        entry = {"shape": list(value.shape), "dtype": str(value.dtype).removeprefix("torch.")}
        if value.ndim > 1:
            entry |= {"offset": 0.0, "scale": 1 / math.sqrt(math.prod(value.shape[1:]))}
        else:
            entry |= kinds.get(key.rpartition(".")[2], {"offset": 0.5, "scale": 0.1})
        tensors[key] = entry | dict(special.get(key, {}))
    return {"salt": salt, "tensors": tensors}


def make_crops(count: int, seed: int = 3) -> tuple[Any, Any]:
    """Dim template and search crops, float32 (count, 3, 127, 127) and (count, 3, 287, 287)."""
    import torch

    random = np.random.Generator(np.random.PCG64(seed))
    coarse = random.integers(4, 60, (count, 3, 41, 41)).repeat(7, axis=2).repeat(7, axis=3)
    search = torch.from_numpy(coarse.astype(np.float32))
    return search[..., 80:207, 80:207].clone(), search


def read_recipe() -> dict[str, Any]:
    return json.loads((DATA / "siamrpn_alex_recipe.json").read_text())


def make_clip(count: int = 8, seed: int = 5) -> tuple[list[np.ndarray], np.ndarray]:
    """A blocky dim rectangle that drifts over uneven light: uint8 (180, 240, 3) BGR, and its box.

    As dim as the night frames that the procedural weights are calibrated for: others saturate.
    """
    random = np.random.Generator(np.random.PCG64(seed))
    rows, columns = np.mgrid[0:180, 0:240]
    light = 14 + 8 * (columns // 40 % 2) + rows // 12 + columns // 30
    ground = light[..., None] + random.integers(0, 4, (180, 240, 3))
    texture = random.integers(24, 56, (9, 6, 3)).repeat(6, axis=0).repeat(5, axis=1)
    frames = []
    for index in range(count):
        frame = ground.astype(np.uint8)
        x, y = 100 + 4 * index, 60 - 2 * index
        frame[y : y + 54, x : x + 30] = texture
        frames.append(frame)
    return frames, np.array([100.0, 60.0, 30.0, 54.0])


class Gamma:
    """The simplest enhancer: a power on 0..1; remembers what it was given."""

    def __init__(self, power: float = 0.5) -> None:
        self.power = power
        self.batches: list[Any] = []

    def enhance_batch(self, batch: Any) -> Any:
        self.batches.append(batch.clone())
        return batch**self.power


@pytest.fixture(scope="session")
def procedural_state() -> Callable[[dict[str, Any]], dict[str, Any]]:
    return make_procedural_state


@pytest.fixture(scope="session")
def recipe_of() -> Callable[..., dict[str, Any]]:
    return make_recipe


@pytest.fixture(scope="session")
def crops() -> Callable[..., tuple[Any, Any]]:
    return make_crops


@pytest.fixture(scope="session")
def alex_state() -> dict[str, Any]:
    """Weights of SiamRPN++ (AlexNet) that follow from a formula."""
    return make_procedural_state(read_recipe())


@pytest.fixture
def clip() -> tuple[list[np.ndarray], np.ndarray]:
    return make_clip()


@pytest.fixture(scope="session")
def gamma() -> Callable[..., Gamma]:
    return Gamma
