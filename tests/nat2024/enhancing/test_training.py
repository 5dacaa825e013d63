"""Training enhancers: the verb, resuming, labels that are kept, other people's enhancers."""

import json
import os
import re
import shlex
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch

from nat2024 import create_enhancer, registry
from nat2024.cli import run
from nat2024.cli.training_report import Bars
from nat2024.datasets import load_dataset
from nat2024.enhancing.training import PictureSettings, Tracking, choose_settings
from nat2024.enhancing.training.batches import PictureBatches
from nat2024.enhancing.training.pictures import PictureStore, find_shots, fit_picture
from nat2024.enhancing.training.validation import EnhancerValidation
from nat2024.training.curves import read_curve
from nat2024.zoo import read_checkpoint

FAST = ("size=32", "log_every=5", "held_out=2", "full_size_steps=0", "crop=16", "recalibrate=2")

PLUGIN = """
import torch
from torch import nn

from nat2024 import register_enhancer
from nat2024.cards import Card
from nat2024.interfaces import NeuralEnhancer


@register_enhancer("gain_net")
class GainNet(NeuralEnhancer):
    card = Card(title="Gain", summary="For tests.", needs_weights=True)

    def build(self):
        return nn.Conv2d(3, 3, 1)

    def forward(self, batch):
        return self.model(batch)

    def targets(self, images):
        return {"wanted": (2 * images).clamp(max=1)}

    def loss(self, batch):
        assert batch["wanted"].shape == batch["image"].shape
        return {"error": (self.model(batch["image"]) - batch["wanted"]).square().mean()}
"""


@pytest.fixture(autouse=True)
def no_waiting_for_the_disk(monkeypatch):
    monkeypatch.setattr(os, "fsync", lambda _file: None)
    before = dict(registry._registered)
    yield
    registry._registered.clear()
    registry._registered.update(before)


@pytest.fixture
def data(tmp_path) -> Path:
    folder = tmp_path / "pictures"
    folder.mkdir()
    random = np.random.default_rng(0)
    for number in range(10):
        small = random.random((6, 8, 3)).astype(np.float32) ** 3
        picture = cv2.resize(small, (48, 36), interpolation=cv2.INTER_LINEAR)
        cv2.imwrite(str(folder / f"{number:02}.png"), (picture * 150).clip(0, 255).astype(np.uint8))
    return folder


def train(
    name: str, data: Path, out: Path, *words: str, settings=FAST, steps: int = 20, quiet=True
) -> int:
    own = {word.partition("=")[0] for word in words}
    kept = [text for text in settings if text.partition("=")[0] not in own]
    sets = [word for text in kept for word in ("--set", text)]
    parts = ["train", name, "--data", str(data), "--out", str(out), "--steps", str(steps)]
    return run([*parts, *sets, *words, *(["-q"] if quiet else [])])


def mean_rows(path: Path, name: str) -> list[float]:
    return [float(row[name]) for row in read_curve(path)]


def test_ldenhancer_learns_and_its_weights_load(data, tmp_path, capsys):
    out = tmp_path / "run"
    settings = (*FAST, "learning_rate=2e-3", "smoothness=10")
    assert train("ldenhancer", data, out, settings=settings, steps=40) == 0
    losses = mean_rows(out / "curve.csv", "loss")
    assert losses[-1] < 0.9 * losses[0]
    assert "weights:" in capsys.readouterr().out
    names = {"dark_lift", "mean_after", "over_enhanced", "noise_gain"}
    assert names <= read_curve(out / "validation.csv")[-1].keys()
    weights = out / "ldenhancer.safetensors"
    dark = torch.full((1, 3, 32, 32), 0.1)
    trained = create_enhancer("ldenhancer", weights=weights)
    assert trained.enhance_batch(dark).mean() > dark.mean()
    config = json.loads((out / "config.json").read_text())
    assert config["loss"]["level"] == 0.34
    assert config["pictures"]["swap_red_blue"] == 0.5


def test_what_was_stopped_goes_on_to_the_same_weights(data, tmp_path, monkeypatch):
    whole, parts = tmp_path / "whole", tmp_path / "parts"
    settings = (*FAST, "checkpoint_every=4")
    assert train("ldenhancer", data, whole, settings=settings, steps=12) == 0
    done = []

    def stop(what):
        done.append(what)
        if len(done) == 10 + 7:  # pictures, then steps
            raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(Bars, "__call__", lambda _self, _done, what: stop(what))
        assert train("ldenhancer", data, parts, settings=settings, steps=12) == 130
    # Threads that read ahead change nothing either.
    assert train("ldenhancer", data, parts, settings=(*settings, "workers=2"), steps=12) == 0
    first, second = (read_checkpoint(one / "ldenhancer.safetensors") for one in (whole, parts))
    assert all(torch.equal(value, second[key]) for key, value in first.items())
    assert (whole / "curve.csv").read_text() == (parts / "curve.csv").read_text()


@pytest.mark.gpu
@pytest.mark.parametrize("name", ["ldenhancer", "dcepp", "highlightnet", "ruas"])
def test_they_train_on_cuda_in_mixed_precision(name, data, tmp_path):
    if not torch.cuda.is_available():
        pytest.skip("there is no CUDA device")
    settings = ("size=64", "crop=0", "held_out=2", "log_every=5", "checkpoint_every=5")
    settings += ("mixed_precision=true", "recalibrate=2", "workers=2", "schedule=constant")
    out, words = tmp_path / "run", ("--device", "cuda")
    assert train(name, data, out, *words, settings=settings, steps=10) == 0
    assert train(name, data, out, *words, settings=settings, steps=15) == 0  # goes on
    rows = read_curve(out / "curve.csv")
    assert [int(row["step"]) for row in rows] == [5, 10, 15]
    assert all(np.isfinite(float(value)) for row in rows for value in row.values())
    on_cpu = create_enhancer(name, weights=out / f"{name}.safetensors")
    assert on_cpu.enhance_batch(torch.full((1, 3, 64, 64), 0.1)).isfinite().all()


@pytest.mark.parametrize("name", ["dcepp", "darklighter", "highlightnet", "ruas"])
def test_others_train_with_the_same_loop(name, data, tmp_path, capsys):
    size = "size=256" if name == "darklighter" else "size=32"
    settings = (size, "batch_size=1", "held_out=0", "log_every=1", "crop=0")
    out = tmp_path / "run"
    assert train(name, data, out, settings=settings, steps=3, quiet=False) == 0
    fresh = create_enhancer(name, weights=out / f"{name}.safetensors")
    assert fresh.enhance_batch(torch.full((1, 3, 24, 24), 0.1)).isfinite().all()
    assert ("without the VGG term" in capsys.readouterr().err) == (name == "darklighter")
    state = read_checkpoint(tmp_path / "run" / f"{name}.safetensors")
    assert all(bool(value.isfinite().all()) for value in state.values())


def test_somebody_elses_enhancer_trains(data, tmp_path, capsys):
    plugin = tmp_path / "plugin.py"
    plugin.write_text(PLUGIN)
    settings = ("size=32", "learning_rate=0.05", "log_every=5", "epochs=0", "best=-mean_after")
    words = ("--plugin", str(plugin), "--json")
    assert train("gain_net", data, tmp_path / "run", *words, settings=settings, steps=40) == 0
    document = json.loads(capsys.readouterr().out)["training"]
    assert document["training"]["steps"] == 40
    assert document["training"]["best_step"] is not None
    assert document["pictures"] == 8
    losses = mean_rows(tmp_path / "run" / "curve.csv", "error")
    assert losses[-1] < 0.2 * losses[0]


def test_the_ablation_trains_all_variants(data, tmp_path, capsys, night_clip):
    words = ("--ablation", "--seeds", "2", "--json")
    assert train("ldenhancer", data, tmp_path / "run", *words, steps=1) == 0
    document = json.loads(capsys.readouterr().out)
    assert list(document["ablation"]) == ["baseline", "+TB", "+TB+LS", "+TB+LS+TF"]
    lift = document["ablation"]["+TB"]["dark_lift"]
    assert lift["least"] <= lift["mean"] <= lift["most"]
    assert len(document["trainings"]) == 8
    assert train("ldenhancer", data, tmp_path / "run", *words[:3], steps=1) == 0
    shown = capsys.readouterr().out
    assert "±" in shown
    assert "±nan" not in shown
    script = tmp_path / "run" / "track.sh"
    assert f"sh {script} --tracker" in shown
    # What the script says runs all variants, and the table knows every one of them.
    words = shlex.split(script.read_text().replace("#!/bin/sh\n", "").replace("\\\n", " "))
    place = words.index("$@")
    results = ["--results", str(tmp_path / "results")]
    mine = ["--dataset", str(night_clip), "--sequences", "wide", "--backend", "torch", *results]
    assert words[:place] == ["nat-bench", "run"]
    assert run(["run", "--tracker", "mosse", *mine, *words[place + 1 :]]) == 0
    capsys.readouterr()
    assert run(["table", "--layout", "ablation", *results]) == 0
    shown = capsys.readouterr().out
    for label in (
        "+Baseline",
        "+Baseline+TB",
        "+Baseline+TB+LS",
        "+Baseline+TB+LS+TF (LDEnhancer)",
    ):
        assert re.search(rf"^ {re.escape(label)} +2 ", shown, re.MULTILINE), shown


def test_tracking_validates(data, tmp_path, night_clip):
    words = ("--validate-sequences", str(night_clip), "--best", "success")
    settings = ("size=32", "held_out=0", "crop=16")
    assert train("ldenhancer", data, tmp_path / "run", *words, settings=settings, steps=1) == 0
    rows = read_curve(tmp_path / "run" / "validation.csv")
    assert len(rows) == 1
    assert 0 <= float(rows[0]["success"]) <= 1
    assert float(rows[0]["success_gain"]) == pytest.approx(0, abs=1)


def test_labels_are_kept_beside_the_data_and_made_once(data, tmp_path, monkeypatch):
    train("ldenhancer", data, tmp_path / "a", steps=1)
    (folder,) = (data / ".nat-bench").iterdir()
    assert folder.name == "32-resize-light-lam500-passes3-excess"
    kept = sorted(folder.iterdir())
    assert len(kept) == 10
    before = {path.name: path.read_bytes() for path in kept}
    kept[0].unlink()  # as a killed process leaves it: some are missing, a temporary file is there
    kept[1].write_bytes(b"damaged")
    kept[2].write_bytes(kept[2].read_bytes()[:-200])
    train("ldenhancer", data, tmp_path / "b", steps=1)
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before

    def never(*_args):
        raise AssertionError

    monkeypatch.setattr("nat2024_enhancers.ldenhancer.light_label.separate", never)
    store = PictureStore(
        find_shots(data, None, 0)[1], PictureSettings(size=32), folder=folder, names=("a", "b")
    )
    image, light, content = store.load(0).astype(int)
    assert np.abs(image - light - content).max() <= 1
    other = ("--cache", str(tmp_path / "cache"), "--set", "lam=50")
    monkeypatch.undo()
    train("ldenhancer", data, tmp_path / "c", *other, steps=1)
    assert [path.name for path in (tmp_path / "cache").iterdir()] == [
        "32-resize-light-lam50-passes3-excess"
    ]


def test_every_fiftieth_frame_of_a_dataset_is_taken(night_clip):
    assert len(find_shots(night_clip, None, 0)[1]) == 3
    assert len(find_shots(night_clip, None, 3)[1]) == 9


def test_batches_are_functions_of_the_step(data):
    settings = PictureSettings(size=32, fit="crop", crop=16, mirror=0.5, swap_red_blue=0.5)
    store = PictureStore(find_shots(data, None, 0)[1], settings)
    first = PictureBatches(store, range(8), settings, 4, 0, 10)
    second = PictureBatches(store, range(8), settings, 4, 0, 10)
    for step in (5, 2):
        one, other = first.draw(step), second.draw(step)
        assert one["image"].shape == (4, 3, 16, 16)
        assert one["place"] == other["place"]
        assert torch.equal(one["image"], other["image"])
    assert not torch.equal(first.draw(0)["image"], first.draw(1)["image"])


def test_an_epoch_sees_every_picture_once(data):
    settings = PictureSettings(size=32)
    store = PictureStore(find_shots(data, None, 0)[1], settings)
    batches = PictureBatches(store, range(8), settings, 4, 0, 10)
    seen = torch.cat([batches.draw(step)["image"] for step in (2, 3)]).mean(dim=(1, 2, 3))
    wanted = [store.load(number).mean() / 255 for number in range(8)]
    assert sorted(seen.tolist()) == pytest.approx(sorted(wanted), rel=1e-4)


def test_pictures_are_brought_to_size():
    picture = np.zeros((30, 80, 3), np.uint8)
    assert fit_picture(picture, PictureSettings(size=32)).shape == (32, 32, 3)
    cropped = fit_picture(picture, PictureSettings(size=32, fit="crop"))
    assert cropped.shape[0] == 32
    assert cropped.shape[1] in (85, 86)


def test_presets():
    loop, pictures, own = choose_settings("ldenhancer", "paper")
    assert (loop.epochs, loop.learning_rate, loop.clip, loop.batch_size) == (100, 1e-6, 0.1, 4)
    assert (pictures.crop, own.level, own.smoothness) == (0, 0.6, 1000)
    assert choose_settings("ldenhancer", "adaptive")[2].smoothness == 5
    assert choose_settings("ldenhancer", "bright")[2].level == 0.5


BAD = {
    "no such setting": (["--set", "levl=1"], "training has no setting 'levl'; closest: level"),
    "no such preset": (["--preset", "papr"], "no training preset 'papr'; closest: paper"),
    "bad value": (["--set", "mirror=2"], "training setting mirror=2: expected `float` <= 1.0"),
    "large crop": (["--set", "crop=64"], "crop=64 is larger than size=32"),
    "tracker alone": (["--validate-tracker", "fdsst"], "needs --validate-sequences"),
    "wrong best": (["--best", "dark_lft"], "has no number 'dark_lft'; closest: dark_lift"),
    "best of nothing": (["--best", "success", "--set", "held_out=0"], "there is no validation"),
    "patience": (["--set", "patience=2"], "patience=2 needs best"),
    "two branches": (["--opt", "two_branch=false"], "needs light_loss=false"),
}


@pytest.mark.parametrize("case", BAD)
def test_wrong_words_are_one_line(case, data, tmp_path, capsys):
    words, message = BAD[case]
    assert train("ldenhancer", data, tmp_path / "run", *words) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert not list(tmp_path.glob("run/checkpoints/*"))


def test_names_of_the_validation_are_known_beforehand(data, night_clip):
    pictures = [np.full((32, 32, 3), 20, np.uint8)]
    tracking = Tracking(("fdsst",), tuple(load_dataset(night_clip))[:1])
    for validation in (
        EnhancerValidation(create_enhancer("gamma"), pictures),
        EnhancerValidation(create_enhancer("gamma"), (), tracking),
    ):
        assert list(validation(None)) == list(validation.names)


def test_numbers_that_are_not_there_are_a_dash(data, tmp_path, capsys):
    """No pixel of these pictures is bright, so that none can be enhanced too much."""
    assert train("dcepp", data, tmp_path / "run", "--ablation", steps=1) == 2
    assert "dcepp has no variants for an ablation" in capsys.readouterr().err
    assert train("dcepp", data, tmp_path / "run", steps=1) == 0
    shown = capsys.readouterr().out
    assert " ".join(["over_enhanced", "-"]) in " ".join(shown.split())
    assert "nan" not in shown


def test_bad_data_is_one_line(data, tmp_path, capsys):
    empty = tmp_path / "empty"
    empty.mkdir()
    (empty / "readme.txt").write_text("no picture")
    assert train("ldenhancer", empty, tmp_path / "a") == 2
    assert "no images in it" in capsys.readouterr().err
    (empty / "torn.png").write_bytes(b"\x89PNG\r\n\x1a\n")
    assert train("ldenhancer", empty, tmp_path / "b") == 2
    assert "none of 1 pictures can be read" in capsys.readouterr().err
    (data / "torn.png").write_bytes(b"\x89PNG\r\n\x1a\n")
    (data / "notes.md").write_text("mixed")
    assert (
        run(
            ["train", "dcepp", "--data", str(data), "--out", str(tmp_path / "c"), "--steps", "1"]
            + ["--set", "size=32", "--set", "crop=0"]
        )
        == 0
    )
    assert "1 of 11 pictures cannot be read: left out" in capsys.readouterr().err


def test_a_folder_of_another_training_is_refused(data, tmp_path, capsys):
    out = tmp_path / "run"
    assert train("dcepp", data, out, steps=2) == 0
    weights = (out / "dcepp.safetensors").read_bytes()
    assert train("dcepp", data, out, "--set", "level=0.3", steps=2) == 2
    assert "another configuration (loss.level 0.35 there, 0.3 now)" in capsys.readouterr().err
    assert (out / "dcepp.safetensors").read_bytes() == weights
    other = ("--opt", "scale_factor=4")
    assert train("dcepp", data, out, *other, steps=2) == 2
    assert "(options.scale_factor 12 there, 4 now)" in capsys.readouterr().err
    # How it runs when it is trained is no part of the training.
    assert train("dcepp", data, out, "--opt", "clamp=false", steps=2) == 0


def test_what_has_no_loss_cannot_be_trained(data, tmp_path, capsys):
    assert train("clahe", data, tmp_path / "run") == 2
    assert "clahe cannot be trained: it has no network with loss" in capsys.readouterr().err
    for name in ("sct", "llve", "kindpp"):
        assert train(name, data, tmp_path / "run") == 2
        assert f"{name} cannot be trained: it" in (error := capsys.readouterr().err)
        assert "pairs of a dark and a bright image" in error


def test_settings_are_shown(capsys):
    words = ["train", "ldenhancer", "--settings", "--json"]
    assert run([*words, "--preset", "bright"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["presets"] == ["default", "paper", "adaptive", "bright"]
    assert document["settings"]["level"] == 0.5
    assert run(["train", "ldenhancer"]) == 2
    assert "--data is missing" in capsys.readouterr().err
