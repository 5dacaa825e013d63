import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from nat2024.errors import UsageError
from nat2024.measures import night_statistics
from nat2024.night import NightSequence, NightSettings, Truth, attributes
from nat2024.night.sequence import KINDS
from nat2024.night.sprites import pose

RANGES = json.loads((Path(__file__).parents[2] / "data" / "night_ranges.json").read_text())
SMALL = NightSettings(frames=12, size=(320, 180), seed=3)


def truth_of(settings: NightSettings) -> Truth:
    sequence = NightSequence(settings)
    return Truth.of([sequence.frame(index) for index in range(len(sequence))])


def test_everything_follows_from_the_seed():
    sequence, again = NightSequence(SMALL), NightSequence(SMALL)
    frames = list(sequence)
    assert len(frames) == len(sequence) == 12
    late = again.frame(9)
    assert np.array_equal(late.image, frames[9].image)
    assert np.array_equal(late.box, frames[9].box)
    assert frames[0].image.dtype == np.uint8
    assert frames[0].image.shape == (180, 320, 3)
    other = NightSequence(replace(SMALL, seed=4)).frame(9)
    assert not np.array_equal(other.image, late.image)


@pytest.mark.parametrize("kind", ["car", "bus", "truck", "boat", "van"])
@pytest.mark.parametrize("seed", [1, 2])
def test_boxes_are_tight_around_the_corners_of_the_target(kind, seed):
    # an independent way to the same box: the corners of all solids, projected
    sequence = NightSequence(NightSettings(kind, frames=8, size=(480, 270), seed=seed))
    for index in (0, 7):
        frame, target = sequence.frame(index), sequence.scene.movers[0]
        turn = pose(target.places[index], float(target.headings[index]))
        corners = np.concatenate([prism.corners() for prism in target.body.prisms])
        camera = sequence.scene.flight.camera(index)
        pixels, _ = camera.project(corners @ turn[:, :3].T + turn[:, 3])
        low, high = pixels.min(axis=0), pixels.max(axis=0)
        assert frame.inside == pytest.approx(1)
        assert frame.box[:2] == pytest.approx(low, abs=0.6)
        assert frame.box[:2] + frame.box[2:] == pytest.approx(high, abs=0.6)


@pytest.mark.parametrize("kind", ["person", "bike"])
def test_boxes_of_walkers_hold_foot_and_head(kind):
    sequence = NightSequence(NightSettings(kind, frames=4, size=(480, 270), seed=6))
    frame, target = sequence.frame(2), sequence.scene.movers[0]
    place = np.array([[*target.places[2], 0.1], [*target.places[2], 0.9 * target.body.size[2]]])
    pixels, _ = sequence.scene.flight.camera(2).project(place)
    assert (pixels >= frame.box[:2]).all()
    assert (pixels <= frame.box[:2] + frame.box[2:]).all()


def test_a_fully_hidden_target_is_absent_for_a_while_and_comes_back():
    truth = truth_of(replace(SMALL, target="bike", frames=60, occlusion="full"))
    absent = ~np.isfinite(truth.boxes).all(axis=1)
    assert 0 < absent.sum() < 50
    assert not absent[0]
    assert not absent[-1]
    assert (truth.visible[absent] < 0.1).all()
    assert (truth.inside[absent] > 0.9).all()
    assert {"FOC", "POC"} <= attributes(truth)
    assert "OV" not in attributes(truth)


def test_a_partly_hidden_target_keeps_its_whole_box():
    plain = truth_of(replace(SMALL, frames=40))
    hidden = truth_of(replace(SMALL, frames=40, occlusion="partial"))
    assert "POC" in attributes(hidden)
    assert "POC" not in attributes(plain)
    assert "FOC" not in attributes(hidden)
    worst = int(hidden.visible.argmin())
    assert 0.1 <= hidden.visible[worst] < 0.85
    assert hidden.boxes[worst] == pytest.approx(plain.boxes[worst], abs=0.01)


def test_the_view_leaves_the_target_and_its_box_is_cut_at_the_edge():
    truth = truth_of(replace(SMALL, frames=60, out_of_view=True))
    absent = ~np.isfinite(truth.boxes).all(axis=1)
    assert "OV" in attributes(truth)
    assert absent.any()
    assert not absent[[0, -1]].any()
    there = truth.boxes[~absent]
    assert (there[:, :2] >= 0).all()
    assert (there[:, :2] + there[:, 2:] <= (320, 180)).all()
    assert (truth.inside[absent] < 0.2).all()


def test_attributes_of_made_up_truth():
    boxes = np.tile([10.0, 10, 30, 20], (5, 1))
    ones = np.ones(5)
    plain = Truth(boxes, ones, ones, ones)
    assert attributes(plain) == frozenset()
    moved = boxes.copy()
    moved[3:, 0] += 21
    assert attributes(replace(plain, boxes=moved)) == {"FM"}
    grown = boxes.copy()
    grown[4, 2:] = 45, 30
    assert attributes(replace(plain, boxes=grown)) == {"SV"}
    shrunk = boxes.copy()
    shrunk[4, 2:] = 20, 19
    assert attributes(replace(plain, boxes=shrunk)) == {"LR"}
    assert attributes(replace(plain, light=np.array([1, 1, 1, 1, 2.5]))) == {"IV"}
    turned = boxes.copy()
    turned[4, 2:] = 20, 30
    assert attributes(replace(plain, boxes=turned)) == {"ARC"}


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"target": "plane"}, "no target 'plane'"),
        ({"target": "boat", "place": "plaza"}, "a boat cannot be at a plaza"),
        ({"frames": 1}, "1 frames"),
        ({"size": (32, 180)}, "frame size"),
        ({"mean": 0.9}, "mean grey level"),
    ],
)
def test_settings_that_cannot_be(change, told):
    with pytest.raises(UsageError, match=told):
        NightSequence(replace(SMALL, **change))


def test_photographs_cover_blocks_and_walls():
    checks = (np.indices((64, 64)).sum(axis=0) // 8 % 2).astype(np.float32)
    photograph = np.repeat(checks[..., None], 3, axis=2)
    plain = NightSequence(SMALL)
    papered = NightSequence(replace(SMALL, photographs=(photograph,)))
    assert papered.scene.plan.albedo.std() > plain.scene.plan.albedo.std()
    assert np.isfinite(papered.frame(0).box).all()


def test_rendered_sequences_measure_like_real_night_footage():
    rows = []
    for seed in range(300, 314):
        sequence = NightSequence(NightSettings(KINDS[seed % len(KINDS)], frames=40, seed=seed))
        found = [night_statistics(sequence.frame(index).image) for index in (0, 20, 39)]
        rows.append({key: np.median([one[key] for one in found]) for key in found[0]})
    for key, (low, high) in RANGES["first_frames"].items():
        assert low <= np.median([row[key] for row in rows]) <= high, key
    for key, (low, high) in RANGES["other_frames"].items():
        if key != "noise_sigma":  # those frames went through another camera
            assert low <= np.median([row[key] for row in rows]) <= high, key


@pytest.mark.parametrize("kind", ["bike", "bus"])
def test_a_target_is_seen_in_the_first_frame_of_a_short_sequence(kind):
    # what hides it around the middle would hide it from the start
    for seed in range(4):
        settings = NightSettings(kind, frames=8, size=(320, 180), seed=seed, occlusion="full")
        assert np.isfinite(NightSequence(settings).frame(0).box).all()
