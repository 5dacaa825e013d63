import os
import shutil
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from nat2024.boxes import write_boxes
from nat2024.datasets import load_dataset
from nat2024.errors import FrameUnreadable
from nat2024.evaluation import evaluate
from nat2024.evidence import Evidence, correlate_gains, gains_and_light, gather
from nat2024.evidence.keeping import FOLDER
from nat2024.store import DatasetRecord, Manifest, PluginRecord, RunFolder
from nat2024.types import Dataset, Sequence


class NoFrames:
    """Frames that are nowhere."""

    frame_size = (160, 96)

    def __init__(self, count: int) -> None:
        self._count = count

    def __len__(self) -> int:
        return self._count

    def __getitem__(self, index: int) -> np.ndarray:
        msg = "there are no images"
        raise FrameUnreadable(msg)


@pytest.fixture
def results(night_clip: Path, tmp_path: Path) -> tuple[Dataset, Path]:
    """Two runs on `night_clip`: mosse is given the truth, mosse+gamma jumps away at frame 3."""
    dataset = load_dataset(night_clip)
    folder = tmp_path / "results"
    made = DatasetRecord(dataset.name, str(night_clip))
    mosse, gamma = PluginRecord("mosse"), PluginRecord("gamma", options={"gamma": 0.5})
    plain = RunFolder(folder / dataset.name / "mosse")
    plain.write_manifest(Manifest(dataset=made, tracker=mosse))
    enhanced = RunFolder(folder / dataset.name / "mosse+gamma")
    enhanced.write_manifest(Manifest(dataset=made, tracker=mosse, enhancer=gamma))
    for sequence in dataset:
        away = sequence.boxes + np.array([500, 500, 0, 0])
        away[:3] = sequence.boxes[:3]
        write_boxes(plain.box_file(sequence.name), sequence.boxes)
        write_boxes(enhanced.box_file(sequence.name), away)
    return dataset, folder


def gathered(results: tuple[Dataset, Path], **options: object) -> tuple[Evidence, int]:
    dataset, folder = results
    frames: list[int] = []
    evidence = gather(
        evaluate(folder, dataset),
        dataset,
        folder,
        loss_frames=3,
        on_frame=lambda: frames.append(1),
        **options,  # type: ignore[arg-type]
    )
    return evidence, len(frames)


def test_losses_light_and_thumbnails_are_gathered(results: tuple[Dataset, Path]) -> None:
    evidence, _ = gathered(results)
    table = evidence.failures().set_index(["run", "sequence"])
    assert evidence.notes == ()
    lost = table.loc[("mosse+gamma", "narrow")]
    assert (lost["first_loss"], lost["lost"], lost["recoveries"]) == (3, 5, 0)
    assert lost["enhancer"] == "gamma"
    assert 0 < lost["luminance_at_loss"] < 1
    assert 0 < evidence.light()["target_luminance"].max() < 1
    assert lost["unevenness_at_loss"] >= 0
    track = evidence["narrow"].tracks["mosse+gamma"]
    assert track.overlap[:3].tolist() == [1, 1, 1]
    assert track.overlap[3:].tolist() == [0] * 5
    light = evidence.light().set_index("sequence")
    assert light.loc["wide", "frames"] == 8
    for thumbnail in evidence["narrow"].thumbnails:
        picture = cv2.imdecode(np.frombuffer(thumbnail.jpeg, np.uint8), cv2.IMREAD_COLOR)
        assert picture.shape == (thumbnail.height, thumbnail.width, 3)
        assert set(thumbnail.boxes) == {"mosse", "mosse+gamma"}
        x, y, w, h = thumbnail.truth or (-1, -1, 0, 0)
        assert x >= 0
        assert y >= 0
        assert x + w <= thumbnail.width
        assert y + h <= thumbnail.height
    reasons = {r for t in evidence["narrow"].thumbnails for r in t.reasons}
    assert {"first loss", "largest harm"} <= reasons


def test_thumbnails_show_the_frame_where_their_numbers_say(tmp_path: Path) -> None:
    images, boxes = [], []
    for step in range(12):
        image = np.zeros((120, 200, 3), np.uint8)
        image[40:60, 10 + step * 5 : 30 + step * 5] = 255
        images.append(image)
        boxes.append([10 + step * 5, 40, 20, 20])
    rendered = tmp_path / "moving"
    (rendered / "data_seq" / "a").mkdir(parents=True)
    for number, image in enumerate(images, 1):
        cv2.imwrite(str(rendered / "data_seq" / "a" / f"{number:05d}.png"), image)
    write_boxes(rendered / "anno" / "a.txt", np.array(boxes, dtype=float))
    dataset = load_dataset(rendered)
    write_boxes(tmp_path / "r" / "moving" / "t" / "a.txt", np.array(boxes, dtype=float))
    evidence = gather(evaluate(tmp_path / "r", dataset), dataset, tmp_path / "r")
    for thumbnail in evidence["a"].thumbnails:
        picture = cv2.imdecode(np.frombuffer(thumbnail.jpeg, np.uint8), cv2.IMREAD_GRAYSCALE)
        assert thumbnail.truth is not None
        x, y, w, h = (round(value) for value in thumbnail.truth)
        assert picture[y + 3 : y + h - 3, x + 3 : x + w - 3].min() > 200
        outside = picture.copy()
        outside[y - 3 : y + h + 3, x - 3 : x + w + 3] = 0
        assert outside.max() < 60


def test_what_is_kept_is_taken_and_what_has_changed_is_not(results: tuple[Dataset, Path]) -> None:
    dataset, folder = results
    first, decoded = gathered(results)
    again, none = gathered(results)
    assert decoded > 0
    assert none == 0
    assert first.failures().equals(again.failures())
    assert [s.thumbnails for s in first.sequences] == [s.thumbnails for s in again.sequences]

    box_file = folder / dataset.name / "mosse+gamma" / "narrow.txt"
    moved = dataset["narrow"].boxes + np.array([500, 500, 0, 0])
    moved[:5] = dataset["narrow"].boxes[:5]
    write_boxes(box_file, moved)
    changed, _ = gathered(results)
    assert changed["narrow"].tracks["mosse+gamma"].first_loss == 5

    frame = dataset["wide"].frames.path(0)  # type: ignore[attr-defined]
    before = frame.read_bytes()
    try:
        cv2.imwrite(str(frame), np.full((96, 160, 3), 200, np.uint8))
        os.utime(frame, ns=(1, 1))
        brighter, _ = gathered(results)
    finally:
        frame.write_bytes(before)
    light, old = brighter["wide"].light, first["wide"].light
    assert light is not None
    assert old is not None
    assert light.mean[0] > 0.7 > old.mean[0]
    assert light.mean[1:].tolist() == old.mean[1:].tolist()


def test_it_may_be_deleted_or_damaged_or_not_kept(results: tuple[Dataset, Path]) -> None:
    dataset, folder = results
    kept = folder / dataset.name / FOLDER
    first, _ = gathered(results, store=False)
    assert not kept.exists()
    gathered(results)
    files = sorted(kept.iterdir())
    assert [file.stem for file in files] == ["narrow", "tall", "wide"]
    for file in files:
        file.write_bytes(b"nonsense")
    repaired, decoded = gathered(results)
    assert decoded > 0
    assert repaired.failures().equals(first.failures())


def test_without_images_the_rest_is_made(results: tuple[Dataset, Path]) -> None:
    dataset, folder = results
    bare = replace(
        dataset,
        sequences=tuple(Sequence(s.name, NoFrames(len(s)), s.boxes) for s in dataset),
    )
    evidence, decoded = gathered((bare, folder))
    assert decoded == 0
    assert evidence.notes == ("no readable images of any sequence: no light and no thumbnails",)
    assert evidence.light().empty
    assert evidence.failures()["lost"].sum() == 15
    assert all(not s.thumbnails for s in evidence.sequences)


def test_a_frame_that_cannot_be_read_is_named_and_left_out(results: tuple[Dataset, Path]) -> None:
    dataset, _ = results
    frame = dataset["wide"].frames.path(3)  # type: ignore[attr-defined]
    before = frame.read_bytes()
    try:
        frame.write_bytes(b"no image")
        evidence, _ = gathered(results)
    finally:
        frame.write_bytes(before)
    (note,) = evidence.notes
    assert note.startswith("wide: 1 frame cannot be read, such as ")
    light = evidence["wide"].light
    assert light is not None
    assert np.isnan(light.mean).tolist() == [False] * 3 + [True] + [False] * 4
    assert evidence["wide"].tracks["mosse+gamma"].at_loss is not None


def test_boxes_that_are_no_numbers_or_missing_are_misses(results: tuple[Dataset, Path]) -> None:
    dataset, folder = results
    boxes = dataset["tall"].boxes.copy()
    boxes[2:6] = np.nan
    write_boxes(folder / dataset.name / "mosse" / "tall.txt", boxes)
    evidence, _ = gathered(results, frames=False)
    track = evidence["tall"].tracks["mosse"]
    assert track.overlap.tolist() == [1, 1, 0, 0, 0, 0, 1, 1]
    assert np.isnan(track.center_error[2:6]).all()
    assert (track.first_loss, track.failure.recoveries) == (2, 1)
    assert track.box_at(3) is None
    assert track.box_at(99) is None


def test_the_enhancer_of_a_run_is_made_again(results: tuple[Dataset, Path]) -> None:
    dataset, folder = results
    evidence, _ = gathered(results)
    over = evidence["narrow"].tracks["mosse+gamma"].at_loss
    assert over is not None
    assert np.isnan(over.over_enhancement) or 0 <= over.over_enhancement <= 1
    manifest = folder / dataset.name / "mosse+gamma" / "run.json"
    manifest.write_text(manifest.read_text().replace('"name": "gamma"', '"name": "gone"'))
    for file in (folder / dataset.name / FOLDER).iterdir():
        file.unlink()
    evidence, _ = gathered(results)
    (note,) = evidence.notes
    assert note.startswith("no over-enhancement by gone is measured: ")
    manifest.unlink()
    assert gathered(results)[0].notes == ()


def test_truth_on_some_frames_only(results: tuple[Dataset, Path]) -> None:
    dataset, folder = results
    sequence = dataset["wide"]
    keyframes = np.array([0, 3, 5, 7])
    sparse = np.full_like(sequence.boxes, np.nan)
    sparse[keyframes] = sequence.boxes[keyframes]
    some = replace(dataset, sequences=(replace(sequence, boxes=sparse, keyframes=keyframes),))
    evidence, _ = gathered((some, folder))
    track = evidence["wide"].tracks["mosse+gamma"]
    assert track.frames.tolist() == [0, 3, 5, 7]
    assert track.first_loss == 3
    assert {t.frame for t in evidence["wide"].thumbnails} <= {0, 3, 5, 7}


def test_gains_stand_beside_the_light_of_their_sequences(results: tuple[Dataset, Path]) -> None:
    dataset, folder = results
    evaluation = evaluate(folder, dataset)
    evidence = gather(evaluation, dataset, folder, enhance=False)
    table = gains_and_light(evaluation, evidence)
    assert table.sequence.tolist() == ["narrow", "tall", "wide"]
    assert set(table.run) == {"mosse+gamma"}
    assert (table.gain < -0.3).all()
    light = evidence.light().set_index("sequence")
    assert table.unevenness.tolist() == light.unevenness.tolist()
    found = correlate_gains(table)
    assert list(found) == ["gamma"]
    assert found["gamma"].pairs == 3
    bare = gather(evaluation, dataset, folder, frames=False)
    assert gains_and_light(evaluation, bare).empty
    assert correlate_gains(gains_and_light(evaluation, bare)) == {}


def test_results_in_an_archive_have_evidence_that_is_not_kept(
    results: tuple[Dataset, Path], tmp_path: Path
) -> None:
    dataset, folder = results
    archive = Path(shutil.make_archive(str(tmp_path / "packed"), "zip", folder))
    evidence, looked = gathered((dataset, archive))
    assert evidence.notes[0] == "nothing that is seen is kept: the results lie in an archive"
    assert len(evidence["narrow"].thumbnails) >= 1
    assert (looked, evidence.notes) == (gathered((dataset, archive))[1], evidence.notes)
