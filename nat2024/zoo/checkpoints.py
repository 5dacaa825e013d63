"""Reading checkpoints in every wrapper form that authors publish, without running their code."""

import pickle
import struct
import warnings
import zipfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from nat2024.errors import WeightsMismatch, WeightsMissing, WrongNetwork

if TYPE_CHECKING:
    import torch

StateDict: TypeAlias = "dict[str, torch.Tensor]"

_NUMBERS = {"f4": "f", "f8": "d", "i4": "i", "i8": "q", "b1": "?"}


def read_checkpoint(path: str | Path) -> StateDict:
    """Read the state dict out of a checkpoint file.

    Takes safetensors files and PyTorch files, the latter with `weights_only=True`: a plain state
    dict or one under the key `state_dict`, with or without the prefix `module.` on its keys.

    Raises:
        WeightsMissing: no such file.
        WeightsMismatch: unreadable, unsafe, or no state dict in it.
    """
    path = Path(path)
    if path.is_dir():
        msg = f"{path}: is a folder; name the checkpoint file in it"
        raise WeightsMismatch(msg)
    if not path.is_file():
        msg = f"{path}: no such weights file"
        raise WeightsMissing(msg)
    if not path.stat().st_size:
        msg = f"{path}: is an empty file, no checkpoint"
        raise WeightsMismatch(msg)
    content = _read_safetensors(path) if path.suffix == ".safetensors" else _read_torch(path)
    if isinstance(content, dict) and isinstance(content.get("state_dict"), dict):
        content = content["state_dict"]
    tensors = _tensors_of(content)
    if not tensors:
        msg = f"{path}: holds no state dict (a mapping of names to tensors)"
        raise WeightsMismatch(msg)
    return {key.removeprefix("module."): value for key, value in tensors.items()}


def _tensors_of(content: object) -> StateDict:
    import torch

    if not isinstance(content, dict):
        return {}
    return {str(key): value for key, value in content.items() if isinstance(value, torch.Tensor)}


def _read_safetensors(path: Path) -> Any:
    from safetensors import SafetensorError
    from safetensors.torch import load_file

    try:
        return load_file(path)
    except (SafetensorError, OSError) as error:
        msg = f"{path}: not a readable safetensors file ({error})"
        raise WeightsMismatch(msg) from None


def _read_torch(path: Path) -> Any:
    import torch

    _check_not_packed(path)
    try:
        with torch.serialization.safe_globals(_harmless_globals()), warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of pickle protocols, which say nothing to a user
            return torch.load(path, map_location="cpu", weights_only=True)
    except pickle.UnpicklingError:
        # PyTorch's own message advises to load it unsafely; nobody should read that here
        msg = f"{path}: refused, it holds more than tensors or is no PyTorch checkpoint"
        raise WeightsMismatch(msg) from None
    except Exception as error:  # damaged bytes can fail anywhere inside the unpickler
        # the first sentence; what is no RuntimeError is the unpickler's, such as "101"
        reason = str(error).split("\n", 1)[0].split(". ", 1)[0]
        reason = f" ({reason})" if reason and isinstance(error, RuntimeError) else ""
        msg = f"{path}: not a readable PyTorch checkpoint{reason}"
        raise WeightsMismatch(msg) from None


def _check_not_packed(path: Path) -> None:
    """Raise `WeightsMismatch` where members are packed: PyTorch never packs, but would unpack."""
    try:
        with zipfile.ZipFile(path) as archive:
            packed = [info.filename for info in archive.infolist() if info.compress_type]
    except (OSError, ValueError, NotImplementedError, struct.error, zipfile.BadZipFile):
        return  # of the older form, or damaged, which PyTorch tells
    if packed:
        msg = f"{path}: refused, {packed[0]!a:.80} in it is packed; PyTorch stores tensors plainly"
        raise WeightsMismatch(msg)


class _Kind:
    """Stands for `numpy.dtype` while a checkpoint is read, and knows plain numbers only.

    The real one takes its state from the file: a forged state makes numpy read memory that is not
    its own.
    """

    def __init__(self, name: object, *_: object) -> None:
        self.name = name if name in _NUMBERS else ""

    def __setstate__(self, _: object) -> None:
        """Nothing: byte orders and fields of a file are not believed."""


def _number(kind: object, raw: object = b"") -> float:
    """Stands for `numpy.core.multiarray.scalar`: the number that some bytes hold."""
    if not (isinstance(kind, _Kind) and kind.name and isinstance(raw, bytes)):
        msg = "a number of no plain kind"
        raise pickle.UnpicklingError(msg)
    value: float = struct.unpack(f"<{_NUMBERS[kind.name]}", raw)[0]
    return value


def _harmless_globals() -> list[Any]:
    """Names beside tensors that official files hold: numpy scalars in their optimizer state."""
    modules = ("numpy._core.multiarray", "numpy.core.multiarray")
    scalars = [(_number, f"{module}.scalar") for module in modules]
    return [(_Kind, "numpy.dtype"), *scalars]


def fit_state_dict(
    state: StateDict, expected: StateDict, source: str, optional: Iterable[str] = ()
) -> StateDict:
    """Choose from `state` what a network expects, or say exactly what does not fit.

    Keys that the network lacks are ignored; missing `num_batches_tracked` counters and `optional`
    keys keep the network's own values; where no key matches at all the prefix `features.` is
    tried, as pysot does for bare backbones.

    Raises:
        WrongNetwork: keys are missing or shapes differ; names them.
        WeightsMismatch: an entry holds no numbers that can be copied, or none that are finite.
    """
    if not state.keys() & expected.keys():
        prefixed = {f"features.{key}": value for key, value in state.items()}
        state = prefixed if prefixed.keys() & expected.keys() else state
    may_lack = set(optional)
    missing = [
        key
        for key in expected
        if key not in state and key not in may_lack and not key.endswith(".num_batches_tracked")
    ]
    if missing:
        unknown = [key for key in state if key not in expected]
        msg = (
            f"{source}: not a checkpoint of this network: {len(missing)} of {len(expected)} "
            f"entries are missing ({_some(missing)})"
        )
        if unknown:
            msg += f", {len(unknown)} are unknown ({_some(unknown)})"
        raise _wrong_network(msg, state)
    fitting = {key: state[key] for key in expected if key in state}
    wrong = [
        f"{key} is {tuple(value.shape)}, expected {tuple(expected[key].shape)}"
        for key, value in fitting.items()
        if value.shape != expected[key].shape
    ]
    if wrong:
        msg = f"{source}: not a checkpoint of this network: {_some(wrong)}"
        raise _wrong_network(msg, state)
    _check_kinds(fitting, expected, source)
    check_finite(fitting, source)
    return fitting


def _check_kinds(state: StateDict, expected: StateDict, source: str) -> None:
    """Raise `WeightsMismatch` where copying would fail, or would change the numbers unasked."""
    import torch

    for key, value in state.items():
        plain = value.layout == torch.strided and not (value.is_meta or value.is_quantized)
        if plain and (value.is_floating_point() or not expected[key].is_floating_point()):
            continue
        kind = str(value.dtype if plain or value.is_quantized else value.layout)
        kind = "no numbers (a tensor of the device meta)" if value.is_meta else kind
        wanted = str(expected[key].dtype).removeprefix("torch.")
        msg = f"{source}: {key} holds {kind.removeprefix('torch.')}, expected plain {wanted}"
        raise WeightsMismatch(msg)


def check_finite(state: "Mapping[str, torch.Tensor]", source: str) -> None:
    """Raise `WeightsMismatch` where a tensor holds infinite numbers or NaN; names it."""
    import torch

    for key, value in state.items():
        if not torch.isfinite(value).all():
            msg = f"{source}: {key} holds numbers that are not finite; no usable weights"
            raise WeightsMismatch(msg)


def entries_of(state: StateDict) -> frozenset[str]:
    """Keys and shapes of a state dict as `KEY (SHAPE)` texts, as `Card.keys` has some."""
    return frozenset(f"{key} {tuple(value.shape)}" for key, value in state.items())


def _wrong_network(message: str, state: StateDict) -> WrongNetwork:
    error = WrongNetwork(message)
    error.entries = entries_of(state)
    return error


def _some(names: list[str], count: int = 3) -> str:
    return ", ".join(names[:count]) + (", ..." if len(names) > count else "")
