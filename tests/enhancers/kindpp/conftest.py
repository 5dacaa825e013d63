"""Weights of KinD++ as TensorFlow variables: the official ones where they are, else a formula's."""

import zlib

import numpy as np
import pytest

from nat2024.registry import create_enhancer
from nat2024_enhancers.kindpp.convert import from_tensorflow
from nat2024_enhancers.kindpp.model import KindPlusPlusNet

LAST = {"running_mean": "moving_mean", "running_var": "moving_variance"}


def tensorflow_names():
    """Names and shapes of all variables, from the entries of the network."""
    found = {}
    for key, value in KindPlusPlusNet().state_dict().items():
        *scopes, last = key.split(".")
        if last == "num_batches_tracked":
            continue
        if scopes[-1] == "batch_normalization":
            last = LAST.get(last, {"weight": "gamma", "bias": "beta"}.get(last))
        elif scopes[-1] == "conv":
            last = "kernel"
        else:
            last = {"weight": "weights", "bias": "biases"}[last]
        shape = tuple(value.shape)
        found["/".join([*scopes, last])] = (*shape[2:], *shape[1::-1]) if len(shape) == 4 else shape
    return found


def make_variable(name, shape):
    seed = zlib.crc32(name.encode())
    z = np.random.Generator(np.random.PCG64(seed)).standard_normal(shape)
    if name.endswith("moving_mean"):
        z = 0.1 * z
    elif name.endswith("moving_variance"):
        z = 1 + 0.1 * np.abs(z)
    elif z.ndim >= 2:
        z = np.float32(np.sqrt(2)) * z / np.sqrt(np.prod(shape[:-1]))
    else:
        z = 1 + 0.1 * z if name.endswith("gamma") else 0.05 * z
    return z.astype(np.float32)


@pytest.fixture(scope="session")
def variables():
    return {name: make_variable(name, shape) for name, shape in tensorflow_names().items()}


@pytest.fixture(scope="session")
def weights(variables, tmp_path_factory):
    """All of them in one .npz file."""
    path = tmp_path_factory.mktemp("kindpp") / "procedural.npz"
    np.savez(path, **variables)
    return path


@pytest.fixture(scope="session")
def state(variables):
    return from_tensorflow(variables)


@pytest.fixture(scope="session")
def enhancer(weights):
    return create_enhancer("kindpp", weights=weights, clamp=False)
