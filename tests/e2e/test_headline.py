"""The main job from end to end: SiamRPN++ with LDEnhancer, checkpoint files, run to table."""

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

import nat2024
from nat2024.cli import run
from nat2024.store import RunFolder


@pytest.fixture(scope="module")
def checkpoints(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Checkpoint files in the forms that authors publish, with untrained weights."""
    folder = tmp_path_factory.mktemp("checkpoints")
    torch.manual_seed(0)
    tracker = nat2024.create_tracker("siamrpnpp", weights=False).model.state_dict()  # type: ignore[attr-defined]
    wrapped = {"state_dict": {f"module.{key}": value for key, value in tracker.items()}, "epoch": 3}
    torch.save(wrapped, folder / "model.pth")
    enhancer = nat2024.create_enhancer("ldenhancer", weights=False).model.state_dict()  # type: ignore[attr-defined]
    torch.save(enhancer, folder / "Epoch66.pth")
    return {"siamrpnpp": folder / "model.pth", "ldenhancer": folder / "Epoch66.pth"}


def headline(dataset: Path, results: Path, checkpoints: dict[str, Path], *more: str) -> int:
    weights = [f"--weights={name}={path}" for name, path in checkpoints.items()]
    words = ["run", "--tracker", "siamrpnpp", "--enhancer", "none", "--enhancer", "ldenhancer"]
    return run([*words, *weights, "--dataset", str(dataset), "--results", str(results), *more])


def test_headline_command(
    night_clip: Path, tmp_path: Path, checkpoints: dict[str, Path], capsys: Any
) -> None:
    assert headline(night_clip, tmp_path, checkpoints) == 0
    table = capsys.readouterr().out
    words = " ".join(table.split())
    assert "protocol pysot; scope patch" in words
    assert "siamrpnpp ldenhancer 0." in words
    enhanced = RunFolder(tmp_path / "night_clip" / "siamrpnpp+ldenhancer")
    plain = RunFolder(tmp_path / "night_clip" / "siamrpnpp")
    truth = nat2024.load_dataset(night_clip)["wide"].boxes
    for folder in (enhanced, plain):
        boxes = folder.boxes("wide")
        np.testing.assert_allclose(boxes[0], truth[0] + [0.5, 0.5, 0, 0], atol=1e-12)
        assert np.isfinite(boxes).all()
    manifest = enhanced.manifest()
    assert manifest is not None
    assert manifest.scope == "patch"
    assert manifest.repeatable
    assert manifest.enhancer is not None
    for record in (manifest.tracker, manifest.enhancer):
        assert record.weights is not None
        assert record.weights.origin == "given"
        assert len(record.weights.sha256) == 64


def test_scopes_are_kept_apart(
    night_clip: Path, tmp_path: Path, checkpoints: dict[str, Path], capsys: Any
) -> None:
    assert headline(night_clip, tmp_path, checkpoints, "--sequences", "wide") == 0
    assert headline(night_clip, tmp_path, checkpoints, "--scope", "frame") == 2
    assert "scope patch (now frame)" in capsys.readouterr().err


def test_other_weights_are_refused(
    night_clip: Path, tmp_path: Path, checkpoints: dict[str, Path], capsys: Any
) -> None:
    assert headline(night_clip, tmp_path, checkpoints, "--sequences", "wide") == 0
    other = tmp_path / "other.pth"
    torch.manual_seed(1)
    torch.save(nat2024.create_enhancer("ldenhancer", weights=False).model.state_dict(), other)  # type: ignore[attr-defined]
    assert headline(night_clip, tmp_path, {**checkpoints, "ldenhancer": other}) == 2
    assert "weights of ldenhancer" in capsys.readouterr().err


def test_swapped_checkpoints_are_told(
    night_clip: Path, tmp_path: Path, checkpoints: dict[str, Path], capsys: Any
) -> None:
    swapped = {"siamrpnpp": checkpoints["ldenhancer"], "ldenhancer": checkpoints["siamrpnpp"]}
    assert headline(night_clip, tmp_path, swapped) == 2
    err = capsys.readouterr().err
    assert "not a checkpoint of this network" in err
    assert len(err.splitlines()) == 1


@pytest.mark.shared
def test_official_ldenhancer_on_real_night_frames(
    shared: Path, tmp_path: Path, checkpoints: dict[str, Path]
) -> None:
    source = shared / "realdata"
    frames = sorted((source / "data_seq" / "uavdt_S1301a").iterdir())[:3]
    for frame in frames:
        target = tmp_path / "night" / "data_seq" / "uavdt_S1301a" / frame.name
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(frame, target)
    truth = nat2024.read_boxes(source / "anno" / "uavdt_S1301a.txt")[:3]
    nat2024.write_boxes(tmp_path / "night" / "anno" / "uavdt_S1301a.txt", truth)
    official = shared / "parity" / "enhancers" / "checkpoints" / "ldenhancer_model.pth"
    results = tmp_path / "results"
    weights = {**checkpoints, "ldenhancer": official}
    assert headline(tmp_path / "night", results, weights) == 0
    stored = json.loads((results / "night" / "siamrpnpp+ldenhancer" / "run.json").read_text())
    assert stored["enhancer"]["weights"]["known_as"] == "model.pth"
