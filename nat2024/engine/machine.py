"""What a session ran with and on, for its manifest."""

import contextlib
import importlib.metadata
import os
import platform
import secrets
import subprocess
import time
from collections import defaultdict
from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path

from nat2024.store import Session

_VERSIONED = ("nat-bench", "numpy", "onnxruntime", "opencv-python-headless", "openvino", "torch")
_HARMLESS = ("python", "revision")  # what they change is told by the version of nat-bench


def timestamp() -> str:
    """Now, in UTC, to the second."""
    return datetime.fromtimestamp(time.time(), UTC).isoformat(timespec="seconds")


def process_name() -> str:
    """A name that no other call of the engine has, and that names no machine."""
    return f"{os.getpid()}-{secrets.token_hex(6)}"


def versions() -> dict[str, str]:
    """Versions of what results depend on, and of the checkout where there is one."""
    found = {"python": platform.python_version()}
    for name in _VERSIONED:
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:  # another distribution brings OpenCV
            continue
    checkout = Path(__file__).parents[2]
    if (checkout / ".git").exists():
        command = ["git", "-C", str(checkout), "rev-parse", "HEAD"]
        with contextlib.suppress(OSError, subprocess.SubprocessError):
            found["revision"] = subprocess.run(
                command, capture_output=True, text=True, check=True, timeout=10
            ).stdout.strip()
    return found


def version_differences(one: Iterable[Session], other: Iterable[Session]) -> list[str]:
    """Versions that some sessions do not share with others and that results may depend on."""
    before, after = _all_versions(one), _all_versions(other)
    return [
        f"{name} {'/'.join(sorted(before[name]))} (now {'/'.join(sorted(after[name]))})"
        for name in sorted(before.keys() & after.keys() - set(_HARMLESS))
        if before[name] != after[name]
    ]


def _all_versions(sessions: Iterable[Session]) -> dict[str, set[str]]:
    found: dict[str, set[str]] = defaultdict(set)
    for session in sessions:
        for name, version in session.versions.items():
            found[name].add(version)
    return found


def machine() -> dict[str, str]:
    """What kind of machine this is."""
    import torch

    found = {"system": platform.platform(), "processor": platform.machine()}
    if torch.cuda.is_available():
        found["cuda_device"] = torch.cuda.get_device_name()
    return found
