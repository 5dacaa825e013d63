"""From templates to a folder that can be installed."""

import keyword
import re
import shutil
import tempfile
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from string import Template
from typing import Literal

from nat2024.errors import DuplicatePlugin, InvalidOption, Unwritable
from nat2024.files import expand
from nat2024.registry import list_enhancers, list_trackers

_NAME = re.compile(r"[a-z][a-z0-9_]{0,39}")


def write_plugin_package(
    kind: Literal["enhancer", "tracker"],
    name: str,
    folder: Path | None = None,
    *,
    network: bool = False,
) -> Path:
    """Write a working plugin package: entry point, card, method and tests.

    Args:
        kind: "enhancer" or "tracker".
        name: under which the plugin will be registered.
        folder: where the package goes, absent or empty; the name in the working folder if None.
        network: whether it shall have a network with weights, in PyTorch.

    Returns:
        The folder, made whole or not at all.

    Raises:
        InvalidOption: not a name, or a word of Python.
        DuplicatePlugin: a tracker or enhancer of this name is installed.
        Unwritable: the folder has something in it, or cannot be made.
    """
    _check_name(kind, name)
    target = expand(folder) if folder is not None else Path(name)
    if target.exists() and not (target.is_dir() and not any(target.iterdir())):
        msg = f"{target}: is there already; name another folder with --out"
        raise Unwritable(msg)
    fields = _fields(kind, name)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=target.parent, prefix=f".{name}.") as space:
            whole = Path(space) / "whole"
            for template in ("common", f"{kind}_network" if network else kind):
                _write(files(__package__) / "templates" / template, whole, fields)
            if target.exists():
                target.rmdir()
            shutil.move(whole, target)
    except OSError as error:
        msg = f"{target}: cannot be written ({error.strerror or error})"
        raise Unwritable(msg) from None
    return target


def _check_name(kind: str, name: str) -> None:
    if not _NAME.fullmatch(name) or keyword.iskeyword(name):
        msg = (
            f"{name!r} cannot name {'an' if kind == 'enhancer' else 'a'} {kind}: a small letter "
            "first, then at most 39 small letters, digits and underscores, and no word of Python"
        )
        raise InvalidOption(msg)
    if name in (*list_enhancers(), *list_trackers()):
        msg = f"{name!r} is taken already; `nat-bench list` shows all names"
        raise DuplicatePlugin(msg)


def _fields(kind: str, name: str) -> dict[str, str]:
    title = "".join(word.capitalize() for word in name.split("_"))
    return {
        "name": name,
        "title": title,
        "class_name": title,
        "package": f"nat_bench_{name}",
        "distribution": f"nat-bench-{name.strip('_').replace('_', '-')}",
        "kind": kind,
    }


def _write(source: Traversable, target: Path, fields: dict[str, str]) -> None:
    if source.is_dir():
        target.mkdir(exist_ok=True)
        for child in source.iterdir():
            name = fields["package"] if child.name == "package" else child.name
            _write(child, target / name.removesuffix(".template"), fields)
        return
    text = Template(source.read_text(encoding="utf-8")).substitute(fields)
    target.write_text(text, encoding="utf-8", newline="\n")
