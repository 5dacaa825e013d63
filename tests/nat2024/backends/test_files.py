"""ONNX files for other programs: written only where they give the numbers of PyTorch."""

import importlib.util
from collections.abc import Callable
from pathlib import Path

import pytest
import torch
from torch import Tensor, nn

from nat2024.backends import Part, write_onnx
from nat2024.errors import BackendMismatch, UsageError

pytest.importorskip("onnxruntime")


def _not_a_number(image: Tensor) -> Tensor:
    return torch.log(-1 - image)


def _not_in_the_second(image: Tensor) -> tuple[Tensor, Tensor]:
    return 2 * image, _not_a_number(image)


def _unknown_to_the_runtime(image: Tensor) -> Tensor:
    return torch.erf(image.double()).float()


@pytest.mark.parametrize(
    ("run", "why"),
    [
        (_not_a_number, "differs from torch by nan"),
        (_not_in_the_second, "differs from torch by nan"),
        (_unknown_to_the_runtime, "Erf"),
    ],
)
def test_a_file_that_is_not_right_replaces_none(
    tmp_path: Path, run: Callable[[Tensor], Tensor], why: str
) -> None:
    before = tmp_path / "net-whole.onnx"
    before.write_bytes(b"what was right")
    with pytest.raises(BackendMismatch, match=rf"net-whole\.onnx: cannot be exported .*{why}"):
        write_onnx(nn.Identity(), {"whole": (Part(run), [torch.ones(1, 3, 4, 4)])}, tmp_path, "net")
    assert before.read_bytes() == b"what was right"
    assert list(tmp_path.iterdir()) == [before]


def test_what_the_export_lacks_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda _name: None)
    with pytest.raises(UsageError, match=r"pip install 'nat-bench\[onnx\]'"):
        write_onnx(nn.Identity(), {"whole": (Part(abs), [torch.ones(1)])}, tmp_path, "net")
