"""What a training keeps on disk, whole or absent, and how it goes on from there."""

import contextlib
import hashlib
import io
import json
import re
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nat2024.errors import ResultConflict, WeightsMismatch
from nat2024.files import write_atomic

if TYPE_CHECKING:
    from torch import nn

_NAME = re.compile(r"step-(\d+)\.pt")


def checkpoint_path(folder: Path, step: int) -> Path:
    """Where the checkpoint after `step` steps lies."""
    return folder / f"step-{step:08d}.pt"


def list_checkpoints(folder: Path) -> list[Path]:
    """Checkpoints in a folder, the oldest first."""
    return sorted(path for path in folder.glob("step-*.pt") if _NAME.fullmatch(path.name))


def write_checkpoint(path: Path, content: Mapping[str, Any]) -> None:
    """Write tensors and plain values so that `torch.load(weights_only=True)` reads them.

    Raises:
        Unwritable: the file system refuses; what was there stays.
    """
    import torch

    stream = io.BytesIO()
    torch.save(dict(content), stream)
    write_atomic(path, stream.getvalue())


def read_checkpoint(path: Path, keys: Collection[str] = ()) -> dict[str, Any]:
    """Read a checkpoint without running code.

    Args:
        path: the file.
        keys: what it must have besides step, network and identity.

    Raises:
        WeightsMismatch: it is damaged, or no checkpoint of a training.
    """
    import torch

    try:
        content = torch.load(path, map_location="cpu", weights_only=True)
    except Exception as error:  # damaged bytes can fail anywhere inside the unpickler
        reason = str(error).split("\n", 1)[0] or type(error).__name__
        msg = f"{path}: not a readable checkpoint ({reason}); remove it to go on from an older one"
        raise WeightsMismatch(msg) from None
    if (
        not isinstance(content, dict)
        or not {"step", "network", "identity", *keys} <= content.keys()
    ):
        msg = f"{path}: not a checkpoint of a training, or of another release of nat-bench"
        raise WeightsMismatch(msg)
    return content


def write_weights(path: Path, network: "nn.Module", note: Mapping[str, str] | None = None) -> None:
    """Write a network's weights as safetensors, which every `--weights` takes.

    The same weights and note give the same bytes.

    Args:
        path: the file.
        network: on any device.
        note: texts that the file's header keeps.

    Raises:
        Unwritable: the file system refuses.
    """
    from safetensors.torch import save

    state = {key: value.detach().cpu().contiguous() for key, value in network.state_dict().items()}
    write_atomic(path, _with_note(save(state), note or {}))


def _with_note(raw: bytes, note: Mapping[str, str]) -> bytes:
    """Put a note into the header; safetensors itself puts its entries there in any order."""
    begin = 8 + int.from_bytes(raw[:8], "little")
    header = {"__metadata__": dict(sorted(note.items()))} | json.loads(raw[8:begin])
    text = json.dumps(header, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 8)  # data begins at a multiple of 8
    return len(text).to_bytes(8, "little") + text + raw[begin:]


def digest_of(start: Path | None) -> str:
    """Short digest of the weights that a training starts from; empty for fresh ones."""
    return hashlib.sha256(start.read_bytes()).hexdigest()[:16] if start else ""


def forget_old(folder: Path, keep: int) -> None:
    """Remove all checkpoints but the last `keep`; 0 keeps all."""
    for path in list_checkpoints(folder)[: -keep or None] if keep else []:
        with contextlib.suppress(OSError):
            path.unlink()


def check_identity(path: Path, found: str, wanted: str) -> None:
    """Refuse to go on with a checkpoint of another configuration.

    Args:
        path: the checkpoint, for the message.
        found: the configuration in it, JSON.
        wanted: the present one, JSON.

    Raises:
        ResultConflict: they differ; names what.
    """
    if found == wanted:
        return
    old, new = _flat(json.loads(found)), _flat(json.loads(wanted))
    differing = sorted(key for key in old.keys() | new.keys() if old.get(key) != new.get(key))
    some = ", ".join(f"{key} {old.get(key)} there, {new.get(key)} now" for key in differing[:3])
    more = f" and {len(differing) - 3} more" if len(differing) > 3 else ""
    msg = (
        f"{path}: checkpoint of another configuration ({some}{more}); go on with the same "
        "settings and data, or name another folder"
    )
    raise ResultConflict(msg)


def _flat(document: Any, prefix: str = "") -> dict[str, Any]:
    if not isinstance(document, dict):
        return {prefix: document}
    found: dict[str, Any] = {}
    for key, value in document.items():
        found |= _flat(value, f"{prefix}.{key}" if prefix else key)
    return found


def load_into(network: "nn.Module", state: Mapping[str, Any], path: Path) -> None:
    """Load a checkpoint's weights.

    Raises:
        WeightsMismatch: they are of another network.
    """
    try:
        network.load_state_dict(state)
    except RuntimeError as error:
        msg = f"{path}: checkpoint of another network ({str(error).splitlines()[-1].strip()})"
        raise WeightsMismatch(msg) from None
