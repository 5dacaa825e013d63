"""Every network that can run elsewhere gives there what it gives in PyTorch."""

import numpy as np
import pytest
import torch

from nat2024 import create_enhancer, create_tracker
from nat2024.backends import is_installed

RUNTIMES = [name for name in ("onnxruntime", "openvino") if is_installed(name, "cpu")]
FIRST = ("ldenhancer", "siamrpnpp")
ENHANCERS = ("ldenhancer", "dcepp", "darklighter", "highlightnet", "sct", "ruas", "llve")
TRACKERS = ("siamrpnpp", "siamapn", "siamapnpp", "hift", "lpat", "nanotrack")


def marks_of(name: str, runtime: str) -> list[pytest.MarkDecorator]:
    is_quick = runtime == RUNTIMES[-1] or name in FIRST
    return [] if is_quick else [pytest.mark.slow]


def on_every_runtime(names: tuple[str, ...]) -> list[object]:
    """Pairs of name and runtime; `make slow` holds every network against both runtimes."""
    return [
        pytest.param(name, runtime, marks=marks_of(name, runtime))
        for name in names
        for runtime in RUNTIMES
    ]


@pytest.mark.parametrize(("name", "backend"), on_every_runtime(ENHANCERS))
def test_enhancers(name: str, backend: str) -> None:
    torch.manual_seed(0)
    plain = create_enhancer(name, weights=False)
    other = create_enhancer(name, weights=False, backend=backend)
    other.model.load_state_dict(plain.model.state_dict())
    for shape in [(1, 3, 64, 96), (2, 3, 48, 64)]:
        batch = torch.rand(shape) * 0.3
        found, wanted = other.enhance_batch(batch), plain.enhance_batch(batch)
        torch.testing.assert_close(found, wanted, rtol=0, atol=1e-5)
    assert {part.backend for part in other._parts.values()} == {backend}


@pytest.mark.parametrize(("name", "backend"), on_every_runtime(TRACKERS))
def test_networks_of_trackers(name: str, backend: str) -> None:
    torch.manual_seed(0)
    variant = {"variant": "compact"} if name == "siamrpnpp" else {}
    tracker = create_tracker(name, weights=False, backend=backend, **variant)
    sides = (tracker.constants.exemplar_size, tracker.constants.instance_size)
    template, search = (255 * torch.rand(1, 3, side, side) for side in sides)
    with torch.no_grad():
        wanted = tracker.model.match(tracker.model.embed(template), search)
        found = tracker.network.match(tracker.network.embed(template), search)
    for one, other in zip(found, wanted, strict=True):
        torch.testing.assert_close(one, other, rtol=1e-4, atol=1e-4 * float(other.abs().max()))
    assert {part.backend for part in tracker._compiled._parts.values()} == {backend}


def test_a_large_frame_is_enhanced_in_bands_to_the_same_numbers() -> None:
    if not RUNTIMES:
        pytest.skip("no other runtime is installed")
    from nat2024_enhancers.ldenhancer import model

    plain = create_enhancer("ldenhancer")
    other = create_enhancer("ldenhancer", backend=RUNTIMES[-1])
    batch = torch.rand(1, 3, 160, 128) * 0.3
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(model, "_PART_PIXELS", 64 * 128)
        found = other.enhance_batch(batch)
    torch.testing.assert_close(found, plain.enhance_batch(batch), rtol=0, atol=1e-6)


def test_an_image_keeps_its_bytes() -> None:
    image = np.random.default_rng(0).integers(0, 60, (45, 70, 3), dtype=np.uint8)
    plain = create_enhancer("ldenhancer").enhance(image)
    for backend in RUNTIMES:
        other = create_enhancer("ldenhancer", backend=backend).enhance(image)
        assert (other != plain).mean() < 0.001  # only what lies on the edge of rounding
        assert np.abs(other.astype(int) - plain).max() <= 1
