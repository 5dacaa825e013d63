"""Naming a computing device, and saying in one line why one cannot be had."""

import re

from nat2024.errors import UsageError

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
