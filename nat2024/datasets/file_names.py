"""Names of files in the annotation schema: patterns, and names that stay inside their folder."""

import re
from pathlib import PureWindowsPath

from nat2024.errors import AnnotationInvalid

_NUMBERED = re.compile(r"([^%]*)%(?:0([1-9]))?d([^%]*)")
_DEVICES = re.compile(r"(con|prn|aux|nul|com[0-9]|lpt[0-9])[ ]*(\..*)?", re.IGNORECASE)
_NAME_BYTES = 200  # file systems take 255, an ending and a temporary name must fit too


def is_plain_name(name: str) -> bool:
    """Whether a name is a visible file name that leads nowhere: no separator, dot or device."""
    return (
        bool(name)
        and name.isprintable()
        and not name.startswith(".")
        and not {"/", "\\"} & set(name)
        and not PureWindowsPath(name).drive
        and not _DEVICES.fullmatch(name)  # Windows would write to a device
        and len(name.encode()) <= _NAME_BYTES
    )


def is_inner_path(path: str) -> bool:
    """Whether a `/`-separated path stays inside the folder it begins in; empty is that folder."""
    return not path or all(map(is_plain_name, path.split("/")))


def expand_pattern(pattern: str, first: int, count: int) -> tuple[str, ...]:
    """File names that a pattern such as `%06d.jpg` stands for.

    Raises:
        AnnotationInvalid: it has anything but one `%d` or `%0Nd`.
    """
    match = _NUMBERED.fullmatch(pattern)
    if match is None:
        msg = f"pattern {pattern!r}: expected one %d or %0Nd, such as %06d.jpg"
        raise AnnotationInvalid(msg)
    before, digits, after = match.groups()
    width = int(digits or 0)
    return tuple(f"{before}{number:0{width}d}{after}" for number in range(first, first + count))


def find_pattern(names: tuple[str, ...]) -> tuple[str, int] | None:
    """The pattern and first number that give exactly these file names; None where none does."""
    match = re.fullmatch(r"([^%]*?)([0-9]+)([^0-9%]*)", names[0]) if names else None
    if match is None or len(match[2]) > 9:
        return None
    before, number, after = match.groups()
    first, padded = int(number), len(number) > 1
    for spec in (f"0{len(number)}" if padded else "", ""):
        width = int(spec or 0)
        if all(n == f"{before}{i:0{width}d}{after}" for i, n in enumerate(names, first)):
            return f"{before}%{spec}d{after}", first
    return None
