"""What made a folder of enhanced images, kept beside it, so that other settings are refused."""

from collections.abc import Collection
from pathlib import Path
from typing import Any

import msgspec

from nat2024.errors import ResultConflict
from nat2024.files import write_atomic
from nat2024.store import PluginRecord

FORMAT = 1


class EnhancementRecord(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The content of `OUT/ENHANCER[@LABEL].json`.

    Attributes:
        source: absolute path of the input.
        kind: how it was read: `image`, `images`, `video` or `dataset`.
        enhancer: the enhancer, its full options and its weights.
        feed: `image` or `tracker`; see `nat2024.enhancing.Feed`.
        device: "cpu" or "cuda".
        quality: of JPEG.
        frames: how a video was taken and written, empty for all else.
        format: version of this file.
    """

    source: str
    kind: str
    enhancer: PluginRecord
    feed: str = "image"
    device: str = "cpu"
    quality: int = 95
    frames: str = ""
    format: int = FORMAT


def record_path(folder: Path) -> Path:
    """Where the settings of an enhancer's folder lie: beside it, never among the images."""
    return folder.with_name(f"{folder.name}.json")


def open_folder(folder: Path, wanted: EnhancementRecord, untouched: Collection[str] = ()) -> None:
    """Claim a folder for these settings, new or begun with the same.

    Args:
        folder: of the enhanced images.
        wanted: the settings.
        untouched: options at their defaults. A folder made before such an option existed agrees,
            since the default is what it was made with.

    Raises:
        ResultConflict: it was made with other settings (says which), or holds files and no record.
        Unwritable: the record cannot be written.
    """
    path = record_path(folder)
    stored = _read(path)
    if stored is None:
        if folder.is_dir() and any(folder.iterdir()):
            msg = f"{folder}: holds files, but no {path.name} lies beside it; choose another folder"
            raise ResultConflict(msg)
        write_atomic(path, msgspec.json.format(msgspec.json.encode(wanted), indent=2) + b"\n")
        return
    old, new = _settings(stored), _settings(wanted)
    for option in untouched:
        key = f"{wanted.enhancer.title}.{option}"
        if key in new:
            old.setdefault(key, new[key])
    differences = _differences(old, new)
    if differences:
        msg = (
            f"{folder} was made with other settings: {'; '.join(differences)}; give the enhancer "
            f"a label ({wanted.enhancer.name}@LABEL) or choose another --out folder"
        )
        raise ResultConflict(msg)


def _read(path: Path) -> EnhancementRecord | None:
    try:
        return msgspec.json.decode(path.read_bytes(), type=EnhancementRecord)
    except FileNotFoundError:
        return None
    except OSError as error:
        msg = f"{path}: cannot be read ({error.strerror or error})"
        raise ResultConflict(msg) from None
    except (ValueError, RecursionError) as error:  # no UTF-8 and endless nesting too
        msg = f"{path}: no record of this version ({error}); choose another --out folder"
        raise ResultConflict(msg) from None


def _settings(record: EnhancementRecord) -> dict[str, Any]:
    enhancer = record.enhancer
    found: dict[str, Any] = {
        "input": f"{record.source} ({record.kind})",
        "feed": record.feed,
        "device": record.device,
        "quality": record.quality,
    }
    if record.frames:
        found["video"] = record.frames
    found |= {f"{enhancer.title}.{key}": value for key, value in enhancer.options.items()}
    if enhancer.weights:
        digest = enhancer.weights.sha256[:12] or enhancer.weights.origin
        found[f"weights of {enhancer.title}"] = digest
    return found


def _differences(old: dict[str, Any], new: dict[str, Any]) -> list[str]:
    return [
        f"{key} {old.get(key, 'unset')} (now {new.get(key, 'unset')})"
        for key in sorted({*old, *new})
        if old.get(key) != new.get(key)
    ]
