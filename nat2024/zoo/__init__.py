"""Weights: which file a network gets, and how checkpoints are read without running their code."""

from nat2024.zoo.checkpoints import (
    StateDict,
    check_finite,
    entries_of,
    fit_state_dict,
    read_checkpoint,
)
from nat2024.zoo.recognition import recognise
from nat2024.zoo.weights import (
    Weights,
    WeightsSpec,
    bundled_path,
    find_bundled,
    find_registered,
    find_weights,
    preset_weights,
    sha256_of,
)

__all__ = [
    "StateDict",
    "Weights",
    "WeightsSpec",
    "bundled_path",
    "check_finite",
    "entries_of",
    "find_bundled",
    "find_registered",
    "find_weights",
    "fit_state_dict",
    "preset_weights",
    "read_checkpoint",
    "recognise",
    "sha256_of",
]
