"""Whether a run folder belongs to what is to be run: nothing of two settings is ever mixed."""

from collections.abc import Collection
from typing import Any, TypeAlias

from nat2024.errors import ResultConflict
from nat2024.store.manifests import Manifest
from nat2024.store.runs import RunFolder

Untouched: TypeAlias = Collection[tuple[str, str]]
"""(`NAME[@LABEL]`, option) of options that are at their defaults."""


def open_run(folder: RunFolder, wanted: Manifest, untouched: Untouched = ()) -> Manifest:
    """The stored manifest if it agrees with `wanted`, else `wanted` for a new folder.

    Args:
        folder: of the run.
        wanted: what is to be run.
        untouched: options at their defaults. A folder made before such an option existed agrees,
            since the default is what it was made with.

    Raises:
        ResultConflict: the folder was made with other options, weights, scope, device, threads or
            batch (says which), or holds results without a manifest.
    """
    stored = folder.manifest()
    if stored is None:
        if folder.path.is_dir() and folder.finished():
            msg = f"{folder.path}: holds results without run.json; choose another --results folder"
            raise ResultConflict(msg)
        return wanted
    differences = setting_differences(stored, wanted, untouched)
    if differences:
        msg = (
            f"{folder.path} was made with other settings: {'; '.join(differences)}; "
            f"give this run a label ({wanted.tracker.name}@LABEL) or another --results folder"
        )
        raise ResultConflict(msg)
    return stored


def setting_differences(stored: Manifest, wanted: Manifest, untouched: Untouched = ()) -> list[str]:
    """What two manifests do not share of what results depend on, in words; see `open_run`."""
    old, new = _identity(stored), _identity(wanted)
    for title, option in untouched:
        key = f"{title}.{option}"
        if key in new:
            old.setdefault(key, new[key])
    return [
        f"{key} {old.get(key, 'unset')} (now {new.get(key, 'unset')})"
        for key in sorted({*old, *new})
        if old.get(key) != new.get(key)
    ]


def _identity(manifest: Manifest) -> dict[str, Any]:
    """What two calls must share to work on one run folder."""
    identity: dict[str, Any] = {
        "device": manifest.device,
        "threads": manifest.threads,
        "on_bad_frame": manifest.on_bad_frame,
        "batch": manifest.batch,
    }
    if manifest.enhancer:
        identity["scope"] = manifest.scope
    for record in (manifest.tracker, manifest.enhancer):
        if record is None:
            continue
        for key, value in record.options.items():
            if key != "scope":
                identity[f"{record.title}.{key}"] = value
        if record.weights:
            digest = record.weights.sha256[:12] or record.weights.origin
            identity[f"weights of {record.title}"] = digest
    return identity
