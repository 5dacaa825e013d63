import numpy as np
import pytest

import nat2024
from nat2024.datasets import load_dataset, validate, write_sequence
from nat2024.errors import UsageError
from nat2024.night import NightSequence, NightSettings
from nat2024.night.sample import QUALITY, SAMPLE, SEEDS
from nat2024.synthesis import darken, read_photographs, synthesize

SMALL = [
    NightSettings("bike", frames=30, size=(240, 136), seed=3, occlusion="full"),
    NightSettings("bike", frames=3, size=(240, 136), seed=4),
]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("made") / "night"
    return folder, synthesize(folder, SMALL)


def test_a_rendered_dataset_loads_with_everything_that_is_known(made):
    folder, report = made
    dataset = load_dataset(folder)
    assert [s.name for s in dataset] == ["bike1", "bike2"] == [one.name for one in report]
    hidden = dataset["bike1"]
    absent = ~np.isfinite(hidden.boxes).all(axis=1)
    assert absent.any()
    assert np.array_equal(hidden.visible, ~absent)
    assert "FOC" in hidden.attributes
    assert hidden.attributes == set(report[0].attributes)
    assert hidden.category == "bike"
    assert hidden.frame_size == (240, 136)
    assert dataset["bike2"].visible.all()
    assert (folder / "att" / "bike1.txt").read_text().startswith("0,0,1,")
    assert validate(folder).ok


def test_frames_are_those_of_the_renderer(tmp_path):
    synthesize(tmp_path / "d", SMALL[1:], extension=".png")
    sequence = load_dataset(tmp_path / "d")["bike1"]
    assert np.array_equal(sequence.image(2), NightSequence(SMALL[1]).frame(2).image)


def test_a_filled_folder_is_refused(made):
    folder, _ = made
    with pytest.raises(UsageError, match="is not empty"):
        synthesize(folder, SMALL)


def test_photographs_are_read_as_reflectance(tmp_path):
    from nat2024.datasets.writing import encode_image

    image = np.random.default_rng(0).integers(0, 255, size=(60, 700, 3)).astype(np.uint8)
    (tmp_path / "a.png").write_bytes(encode_image(image, ".png"))
    (tmp_path / "readme.txt").write_text("no photograph")
    (photograph,) = read_photographs(tmp_path)
    assert photograph.shape == (44, 512, 3)
    assert photograph.dtype == np.float32
    assert 0 <= photograph.min() <= photograph.max() <= 1
    with pytest.raises(UsageError, match="no photographs in it"):
        read_photographs(tmp_path / "absent")


@pytest.fixture
def day(tmp_path):
    """Two daytime sequences, one with an absent target."""
    rng = np.random.default_rng(0)
    frames = [rng.integers(60, 250, size=(90, 160, 3)).astype(np.uint8) for _ in range(3)]
    boxes = np.array([[10, 12, 20, 9.5], [np.nan] * 4, [14, 12, 20, 9.25]])
    for name in ("car1", "car2"):
        write_sequence(tmp_path / "day", name, zip(frames, boxes, strict=True))
    return tmp_path / "day"


def test_darkened_datasets_keep_their_ground_truth(day, tmp_path):
    dataset = load_dataset(day)
    done = darken(dataset, tmp_path / "out", [0.12, 0.05])
    assert [(one.name, one.frames, one.fault) for one in done] == [("car1", 3, ""), ("car2", 3, "")]
    means = []
    for level in ("0.12", "0.05"):
        night = load_dataset(tmp_path / "out" / f"day-{level}")
        for name in ("car1", "car2"):
            assert np.array_equal(night[name].boxes, dataset[name].boxes, equal_nan=True)
        means.append(night["car1"].image(0).mean() / 255)
    assert means == pytest.approx([0.12, 0.05], rel=0.15)
    with pytest.raises(UsageError, match="is not empty"):
        darken(dataset, tmp_path / "out", [0.05])
    with pytest.raises(UsageError, match="given twice"):
        darken(dataset, tmp_path / "other", [0.05, 0.05])


def test_attributes_visibility_and_keyframes_are_kept(made, tmp_path):
    folder, _ = made
    dataset = load_dataset(folder)
    darken(dataset, tmp_path / "out", [0.06])
    night = load_dataset(tmp_path / "out" / f"{dataset.name}-0.06")
    for sequence in dataset:
        assert night[sequence.name].attributes == sequence.attributes
        assert np.array_equal(night[sequence.name].visible, sequence.visible)
    some = tmp_path / "some"
    write_sequence(some, "a", [(night["bike2"].image(i), np.ones(4)) for i in range(3)])
    (some / "anno" / "a.txt").unlink()
    (some / "anno_keyframes").mkdir()
    (some / "anno_keyframes" / "a.txt").write_text("1,5,6,7,8\n3,6,6,7,8\n")
    darken(load_dataset(some, unannotated=True), tmp_path / "keyed", [0.06])
    keyed = load_dataset(tmp_path / "keyed" / "some-0.06", unannotated=True)["a"]
    assert keyed.keyframes.tolist() == [0, 2]
    assert keyed.boxes[2].tolist() == [6, 6, 7, 8]


def test_a_frame_that_fails_is_told_and_its_sequence_left_out(day, tmp_path):
    (day / "data_seq" / "car1" / "00002.png").write_bytes(b"\x89PNG\r\n\x1a\n")
    good, bad = sorted(darken(load_dataset(day), tmp_path / "out", [0.1]), key=lambda x: x.fault)
    assert (good.name, bad.name) == ("car2", "car1")
    assert "00002.png (frame 1, counted from 0)" in bad.fault
    assert [s.name for s in load_dataset(tmp_path / "out" / "day-0.1")] == ["car2"]
    assert not (tmp_path / "out" / "day-0.1" / "data_seq" / "car1").exists()


def test_the_sample_loads_without_a_root_and_holds_what_it_promises():
    dataset = nat2024.load_dataset("night_mini")
    assert sorted(s.name for s in dataset) == [
        "bike1",
        "boat1",
        "bus1",
        "car1",
        "person1",
        "truck1",
    ]
    assert all(60 <= len(s) <= 120 for s in dataset)
    assert {"FOC", "POC", "OV", "SV", "IV", "FM", "LR"} <= {
        a for s in dataset for a in s.attributes
    }
    for sequence in dataset:
        assert sequence.frame_size == (480, 270)
        assert sequence.image(len(sequence) - 1).shape == (270, 480, 3)
        assert np.array_equal(sequence.visible, np.isfinite(sequence.boxes).all(axis=1))
    assert not dataset["bike1"].visible.all()
    assert len({len(s) for s in dataset}) == len(dataset)
    assert all(settings.seed in SEEDS for settings in SAMPLE)
    report = validate("night_mini", every_frame=True)
    assert report.ok
    assert report.unchecked == ()


@pytest.mark.parametrize("number", [2, 4])
def test_the_sample_is_rendered_again_within_a_grey_level(number):
    import cv2

    settings = SAMPLE[number]
    name = f"{settings.target}1"
    shipped = nat2024.load_dataset("night_mini")[name]
    sequence = NightSequence(settings)
    for index in (0, len(shipped) - 1):
        frame = sequence.frame(index)
        raw = cv2.imencode(".jpg", frame.image, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])[1]
        again = cv2.imdecode(raw, cv2.IMREAD_COLOR).astype(int)
        # before JPEG a machine may differ by one level; coding can spread that over its blocks
        difference = np.abs(again - shipped.image(index).astype(int))
        assert np.mean(difference) <= 0.1
        assert np.percentile(difference, 99) <= 1
        assert np.allclose(frame.box, shipped.boxes[index], atol=0.26, equal_nan=True)
