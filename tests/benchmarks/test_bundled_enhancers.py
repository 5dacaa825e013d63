"""The script that compares bundled weights with the authors'."""

import json
import subprocess
import sys
from pathlib import Path

import bundled_enhancers
import cv2
import numpy as np
import pytest
from bundled_enhancers import MARKERS, image_table, measure_images, read_video, tracking_table

from nat2024 import create_enhancer
from nat2024.testing.enhancers import night_image

SCRIPT = Path(bundled_enhancers.__file__)
ROW = {
    "dark_gain": 10.0,
    "over_enhanced": 1.0,
    "bright_rise": 0.05,
    "saturated": 0.001,
    "noise_gain": 1.5,
    "cast": 0.01,
    "explained": 1.0,
    "verdict": "a fixed tone curve",
}
RUN = {"auc": 0.5, "precision_20": 0.75, "distance": 4.25}


def test_gains_are_shown_as_shares_of_the_authors():
    rows = [
        {"enhancer": "dcepp, authors'", **ROW},
        {"enhancer": "dcepp, bundled", **ROW, "dark_gain": 9.0, "explained": float("nan")},
    ]
    lines = image_table(rows).splitlines()
    assert "| 9.0 | 90% | 100.0% | 0.050 | 0.10% | 1.50 | 0.010 | - |" in lines[3]
    assert {line.count("|") for line in lines} == {11}


def test_a_column_for_each_number_of_a_run():
    runs = {"v3 clip": {**RUN, "starts": 0.25}, "v2 clip": {**RUN, "starts": 0.125}, "v3 dark": RUN}
    clip, dark = tracking_table([{"enhancer": "none", **ROW, **runs}]).split("\n\n")
    columns = "AUC | v{0}: AUC of 5 starts | v{0}: P20 | v{0}: distance"
    head = " | ".join(f"v{number}: {columns.format(number)}" for number in (3, 2))
    assert clip.splitlines()[0] == f"| clip | {head} |"
    assert clip.splitlines()[2].endswith("| 0.750 | 4.2 | 0.500 | 0.125 | 0.750 | 4.2 |")
    assert dark.splitlines()[2] == "| none | 0.500 | 0.750 | 4.2 |"


def test_what_is_done_to_images_is_measured():
    bright = night_image(64, 64)
    bright[:16] = 200
    found = measure_images(create_enhancer("gamma", gamma=0.5), [bright])
    old = bright.astype(float) / 255
    luminance = [image @ (0.299, 0.587, 0.114) for image in (old, np.sqrt(old))]
    dark = luminance[0] < 50 / 255
    assert found["dark_gain"] == pytest.approx(
        255 * (luminance[1] - luminance[0])[dark].mean(), rel=0.02
    )
    assert found["over_enhanced"] == 1
    assert found["bright_rise"] == pytest.approx((200 / 255) ** 0.5 - 200 / 255, abs=0.005)


@pytest.mark.parametrize("every", [True, False])
@pytest.mark.slow
def test_sequences_with_all_boxes_and_with_key_frames(every, tmp_path):
    (tmp_path / "data_seq" / "clip").mkdir(parents=True)
    for number in range(1, 4):
        cv2.imwrite(str(tmp_path / "data_seq" / "clip" / f"{number:05d}.jpg"), night_image(8, 8))
    folder = tmp_path / ("anno" if every else "anno_keyframes")
    folder.mkdir()
    rows = ["1,2,3,4", "2,2,3,4", "3,2,3,4"] if every else ["1,1,2,3,4", "3,3,2,3,4"]
    (folder / "clip.txt").write_text("\n".join(rows) + "\n")
    video = read_video(tmp_path, "clip")
    assert len(video.frames) == 3
    assert sorted(video.boxes) == ([0, 1, 2] if every else [0, 2])
    assert list(video.boxes[2]) == [3, 2, 3, 4]


@pytest.mark.slow
def test_it_measures_once_and_updates_a_page(tmp_path):
    folder = tmp_path / "images"
    folder.mkdir()
    for seed in range(2):
        image = np.random.default_rng(seed).integers(0, 60, (48, 64, 3), dtype=np.uint8)
        cv2.imwrite(str(folder / f"{seed}.png"), image)
    page, kept = tmp_path / "page.md", tmp_path / "kept.json"
    page.write_text(f"before\n{MARKERS[0][0]}\n{MARKERS[0][1]}\nafter\n")
    words = ["--images", str(folder), "--only", "dcepp", "--keep", str(kept), "--update", str(page)]
    command = [sys.executable, str(SCRIPT), *words]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert "dcepp, authors': left out, it needs --official" in done.stderr
    assert "| dcepp, bundled |" in page.read_text()
    assert len(json.loads(kept.read_text())) == 1
