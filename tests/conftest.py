"""What all tests share: the parity kits and real data beside the project, where they are."""

from pathlib import Path

import pytest

SHARED = Path(__file__).resolve().parents[2] / "shared"


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of parity kits and real data; skips where the checkout stands alone."""
    if not (SHARED / "parity").is_dir():
        pytest.skip("the parity kits are not beside this checkout (../shared)")
    return SHARED
