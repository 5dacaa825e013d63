"""Weights that a user has registered: a folder for each plugin, a record beside each file.

```
WEIGHTS/PLUGIN/ENTRY.json                    what it is and where it came from
WEIGHTS/PLUGIN/ENTRY-DIGEST.safetensors      the weights (or a copy of the file or folder)
```

WEIGHTS is named by the environment variable NAT2024_WEIGHTS, else it is `weights` in the user's
data folder. The weights are written first and the record last, so that what a record names is
whole.
"""

import contextlib
import hashlib
import os
import re
import secrets
import shutil
import time
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Literal

import msgspec

from nat2024.errors import Unwritable, WeightsMismatch, WeightsMissing
from nat2024.files import expand, remove_leftovers, write_atomic

_PLUGIN = re.compile(r"[a-z0-9][a-z0-9_]*")
_FILE = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]*")
_WEIGHTS = re.compile(r"\.?\w[\w-]*-[0-9a-f]{12}(\.\w+)*(-[0-9a-f]{8}\.tmp)?")
_LONGEST_IMPORT = 3600.0


class RegisteredWeights(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The record of one import.

    Attributes:
        plugin: name of the tracker or enhancer.
        options: options of the plugin that these weights belong to, such as `variant`; a plugin
            that is created with no weights named gets them, unless its user gave others.
        source: the path that was imported.
        source_sha256: digest of that file, or of the files of a folder that are in use.
        known_as: which published file it is, empty where it is none that the card knows.
        file: name of the file (or folder) beside the record.
        form: "safetensors" where it was converted, "copy" where it is kept byte for byte.
        sha256: digest of `file`.
        bytes: size of `file`.
        entries: number of tensors, 0 where PyTorch cannot read the file.
        imported: date and time of the import, ISO 8601 in UTC.
        format: version of this layout.
    """

    plugin: str
    options: dict[str, bool | int | float | str | None]
    source: str
    source_sha256: str
    known_as: str = ""
    file: str
    form: Literal["safetensors", "copy"]
    sha256: str
    bytes: int
    entries: int = 0
    imported: str = ""
    format: Literal[1] = 1

    @property
    def path(self) -> Path:
        """Where the weights lie."""
        return plugin_folder(self.plugin) / self.file

    @property
    def record(self) -> Path:
        """Where this record lies."""
        return plugin_folder(self.plugin) / f"{entry_name(self.options)}.json"


def weights_folder() -> Path:
    """The folder of all registered weights: NAT2024_WEIGHTS, else in the user's data folder."""
    given = os.environ.get("NAT2024_WEIGHTS")
    if given:
        return expand(given)
    import platformdirs

    return platformdirs.user_data_path("nat-bench") / "weights"


def plugin_folder(name: str) -> Path:
    """The folder of one plugin's registered weights.

    Raises:
        WeightsMissing: `name` is no plugin name, such as one that leads out of the folder.
    """
    if not _PLUGIN.fullmatch(name):
        msg = f"{name!r} is no plugin name, so there are no weights for it"
        raise WeightsMissing(msg)
    return weights_folder() / name


def entry_name(options: Mapping[str, Any]) -> str:
    """File name (without ending) of the entry for some options; the same for any order of them."""
    if not options:
        return "default"
    text = msgspec.json.encode(dict(sorted(options.items())))
    words = re.sub(r"[^A-Za-z0-9_]+", "-", describe_options(options)).strip("-")
    return f"{words[:40]}-{hashlib.sha256(text).hexdigest()[:8]}"


def describe_options(options: Mapping[str, Any]) -> str:
    """Options as `KEY=VALUE, KEY=VALUE`."""
    return ", ".join(f"{key}={value}" for key, value in sorted(options.items()))


def list_registered(name: str | None = None) -> list[RegisteredWeights]:
    """Records of one plugin, or of all, by name and options; nothing else is read.

    Raises:
        WeightsMismatch: a record cannot be read; says which.
    """
    return [read_record(path) for path in record_files(name)]


def record_files(name: str | None = None) -> list[Path]:
    """The files of these records, sorted."""
    folder = weights_folder() if name is None else plugin_folder(name)
    pattern = "[!.]*/[!.]*.json" if name is None else "[!.]*.json"
    return sorted(path for path in folder.glob(pattern) if path.is_file())


def read_record(path: Path) -> RegisteredWeights:
    """Read a record.

    Raises:
        WeightsMismatch: it is unreadable, or says something that its place contradicts.
    """
    reason = ""
    try:
        record = msgspec.json.decode(path.read_bytes(), type=RegisteredWeights)
    except OSError as error:
        reason = error.strerror or str(error)
    except (ValueError, RecursionError) as error:  # no UTF-8 and endless nesting too
        reason = str(error)
    else:
        # whatever a record says, nothing outside its own folder is read or removed
        if record.plugin == path.parent.name and _FILE.fullmatch(record.file):
            return record
        reason = "it names another plugin or a file elsewhere"
    msg = f"{path}: not a record of registered weights ({reason}); remove it and import anew"
    raise WeightsMismatch(msg)


def choose_registered(
    name: str, given: Mapping[str, Any], defaults: Mapping[str, Any]
) -> RegisteredWeights | None:
    """The registered weights for a plugin with these options; see `zoo.find_registered`."""
    wanted = {key: value for key, value in given.items() if value is not None}
    fitting = [one for one in list_registered(name) if _agree(one.options, wanted)]
    if len(fitting) > 1:
        chosen = {**defaults, **wanted}
        agreeing = [
            one
            for one in fitting
            if all(chosen.get(key) == value for key, value in one.options.items())
        ]
        # Of two that agree with all that was chosen, the one imported for more of it.
        most = max((len(one.options) for one in agreeing), default=0)
        fitting = [one for one in agreeing if len(one.options) == most] or fitting
    if len(fitting) > 1:
        choices = " or ".join(describe_options(one.options) or "no options" for one in fitting)
        msg = f"several weights are registered for {name}: choose by its options, {choices}"
        raise WeightsMissing(msg)
    return fitting[0] if fitting else None


def _agree(stored: Mapping[str, Any], wanted: Mapping[str, Any]) -> bool:
    return all(wanted.get(key, value) == value for key, value in stored.items())


def store(record: RegisteredWeights) -> None:
    """Write a record whose weights are in place, and remove the weights that it replaces.

    What killed imports have left in the folder of the plugin goes as well.

    Raises:
        Unwritable: the file system refuses.
    """
    try:
        replaced = read_record(record.record).path
    except WeightsMismatch:
        replaced = None
    text = msgspec.json.format(msgspec.json.encode(record), indent=2) + b"\n"
    write_atomic(record.record, text)
    if replaced and replaced != record.path:
        _delete(replaced)
    _remove_orphans(record.plugin)


def _remove_orphans(name: str) -> None:
    """Remove weights that no record names, unless an import that still runs may have them."""
    folder = plugin_folder(name)
    remove_leftovers(folder)
    try:
        named = {record.file for record in list_registered(name)}
    except WeightsMismatch:  # the record that cannot be read may name any of them
        return
    oldest = time.time() - _LONGEST_IMPORT
    for path in folder.iterdir():
        if path.name in named or not _WEIGHTS.fullmatch(path.name):
            continue
        with contextlib.suppress(OSError, Unwritable):  # another import may have been faster
            if path.stat().st_mtime < oldest:
                _delete(path)


def remove(record: RegisteredWeights) -> None:
    """Remove an entry: first its record, then its weights.

    Raises:
        Unwritable: the file system refuses.
    """
    _delete(record.record)
    _delete(record.path)


def discard(path: Path) -> None:
    """Remove weights that were written and are not wanted."""
    _delete(path)


def copy_files(source: Path, files: Iterable[Path], target: Path) -> None:
    """Copy a file, or a folder (only `files` of it where any are named), to a path at once.

    Raises:
        Unwritable: a file cannot be read or the target cannot be written.
    """
    if source.is_file():
        write_atomic(target, source.read_bytes())
        return
    temporary = target.with_name(f".{target.name}-{secrets.token_hex(4)}.tmp")
    try:
        temporary.mkdir(parents=True)
        chosen = list(files) or [path for path in sorted(source.rglob("*")) if path.is_file()]
        for path in chosen:
            copied = temporary / path.relative_to(source)
            copied.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, copied)
        if not target.exists():
            temporary.rename(target)
    except OSError as error:
        msg = f"{target}: cannot be written ({error.strerror or error})"
        raise Unwritable(msg) from None
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def _delete(path: Path) -> None:
    try:
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        else:
            path.unlink(missing_ok=True)
    except OSError as error:
        msg = f"{path}: cannot be removed ({error.strerror or error})"
        raise Unwritable(msg) from None
