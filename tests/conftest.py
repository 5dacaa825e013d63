"""What all tests share: the parity kits and real data beside the project, where they are."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

# Before torch is imported: workers that each compute on all cores only wait for one another.
os.environ.setdefault("OMP_NUM_THREADS", "1")

SHARED = Path(__file__).resolve().parents[2] / "shared"


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of parity kits and real data; skips where the checkout stands alone."""
    if not (SHARED / "parity").is_dir():
        pytest.skip("the parity kits are not beside this checkout (../shared)")
    return SHARED


@pytest.fixture(scope="session", autouse=True)
def no_registered_weights(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Keeps the weights that the developer has registered out of the tests."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("NAT2024_WEIGHTS", str(tmp_path_factory.mktemp("registered")))
        yield


@pytest.fixture(scope="session", autouse=True)
def shared_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """One cache for all test workers, so that a network is exported once, and none of the user."""
    base = tmp_path_factory.getbasetemp()
    folder = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("NAT2024_CACHE", str(folder / "cache"))
        yield


@pytest.fixture(scope="session")
def night_clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dataset of three rendered sequences, 8 frames of 160x96; `wide` has a wide target."""
    from nat2024.datasets import write_sequence
    from nat2024.night import Clip, render_clip

    folder = tmp_path_factory.mktemp("data") / "night_clip"
    targets = {"narrow": (16, 14), "tall": (14, 20), "wide": (30, 18)}
    for seed, (name, target) in enumerate(targets.items()):
        clip = Clip(name, frames=8, size=(160, 96), target_size=target, seed=seed)
        write_sequence(folder, name, render_clip(clip))
    return folder


@pytest.fixture
def small_plugins() -> Iterator[str]:
    """The plugins of `data/plugins/small.py`, registered for one test; gives the file."""
    from nat2024 import registry

    source = str(Path(__file__).parent / "data" / "plugins" / "small.py")
    before = dict(registry._registered)
    registry.load_plugin_file(source)
    yield source
    registry._registered.clear()
    registry._registered.update(before)
