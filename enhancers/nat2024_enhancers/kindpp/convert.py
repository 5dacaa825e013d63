"""Weights of KinD++ from the forms in which they are published.

The authors publish one TensorFlow checkpoint for each of the three networks. A variable
`DecomNet/g_conv1_1/weights` is the entry `DecomNet.g_conv1_1.weight` here: slashes become dots,
and the last word becomes PyTorch's (`weights`, `kernel` and `gamma`: `weight`; `biases` and `beta`:
`bias`; `moving_mean` and `moving_variance`: `running_mean` and `running_var`). Kernels change from
(height, width, in, out), transposed ones from (height, width, out, in), by the one transposition
(3, 2, 0, 1).
"""

import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from nat2024.errors import WeightsMismatch
from nat2024.zoo import StateDict, read_checkpoint
from nat2024.zoo.tensorflow import read_tensorflow

_WORDS = {
    "weights": "weight",
    "kernel": "weight",
    "gamma": "weight",
    "biases": "bias",
    "beta": "bias",
    "moving_mean": "running_mean",
    "moving_variance": "running_var",
}
_NETWORKS = {
    "DecomNet": "decomposition (decom_model)",
    "Denoise_Net": "restoration (restoration_model)",
    "I_enhance_Net": "illumination adjustment (illu_model)",
}
_LARGEST_ARRAY = 1 << 28  # bytes; the largest kernel has 5 MB


def read_kindpp(path: Path) -> StateDict:
    """Read the state dict of all three networks.

    Args:
        path: a folder with the three TensorFlow checkpoints in it or in folders of it, the
            `.index` file of a checkpoint that has all, a `.npz` file of arrays under the names of
            the TensorFlow variables, or a safetensors or PyTorch file of this network.

    Raises:
        WeightsMissing: no such file, or one that belongs to it is absent.
        WeightsMismatch: unreadable, unsafe, or without one of the networks; names what is missing.
    """
    if path.is_dir():
        state = from_tensorflow(_read_folder(path))
    elif path.suffix == ".index":
        state = from_tensorflow(read_tensorflow(path))
    elif path.suffix == ".npz":
        state = from_tensorflow(_read_npz(path))
    else:
        state = read_checkpoint(path)
    _check_networks(state, path)
    return state


def from_tensorflow(arrays: Mapping[str, npt.NDArray[Any]]) -> StateDict:
    """The state dict of the variables of these networks; those of optimizers are left out."""
    import torch

    state: StateDict = {}
    for name, array in arrays.items():
        *scopes, last = name.removesuffix(":0").split("/")
        if last not in _WORDS or not scopes or scopes[0] not in _NETWORKS:
            continue
        if array.ndim == 4:
            array = array.transpose(3, 2, 0, 1)
        values = np.ascontiguousarray(array, dtype=np.float32)
        state[".".join([*scopes, _WORDS[last]])] = torch.from_numpy(values.copy())
    return state


def _read_folder(folder: Path) -> dict[str, npt.NDArray[Any]]:
    arrays: dict[str, npt.NDArray[Any]] = {}
    sources: dict[str, Path] = {}
    for index in sorted(folder.rglob("*.index")):
        for name, array in read_tensorflow(index).items():
            if name in sources and name.split("/")[0] in _NETWORKS:
                if np.array_equal(arrays[name], array):
                    continue
                msg = (
                    f"{folder}: {name} is in {sources[name].name} and, with other numbers, in "
                    f"{index.relative_to(folder)}; keep one checkpoint of each network"
                )
                raise WeightsMismatch(msg)
            arrays[name], sources[name] = array, index.relative_to(folder)
    if not sources:
        msg = f"{folder}: holds no TensorFlow checkpoint (a pair of .index and .data files)"
        raise WeightsMismatch(msg)
    return arrays


def _read_npz(path: Path) -> dict[str, npt.NDArray[Any]]:
    try:
        with zipfile.ZipFile(path) as archive:
            too_large = [i.filename for i in archive.infolist() if i.file_size > _LARGEST_ARRAY]
        if too_large:
            msg = f"{path}: {too_large[0]} is too large for weights of this network"
            raise WeightsMismatch(msg)
        with np.load(path, allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in stored.files}
    except (OSError, EOFError, ValueError, KeyError, zipfile.BadZipFile, MemoryError) as error:
        msg = f"{path}: not a readable .npz file of plain arrays ({error})"
        raise WeightsMismatch(msg) from None
    return {name: array for name, array in arrays.items() if array.dtype.kind == "f"}


def _check_networks(state: StateDict, path: Path) -> None:
    there = {key.split(".")[0] for key in state} & _NETWORKS.keys()
    missing = [text for name, text in _NETWORKS.items() if name not in there]
    if there and missing:
        msg = (
            f"{path}: holds no weights of the network for {' and '.join(missing)}; needed are "
            "all three: put the checkpoint folders of the authors into one folder, and pass it"
        )
        raise WeightsMismatch(msg)
