"""Parts of networks in other runtimes: the same numbers, and what can go wrong."""

import logging
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
import torch
from torch import Tensor, nn

from nat2024.backends import (
    BACKENDS,
    TORCH_FIRST,
    CompiledPart,
    Part,
    all_in_torch,
    backends_of,
    exporting,
    is_installed,
    parts,
    runtimes,
)
from nat2024.errors import BackendMismatch, UsageError
from nat2024.keeping import cache_folder

RUNTIMES = [name for name in ("onnxruntime", "openvino") if is_installed(name, "cpu")]


class Small(nn.Module):
    """A network with what the real ones have: a norm to be merged, two outputs, any size."""

    def __init__(self) -> None:
        super().__init__()
        self.layer = nn.Conv2d(3, 4, 3, padding=1)
        self.norm = nn.BatchNorm2d(4)

    def forward(self, image: Tensor) -> tuple[Tensor, Tensor]:
        features = torch.relu(self.norm(self.layer(image)))
        return features, features.mean(dim=1, keepdim=True)


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("NAT2024_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture
def network() -> Small:
    torch.manual_seed(0)
    network = Small()
    network.norm.running_mean.uniform_(-0.1, 0.1)
    return network.eval()


def compiled(network: nn.Module, *backends: str, dynamic: bool = True) -> CompiledPart:
    return CompiledPart(network, "whole", Part(network.forward, dynamic), backends)


@pytest.mark.parametrize("backend", RUNTIMES)
def test_several_threads_get_their_own_numbers(network: Small, backend: str) -> None:
    part = compiled(network, backend)
    images = [torch.full((1, 3, 48 + 8 * (n % 2), 64), float(n)) for n in range(4)]

    def differences(first: int) -> list[float]:
        with torch.no_grad():
            turns = [images[(first + turn) % 4] for turn in range(40)]
            return [float((part(one)[0] - network(one)[0]).abs().max()) for one in turns]

    with ThreadPoolExecutor(4) as pool:
        away = [one for found in pool.map(differences, range(4)) for one in found]
    assert len(away) == 160
    assert max(away) < 1e-5
    assert part.answered == {backend: 160}


@pytest.mark.parametrize("backend", RUNTIMES)
@pytest.mark.parametrize("dynamic", [True, False])
def test_gives_what_torch_gives_for_any_shape(network: Small, backend: str, dynamic: bool) -> None:
    part = compiled(network, backend, dynamic=dynamic)
    with torch.no_grad():
        for shape in [(1, 3, 16, 24), (2, 3, 24, 16), (1, 3, 16, 24)]:
            image = torch.rand(shape)
            for found, wanted in zip(part(image), network(image), strict=True):
                torch.testing.assert_close(found, wanted, rtol=0, atol=1e-6)
    assert part.backend == backend


@pytest.mark.parametrize("backend", RUNTIMES)
def test_follows_weights_that_are_loaded_later(network: Small, backend: str) -> None:
    part, image = compiled(network, backend), torch.rand(1, 3, 16, 16)
    with torch.no_grad():
        before = part(image)[0]
        network.load_state_dict(Small().state_dict())
        after = part(image)[0]
        torch.testing.assert_close(after, network(image)[0], rtol=0, atol=1e-6)
    assert not torch.equal(before, after)


@pytest.mark.parametrize("backend", RUNTIMES)
def test_is_exported_once(network: Small, backend: str, own_cache: Path) -> None:
    with torch.no_grad():
        compiled(network, backend)(torch.rand(1, 3, 16, 16))
        [file] = own_cache.rglob("*.onnx")
        written = file.stat().st_ino
        compiled(network, backend)(torch.rand(1, 3, 16, 16))
    assert [file] == list(own_cache.rglob("*.onnx"))
    assert file.stat().st_ino == written


@pytest.mark.parametrize("backend", RUNTIMES)
def test_a_cache_that_nobody_can_write_to_stops_nothing(
    network: Small,
    backend: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    occupied = tmp_path / "occupied"
    occupied.write_text("a file where a folder should be")
    monkeypatch.setenv("NAT2024_CACHE", str(occupied))
    exporting._tell_once.cache_clear()
    image = torch.rand(1, 3, 16, 16)
    with torch.no_grad(), caplog.at_level(logging.WARNING, "nat2024"):
        for part in (compiled(network, backend), compiled(network, backend)):
            torch.testing.assert_close(part(image)[0], network(image)[0], rtol=0, atol=1e-6)
            assert part.backend == backend
    assert caplog.text.count("cannot be written; networks are exported anew") == 1


def test_the_cache_does_not_grow_without_end(
    network: Small, own_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(exporting, "_MOST_BYTES", 1)
    image = torch.rand(1, 3, 16, 16)
    with torch.no_grad():
        kept = exporting.exported(network, network.forward, "whole", [image], dynamic=True)
        assert isinstance(kept, Path)
    assert list((own_cache / "onnx").iterdir()) == []


def test_a_network_that_was_typed_in_is_exported(own_cache: Path) -> None:
    names: dict[str, type[nn.Module]] = {"nn": nn}  # type: ignore[dict-item]
    exec("class Typed(nn.Module):\n    def forward(self, x):\n        return 2 * x", names)
    network = names["Typed"]().eval()
    path = exporting.exported(
        network, network.forward, "whole", [torch.rand(1, 3, 8, 8)], dynamic=True
    )
    assert path == next(own_cache.rglob("*.onnx"))


@pytest.mark.parametrize("backend", RUNTIMES)
def test_a_damaged_file_in_the_cache_is_made_again(
    network: Small, backend: str, own_cache: Path
) -> None:
    image = torch.rand(1, 3, 16, 16)
    with torch.no_grad():
        compiled(network, backend)(image)
        [file] = own_cache.rglob("*.onnx")
        file.write_bytes(b"no network")
        found = compiled(network, backend)(image)[0]
        torch.testing.assert_close(found, network(image)[0], rtol=0, atol=1e-6)


def test_gradients_flow_through_torch(network: Small) -> None:
    image = torch.rand(1, 3, 16, 16, requires_grad=True)
    compiled(network, *RUNTIMES)(image)[0].sum().backward()
    assert image.grad is not None


@pytest.mark.parametrize("backend", RUNTIMES)
def test_all_in_torch_is_all_in_torch_for_as_long(network: Small, backend: str) -> None:
    part, image = compiled(network, backend), torch.rand(1, 3, 16, 16)
    with torch.no_grad():
        with all_in_torch():
            assert torch.equal(part(image)[0], network(image)[0])
        assert not cache_folder().exists()
        part(image)
    assert cache_folder().exists()


class FixedOnly(nn.Module):
    """What it computes depends on the width in a way that an export cannot carry."""

    def __init__(self) -> None:
        super().__init__()
        self.layer = nn.Conv2d(3, 3, 1)

    def forward(self, image: Tensor) -> Tensor:
        return self.layer(image) * float(image.shape[-1])


@pytest.mark.parametrize("backend", RUNTIMES)
def test_falls_back_to_fixed_shapes(backend: str) -> None:
    network = FixedOnly().eval()
    part = compiled(network, backend)
    with torch.no_grad():
        for width in (8, 16, 8):
            image = torch.rand(1, 3, 8, width)
            torch.testing.assert_close(part(image), network(image), rtol=0, atol=1e-4)
    assert part.backend == backend


@pytest.mark.parametrize("backend", RUNTIMES)
@pytest.mark.parametrize("iterations", [1, 3])
def test_an_input_that_nothing_uses_is_dropped(backend: str, iterations: int) -> None:
    from nat2024 import create_enhancer

    words = {"two_branch": False, "light_loss": False, "cross_attention": False}
    options = {**words, "iterations": iterations}
    plain = create_enhancer("ldenhancer", weights=False, **options)
    other = create_enhancer("ldenhancer", weights=False, backend=backend, **options)
    other.model.load_state_dict(plain.model.state_dict())
    batch = torch.rand(1, 3, 48, 32)
    torch.testing.assert_close(
        other.enhance_batch(batch), plain.enhance_batch(batch), rtol=0, atol=1e-5
    )
    assert {part.backend for part in other._parts.values()} == {backend}


class Random(nn.Module):
    """Never the same twice, so that no check can pass."""

    def __init__(self) -> None:
        super().__init__()
        self.layer = nn.Conv2d(3, 3, 1)

    def forward(self, image: Tensor) -> Tensor:
        return self.layer(image) + torch.rand(1).item()


@pytest.mark.skipif(not RUNTIMES, reason="no other runtime is installed")
def test_other_numbers_are_refused_or_left_to_torch(caplog: pytest.LogCaptureFixture) -> None:
    network, image = Random().eval(), torch.rand(1, 3, 8, 8)
    with torch.no_grad():
        with pytest.raises(BackendMismatch, match=r"differs from torch by .* take backend torch"):
            compiled(network, RUNTIMES[0])(image)
        with caplog.at_level(logging.WARNING, "nat2024"):
            part = compiled(network, *RUNTIMES, "torch")
            part(image)
    assert part.backend == "torch"
    assert "torch takes over" in caplog.text


def test_other_threads_open_another_session(
    network: Small, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened = []

    def open_session(*_: object, threads: int, **__: object) -> object:
        opened.append(threads)
        return lambda arrays: [one.numpy() for one in network(torch.from_numpy(arrays[0]))]

    monkeypatch.setattr(parts, "open_session", open_session)
    part, image = compiled(network, "onnxruntime"), torch.rand(1, 3, 8, 8)
    before = torch.get_num_threads()
    try:
        with torch.no_grad():
            for threads in (1, 1, 2):
                torch.set_num_threads(threads)
                part(image)
    finally:
        torch.set_num_threads(before)
    assert opened == [1, 2]


def test_wishes() -> None:
    assert backends_of("torch", "cpu") == ("torch",)
    assert backends_of("auto", "cpu")[-1] == "torch"
    assert set(backends_of("auto", "cpu")) <= set(BACKENDS)
    with pytest.raises(UsageError, match=r"backend 'caffe' is none of auto, torch"):
        backends_of("caffe", "cpu")  # type: ignore[arg-type]
    with pytest.raises(UsageError, match=r"tensorrt is not installed for device cpu"):
        backends_of("tensorrt", "cpu")
    with pytest.raises(UsageError, match="float32 only; openvino knows bfloat16"):
        backends_of("torch", "cpu", "bfloat16")
    with pytest.raises(UsageError, match="precision 'int8' is none of"):
        backends_of("torch", "cpu", "int8")  # type: ignore[arg-type]


def test_auto_takes_a_networks_own_order(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runtimes, "is_installed", lambda *_: True)
    assert backends_of("auto", "cpu") == ("openvino", "onnxruntime", "torch")
    assert backends_of("auto", "cpu", fastest=TORCH_FIRST)[0] == "torch"
    assert backends_of("auto", "cpu", "bfloat16", TORCH_FIRST) == ("openvino",)
    assert backends_of("auto", "cuda:1", fastest=TORCH_FIRST) == ("tensorrt", "torch")
    assert backends_of("openvino", "cpu", fastest=TORCH_FIRST) == ("openvino",)


def test_what_is_missing_is_told_as_it_can_be_had(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runtimes, "is_installed", lambda *_: False)
    for backend, device, remedy in [
        ("openvino", "cpu", r"pip install 'nat-bench\[openvino\]'"),
        ("openvino", "cuda", "openvino runs on device cpu only"),
        ("onnxruntime", "cpu", r"pip install 'nat-bench\[onnx\]'"),
        ("onnxruntime", "cuda", "with onnxruntime-gpu, or"),
        ("tensorrt", "cpu", "runs on device cuda only"),
        ("tensorrt", "cuda", "onnxruntime-gpu and NVIDIA's TensorRT"),
    ]:
        with pytest.raises(UsageError, match=remedy):
            backends_of(backend, device)  # type: ignore[arg-type]
    with pytest.raises(UsageError, match=r"no backend here computes in bfloat16 on cuda"):
        backends_of("auto", "cuda", "bfloat16")


def test_the_cache_is_the_users_unless_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NAT2024_CACHE")
    assert cache_folder().name == "nat-bench"
