"""Writing the weights of the plain enhancer `tone_curve`."""

import os
from pathlib import Path
from typing import Any

import numpy as np

from nat2024.errors import ArrayContract, UsageError
from nat2024.files import write_atomic


def write_tone_curve(curve: Any, path: str | os.PathLike[str]) -> None:
    """Write a curve as weights that `tone_curve` loads: safetensors with one entry, `curve`.

    Args:
        curve: (3, 256) finite numbers: what each channel, in the order in which it is fed, makes
            of the 8-bit levels 0/255 .. 255/255; of images that is R, G, B.
        path: ends in .safetensors.

    Raises:
        ArrayContract: `curve` is not of that shape or not finite.
        UsageError: the path ends otherwise.
        Unwritable: the file cannot be written.
    """
    values = np.asarray(curve, dtype=np.float32)
    if values.shape != (3, 256) or not np.isfinite(values).all():
        msg = f"a tone curve must be (3, 256) finite numbers, not an array of shape {values.shape}"
        raise ArrayContract(msg)
    if Path(path).suffix != ".safetensors":
        msg = f"{path}: a tone curve is written as a .safetensors file; give it that ending"
        raise UsageError(msg)
    from safetensors.numpy import save

    write_atomic(path, save({"curve": np.ascontiguousarray(values)}))
