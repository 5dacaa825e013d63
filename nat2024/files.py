"""Files that are whole or absent: written under a temporary name, then renamed."""

import contextlib
import os
import platform
import re
import secrets
import tempfile
from pathlib import Path

from nat2024.errors import Unwritable

_TEMPORARY = re.compile(r"\..*\.(?P<host>[^.]*)-(?P<process>\d+)-[0-9a-f]+\.tmp(?:\.[a-z0-9]+)?")


def write_atomic(path: str | os.PathLike[str], data: str | bytes, *, durable: bool = True) -> None:
    """Write `data` (text as UTF-8, newlines as given) so that readers see all of it or nothing.

    The folder is made where absent. A process killed at any moment leaves the old file, or none;
    what it had begun is removed by `remove_leftovers`. Unless `durable`, a machine that loses its
    power may leave a damaged file.

    Raises:
        Unwritable: the file system refuses; says why.
    """
    path = Path(path)
    raw = data.encode() if isinstance(data, str) else data
    temporary = temporary_beside(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with temporary.open("xb") as file:
            file.write(raw)
            if durable:
                file.flush()
                os.fsync(file.fileno())
        temporary.replace(path)
    except OSError as error:
        _forget(temporary)
        msg = f"{path}: cannot be written ({error.strerror or error})"
        raise Unwritable(msg) from None
    except BaseException:
        _forget(temporary)
        raise


def temporary_beside(path: Path, ending: str = "") -> Path:
    """A new hidden name beside `path` that `remove_leftovers` knows as this process's.

    Args:
        path: what it is to become.
        ending: such as ".webm", for writers that tell the format by it.
    """
    owner = f"{_host()}-{os.getpid()}-{secrets.token_hex(4)}"
    return path.with_name(f".{path.name[:40]}.{owner}.tmp{ending}")


def check_writable(path: str | os.PathLike[str]) -> None:
    """See that a file can be written at `path`, before work is done for it; leaves nothing.

    Raises:
        Unwritable: the file system refuses; says why.
    """
    folder = next(parent for parent in Path(path).absolute().parents if parent.exists())
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        msg = f"{path}: cannot be written ({error.strerror or error})"
        raise Unwritable(msg) from None


def _forget(temporary: Path) -> None:
    with contextlib.suppress(OSError):
        temporary.unlink()


def expand(path: str | os.PathLike[str]) -> Path:
    """The path with `~` for the user's folder; left as it is where there is no such user."""
    try:
        return Path(path).expanduser()
    except RuntimeError:
        return Path(path)


def remove_leftovers(folder: str | os.PathLike[str]) -> None:
    """Remove what killed processes of this machine have begun to write directly in `folder`."""
    for temporary in Path(folder).glob(".*.tmp*"):
        match = _TEMPORARY.fullmatch(temporary.name)
        if match and match["host"] == _host() and not _is_alive(int(match["process"])):
            temporary.unlink(missing_ok=True)


def _host() -> str:
    return re.sub(r"[^A-Za-z0-9]", "_", platform.node())


def _is_alive(process: int) -> bool:
    if os.name == "nt":  # no way to ask without a risk to the process
        return True
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True
