import numpy as np
import pytest
import torch

from nat2024.errors import UsageError
from nat2024.night import Clip, render_clip
from nat2024_trackers.siamese.crops import crop, mean_color, template_side
from nat2024_trackers.siamese.state import Constants, Target
from nat2024_trackers.siamrpnpp.compact import CompactSiamRPN
from nat2024_trackers.siamrpnpp.training import clips as clips_room
from nat2024_trackers.siamrpnpp.training.clips import clip_pair, usable_frames
from nat2024_trackers.siamrpnpp.training.movement import Ranges
from nat2024_trackers.siamrpnpp.training.pairs import Mix, PairSource
from nat2024_trackers.siamrpnpp.training.recipe import (
    PairBatches,
    PairValidation,
    make_pair_source,
)
from nat2024_trackers.siamrpnpp.training.settings import PairSettings

KINDS = ("procedural", "composite", "still", "clips")


@pytest.fixture(scope="module")
def photographs():
    rng = np.random.default_rng(3)
    coarse = rng.integers(0, 256, size=(2, 12, 16, 3), dtype=np.uint8)
    return [np.kron(one, np.ones((20, 20, 1), dtype=np.uint8)) for one in coarse]


@pytest.fixture(scope="module")
def night():
    made = list(render_clip(Clip("c", frames=4, seed=5)))
    return [image for image, _ in made], np.stack([box for _, box in made])


@pytest.fixture(scope="module")
def source(photographs, night):
    return PairSource(photographs, [night], seed=4)


@pytest.mark.parametrize("kind", KINDS)
def test_each_generator_gives_crops_and_a_box_inside(source, kind):
    for number in range(6):
        pair = source.make(kind, np.random.default_rng([1, number]))
        assert pair.template.shape == (127, 127, 3)
        assert pair.search.shape == (191, 191, 3)
        assert pair.template.dtype == pair.search.dtype == np.uint8
        if np.isnan(pair.box).all():  # the target is not there
            continue
        assert np.isfinite(pair.box).all()
        assert np.abs(pair.box[:2]).max() <= 32
        assert pair.box[2:].min() > 4
        assert pair.box[2:].max() < 300


def test_some_search_crops_lack_the_target(source, night):
    frames, boxes = night
    half = boxes.copy()
    half[1] = np.nan
    without = PairSource(source.photographs, [(frames, half)], seed=4)
    for kind, least in (("procedural", 2), ("composite", 2), ("clips", 2)):
        absent = [
            np.isnan(without.make(kind, np.random.default_rng([2, number])).box).all()
            for number in range(100)
        ]
        assert least <= sum(absent) < 25, kind
    assert PairValidation(without, count=4)(CompactSiamRPN(16).eval())


def test_a_pair_follows_from_seed_and_number_alone(photographs, night, source):
    again = PairSource(photographs, [night], seed=4)
    other = PairSource(photographs, [night], seed=5)
    for number in (7, 2, 7):
        first, second = source[number], again[number]
        np.testing.assert_array_equal(first.search, second.search)
        np.testing.assert_array_equal(first.template, second.template)
        np.testing.assert_array_equal(first.box, second.box)
    assert not np.array_equal(source[7].box, other[7].box)
    assert not np.array_equal(source[7].box, source[8].box)


def test_batches_are_the_same_from_another_process(source):
    alone, apart = PairBatches(source, 2), PairBatches(source, 2, apart=True)
    try:
        for step in (5, 6, 2):  # also after a jump, as on resuming
            drawn = apart.draw(step)
            for name, tensor in alone.draw(step).items():
                assert torch.equal(drawn[name], tensor), (step, name)
    finally:
        apart.close()
    assert drawn["template"].dtype == torch.float32
    assert drawn["search"].shape == (2, 3, 191, 191)


def test_making_pairs_changes_nothing_that_was_given(photographs, night):
    copies = [one.copy() for one in (*photographs, *night[0])]
    source = PairSource(photographs, [night], seed=1)
    for number in range(12):
        _ = source[number]
    for before, after in zip(copies, (*photographs, *night[0]), strict=True):
        np.testing.assert_array_equal(before, after)


def test_generators_without_material_are_left_out(photographs, night):
    rng = np.random.default_rng(0)
    without_clips = PairSource(photographs, mix=Mix(clips=0.9))
    assert "clips" not in {without_clips.draw_kind(rng) for _ in range(40)}
    only_clips = PairSource((), [night])
    assert {only_clips.draw_kind(rng) for _ in range(10)} == {"clips"}
    with pytest.raises(UsageError, match="give photographs, or sequences with boxes"):
        PairSource()


def test_clips_without_boxes_are_refused(night):
    frames, boxes = night
    with pytest.raises(UsageError, match="hardly have boxes"):
        clip_pair(np.random.default_rng(0), [(frames, boxes * np.nan)], Ranges())


def test_only_frames_with_a_target_are_used():
    boxes = np.array([[1.0, 1, 9, 9], [np.nan] * 4, [1, 1, 0, 0], [5, 5, 9, 2], [0, 0, 3, 3]])
    np.testing.assert_array_equal(usable_frames(boxes), [0, 4])


def test_a_clip_pair_is_what_the_tracker_would_cut(night, monkeypatch):
    """With no error of place and size it is the tracker's template and the search crop around."""
    monkeypatch.setattr(clips_room, "vary_pair", lambda _, template, search: (template, search))
    monkeypatch.setattr(clips_room, "_occluded", lambda _, __, crops, ___: crops)
    frames, boxes = night
    still = Ranges(search=191, shift=0.0, scale=0.0)
    constants = Constants(191, 9, 8, 0.0, 0.0, 0.0)
    rng = np.random.default_rng(2)
    for _ in range(5):
        template, search, box = clip_pair(rng, [(frames[:1], boxes[:1])], still)
        target = Target.from_annotation(boxes[0])
        side = template_side(target, constants)
        wanted = crop(frames[0], target, side, 127, mean_color(frames[0]))
        is_mirrored = not np.array_equal(template, wanted)
        np.testing.assert_array_equal(template[:, ::-1] if is_mirrored else template, wanted)
        scale = 127 / np.sqrt((34 + 27) * (20 + 27))
        np.testing.assert_allclose(box, [0, 0, 34 * scale, 20 * scale])
        assert search.shape == (191, 191, 3)


def test_settings_reach_the_source(photographs):
    settings = PairSettings(search=223, scale=0.1, shift=8.0, clips=0.0)
    source = make_pair_source(settings, photographs, [], seed=9)
    assert (source.seed, source.ranges.search, source.mix.clips) == (9, 223, 0.0)
    assert source[0].search.shape == (223, 223, 3)
    assert np.abs(source[0].box[:2]).max() <= 8
