"""Random numbers of torch, NumPy and Python: seeded, kept, and given back as they were."""

import json
import random
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any


@contextmanager
def own_random_numbers() -> Iterator[None]:
    """What is drawn or seeded inside changes nothing outside."""
    before = random_states()
    try:
        yield
    finally:
        restore_random_states(before)


def seed_all(seed: int) -> None:
    """Seed all random numbers."""
    import numpy as np
    import torch

    torch.manual_seed(seed)
    np.random.seed(seed % 2**32)  # noqa: NPY002 - plugins may draw from it
    random.seed(seed)


def random_states() -> dict[str, Any]:
    """The states of all random numbers, as tensors and texts."""
    import numpy as np
    import torch

    kind, keys, *rest = np.random.get_state()  # noqa: NPY002 - plugins may draw from it
    return {
        "torch": torch.get_rng_state(),
        "cuda": torch.cuda.get_rng_state_all() if torch.cuda.is_available() else [],
        "numpy": [kind, torch.from_numpy(np.array(keys, dtype=np.int64)), *rest],
        "python": json.dumps(random.getstate()),
    }


def restore_random_states(states: Mapping[str, Any]) -> None:
    """Go on with random numbers where `random_states` was called."""
    import numpy as np
    import torch

    torch.set_rng_state(states["torch"])
    if states["cuda"] and torch.cuda.device_count() == len(states["cuda"]):
        torch.cuda.set_rng_state_all(states["cuda"])
    kind, keys, *rest = states["numpy"]
    np.random.set_state((kind, keys.numpy().astype(np.uint32), *rest))  # noqa: NPY002
    version, numbers, gauss = json.loads(states["python"])
    random.setstate((version, tuple(numbers), gauss))
