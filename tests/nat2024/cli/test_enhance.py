"""`nat-bench enhance` as a user meets it."""

import csv
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    rng = np.random.default_rng(0)
    top = tmp_path / "night"
    top.mkdir()
    for number in range(3):
        image = rng.integers(0, 60, (40, 64, 3), dtype=np.uint8)
        image[4:9, 8 * number : 8 * number + 8] = 250
        cv2.imwrite(str(top / f"{number}.png"), image)
    return top


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_names_may_stand_apart_or_together(folder: Path, tmp_path: Path, cli: Any) -> None:
    out = tmp_path / "out"
    words = ("--enhancer", "none,gamma", "--enhancer", "gamma@b", "--opt", "gamma@b.gamma=0.3")
    status, printed, err = cli("enhance", folder, *words, "--out", out)
    assert (status, err) == (0, "")
    assert printed.splitlines() == [
        f"{out}/{name}: 3 images written" for name in ("none", "gamma", "gamma@b")
    ]
    means = [cv2.imread(str(out / n / "0.png")).mean() for n in ("none", "gamma", "gamma@b")]  # type: ignore[union-attr]
    assert means[0] < means[1] < means[2]
    status, printed, _ = cli("enhance", folder, *words, "--out", out)
    assert "0 images written, 3 finished before" in printed


def test_one_object_of_json(folder: Path, tmp_path: Path, cli: Any) -> None:
    (folder / "3.png").write_bytes(b"")
    out = tmp_path / "out"
    words = ("--enhancer", "gamma", "--out", out, "--sheet", tmp_path / "s.png", "--json")
    status, printed, err = cli("enhance", folder, *words)
    assert status == 1
    found = json.loads(printed)
    assert set(found) == {"source", "kind", "images", "enhancers", "failures", "pictures"}
    assert (found["kind"], found["images"]) == ("images", 4)
    assert found["enhancers"] == [
        {
            "enhancer": "gamma",
            "folder": str(out / "gamma"),
            "written": 3,
            "finished_before": 0,
            "failed": 1,
        }
    ]
    (failure,) = found["failures"]
    assert (failure["enhancer"], failure["image"]) == ("gamma", "3.png")
    assert "3.png" in err
    assert found["pictures"] == [str(tmp_path / "s.png"), str(tmp_path / "s.csv")]


def test_pictures_carry_their_numbers(folder: Path, tmp_path: Path, cli: Any) -> None:
    words = ("--enhancer", "none,gamma", "--out", tmp_path / "out", "--show", 2)
    pictures = ("--sheet", tmp_path / "a.pdf", "--strip", tmp_path / "b.jpg")
    inset = ("--strip-image", "1.png", "--inset", "0,0,20,10")
    status, printed, err = cli("enhance", folder, *words, *pictures, *inset)
    assert status == 0
    assert "2 of 3 images" in err
    assert (tmp_path / "a.pdf").read_bytes().startswith(b"%PDF")
    assert cv2.imread(str(tmp_path / "b.jpg")) is not None
    sheet = rows(tmp_path / "a.csv")
    assert [(r["image"], r["column"]) for r in sheet] == [
        ("0.png", "input"),
        ("0.png", "gamma"),
        ("2.png", "input"),
        ("2.png", "gamma"),
    ]
    assert float(sheet[0]["mean"]) < float(sheet[1]["mean"])
    strip = rows(tmp_path / "b.csv")
    assert [(r["image"], r["column"], r["w"]) for r in strip] == [
        ("1.png", "input", "20"),
        ("1.png", "gamma", "20"),
    ]
    assert str(tmp_path / "a.pdf") in printed
    # drawn from what is stored, so the same call draws the same bytes
    before = (tmp_path / "a.pdf").read_bytes()
    cli("enhance", folder, *words, *pictures, *inset)
    assert (tmp_path / "a.pdf").read_bytes() == before


@pytest.mark.shared
def test_maps_of_a_network(folder: Path, tmp_path: Path, cli: Any, shared: Path) -> None:
    checkpoint = shared / "parity" / "enhancers" / "checkpoints" / "ldenhancer_model.pth"
    words = ("--enhancer", "gamma,ldenhancer", "--weights", f"ldenhancer={checkpoint}")
    out = tmp_path / "out"
    status, _, err = cli("enhance", folder, *words, "--out", out, "--maps", "--show", 1)
    assert status == 0
    assert "gamma has no maps" in err
    made = out / "maps" / "ldenhancer" / "0.png"
    drawn = {path.stem for path in made.glob("*.png")}
    assert drawn == {"F0", "F1", "M", "O1", "O2", "P_S", "P_E", "A"}
    table = rows(made / "maps.csv")
    assert [r["channel"] for r in table if r["map"] == "P_S"][:4] == [
        "red, iteration 1",
        "green, iteration 1",
        "blue, iteration 1",
        "red, iteration 2",
    ]
    assert all(-1 <= float(r["min"]) <= float(r["max"]) <= 1 for r in table if r["map"] == "P_E")
    assert not (out / "maps" / "gamma").exists()


_NUMBERS = """
from nat2024.cards import Card
from nat2024.interfaces import Enhancer
from nat2024.registry import register_enhancer


@register_enhancer("numbers")
class Numbers(Enhancer):
    card = Card(title="Numbers", summary="Gives maps of any shape.")

    def enhance_batch(self, batch):
        return batch

    def maps(self, batch):
        if batch.shape[-1] == 65:
            raise RuntimeError("no such width")
        mean, first = batch.mean((2, 3)), batch[:, 0]
        return {"of the whole": mean, "one": mean[:, 0], "plain": first, "deep": batch[:, None]}
"""


@pytest.mark.usefixtures("small_plugins")  # which takes back what is registered meanwhile
def test_maps_of_any_shape_and_one_that_fails(folder: Path, tmp_path: Path, cli: Any) -> None:
    (tmp_path / "p.py").write_text(_NUMBERS)
    cv2.imwrite(str(folder / "a b.png"), np.full((40, 65, 3), 9, np.uint8))
    words = ("--plugin", tmp_path / "p.py", "--enhancer", "numbers", "--maps")
    status, _, err = cli("enhance", folder, *words, "--out", tmp_path / "out")
    assert status == 1
    assert err == "nat-bench: numbers, maps of a b.png: RuntimeError: no such width\n"
    made = tmp_path / "out" / "maps" / "numbers" / "0.png"
    assert {path.name for path in made.iterdir()} == {"plain.png", "deep.png", "maps.csv"}
    channels = [row["map"] for row in rows(made / "maps.csv")]
    assert channels == [*3 * ["of the whole"], "one", "plain", *3 * ["deep"]]


def test_a_dataset_stays_one(night_clip: Path, tmp_path: Path, cli: Any) -> None:
    words = ("--enhancer", "gamma", "--sequences", "tall,wide", "--out", tmp_path)
    assert cli("enhance", night_clip, *words)[0] == 0
    status, printed, _ = cli("dataset", "info", tmp_path / "gamma", "--json")
    assert status == 0
    assert json.loads(printed)["name"] == "gamma"


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--enhancer", "gama"], "closest: gamma"),
        (["--enhancer", "mil"], "mil is a tracker"),
        (["--enhancer", ","], "at least one enhancer"),
        (["--enhancer", "gamma,gamma"], "named twice"),
        (["--enhancer", "gamma", "--opt", "clahe.tiles=2"], "which is not run"),
        (["--enhancer", "gamma", "--sheet", "a.gif"], "ends in .png"),
        (["--enhancer", "gamma", "--inset", "1,2,3,4"], "belong to --strip"),
        (["--enhancer", "gamma", "--strip", "a.png", "--inset", "1,2,3"], "four whole numbers"),
        (["--enhancer", "gamma", "--strip", "a.png", "--inset", "0,0,99,9"], "does not lie in"),
        (["--enhancer", "gamma", "--strip", "a.png", "--strip-image", "9.png"], "has no image"),
        (["--enhancer", "gamma", "--sheet", "s.png", "--strip", "s.pdf"], "written twice"),
        (
            ["--enhancer", "gamma", "--measure", "--measure-csv", "s.csv", "--sheet", "s.png"],
            "written twice",
        ),
        (["--enhancer", "gamma", "--sheet", f"{__file__}/s.png"], "cannot be written"),
        (["--enhancer", "gamma", "--sequences", "a"], "read as images"),
        (["--enhancer", "gamma", "--device", "cuda:99"], "is not there"),
    ],
)
def test_wrong_words_are_one_line_and_write_nothing(
    folder: Path, tmp_path: Path, cli: Any, words: list[str], told: str
) -> None:
    status, printed, err = cli("enhance", folder, *words, "--out", tmp_path / "out")
    assert (status, printed) == (2, "")
    assert told in err
    assert len(err.splitlines()) == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("shape", [(1, 1, 3), (3, 5000, 3), (5000, 3, 3)])
def test_odd_sizes_and_their_pictures(
    tmp_path: Path, cli: Any, shape: tuple[int, int, int]
) -> None:
    (tmp_path / "in").mkdir()
    cv2.imwrite(str(tmp_path / "in" / "a.png"), np.full(shape, 30, np.uint8))
    pictures = ("--sheet", tmp_path / "s.png", "--strip", tmp_path / "t.png")
    words = ("--enhancer", "gamma,clahe", "--out", tmp_path / "out", *pictures)
    status, _, err = cli("enhance", tmp_path / "in", *words)
    assert (status, err) == (0, "")
    stored = cv2.imread(str(tmp_path / "out" / "gamma" / "a.png"))
    assert stored is not None
    assert stored.shape == shape


def test_sixteen_bits_are_told_once(folder: Path, tmp_path: Path, cli: Any) -> None:
    for name in ("a", "b"):
        cv2.imwrite(str(folder / f"{name}.png"), np.full((9, 9, 3), 9999, np.uint16))
    words = ("--enhancer", "gamma,none", "--out", tmp_path / "out")
    status, _, err = cli("enhance", folder, *words)
    assert status == 0
    assert err == "nat-bench: a.png: 16 bits a channel, reduced to 8\n"


def test_a_killed_run_leaves_whole_images_and_goes_on(tmp_path: Path, cli: Any) -> None:
    folder, out = tmp_path / "night", tmp_path / "out"
    folder.mkdir()
    image = np.random.default_rng(0).integers(0, 90, (300, 400, 3), dtype=np.uint8)
    for number in range(40):
        cv2.imwrite(str(folder / f"{number:02d}.png"), image)
    words = ["enhance", str(folder), "--enhancer", "clahe", "--out", str(out)]
    process = subprocess.Popen([sys.executable, "-m", "nat2024", *words])
    waited = time.monotonic() + 60
    while len(list((out / "clahe").glob("*.png"))) < 3 and time.monotonic() < waited:
        time.sleep(0.01)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    whole = sorted((out / "clahe").glob("[0-9]*.png"))
    assert 3 <= len(whole) < 40
    for path in whole:
        assert cv2.imread(str(path)).shape == image.shape  # type: ignore[union-attr]
    status, printed, _ = cli(*words)
    assert status == 0
    assert f"{40 - len(whole)} images written, {len(whole)} finished before" in printed
    assert len(list((out / "clahe").iterdir())) == 40
