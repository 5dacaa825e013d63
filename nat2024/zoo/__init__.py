"""Weights: which file a network gets, and how checkpoints are read without running their code."""

from nat2024.zoo.checkpoints import StateDict, fit_state_dict, read_checkpoint
from nat2024.zoo.weights import Weights, WeightsSpec, find_weights, sha256_of

__all__ = [
    "StateDict",
    "Weights",
    "WeightsSpec",
    "find_weights",
    "fit_state_dict",
    "read_checkpoint",
    "sha256_of",
]
