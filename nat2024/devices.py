"""Naming a computing device, and saying in one line why one cannot be had or is too small."""

import contextlib
import re
from collections.abc import Iterator

from nat2024.errors import OutOfMemory, UsageError

_DEVICE = re.compile(r"cpu|cuda(?::(?P<number>[0-9]+))?")


def check_device(device: str) -> str:
    """Return `device` if it is there: "cpu", "cuda" or "cuda:N".

    Raises:
        UsageError: it is no such name, or torch does not see the device.
    """
    match = _DEVICE.fullmatch(device) if isinstance(device, str) else None
    if match is None:
        msg = f"device {device!r} is none of cpu, cuda, cuda:N"
        raise UsageError(msg)
    if device == "cpu":
        return device
    import torch

    count = torch.cuda.device_count() if torch.cuda.is_available() else 0
    if int(match["number"] or 0) >= count:
        msg = f"device {device!r} is not there: torch sees {count} CUDA devices"
        raise UsageError(msg)
    return device


@contextlib.contextmanager
def explain_lack_of_memory(name: str, height: int, width: int, count: int = 1) -> Iterator[None]:
    """Turn a device's lack of memory into one line that says for which images it was.

    Args:
        name: what is computed for the images, such as an enhancer.
        height: of the images.
        width: of the images.
        count: how many they are.

    Raises:
        OutOfMemory: in place of the errors of Python, torch and OpenCV.
    """
    try:
        yield
    except Exception as error:
        if not _is_lack_of_memory(error):
            raise
        what = f"{count} images of {width}x{height}" if count > 1 else f"a {width}x{height} image"
        msg = (
            f"{name}: not enough memory for {what}; scale it down, enhance parts of it, "
            "or take scope=patch in tracking"
        )
        raise OutOfMemory(msg) from None


def _is_lack_of_memory(error: Exception) -> bool:
    import torch

    if isinstance(error, MemoryError | torch.OutOfMemoryError):
        return True
    # torch on a CPU and OpenCV raise errors whose text is all there is to tell them by
    signs = ("can't allocate memory", "not enough memory", "Insufficient memory")
    return any(sign in str(error) for sign in signs)
