import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nat2024_trackers.siamrpnpp.training.cuts import draw_target, lay
from nat2024_trackers.siamrpnpp.training.geometry import placed
from nat2024_trackers.siamrpnpp.training.occluders import cover, foliage, occlude_template
from nat2024_trackers.siamrpnpp.training.shapes import SIDE

PHOTOGRAPHS = [np.random.default_rng(1).integers(0, 256, (60, 80, 3), dtype=np.uint8)]
seeds = st.integers(0, 2**32)


@settings(max_examples=25, deadline=None)
@given(seeds)
def test_an_occluder_hides_a_part_of_the_template_only(seed):
    rng = np.random.default_rng(seed)
    blank = np.full((127, 127, 3), 255, np.uint8), np.full((191, 191, 3), 255, np.uint8)
    boxes = np.array([31.5, 31.5, 64, 64]), np.array([60.0, 70, 80, 60])
    before = [one.copy() for one in blank]
    template, search = occlude_template(rng, PHOTOGRAPHS, blank, boxes, procedural=True)
    hidden = (template != 255).any(axis=2)[32:96, 32:96].mean()
    assert hidden < 0.9
    assert template.shape == (127, 127, 3)
    assert search.shape == (191, 191, 3)
    for one, other in zip(before, blank, strict=True):
        np.testing.assert_array_equal(one, other)


def test_most_occluders_hide_something_and_stand_beside_the_target_later():
    blank = np.full((127, 127, 3), 255, np.uint8), np.full((191, 191, 3), 255, np.uint8)
    boxes = np.array([31.5, 31.5, 64, 64]), np.array([60.0, 70, 80, 60])
    hidden, later = [], []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        template, search = occlude_template(rng, PHOTOGRAPHS, blank, boxes, procedural=True)
        hidden.append((template != 255).any(axis=2)[32:96, 32:96].mean())
        later.append((search != 255).any())
    assert 0.1 < np.mean(hidden) < 0.5
    assert 0.4 < np.mean(later) < 0.9


def test_a_cover_hides_nearly_all():
    box, shares = np.array([60.0, 70, 60, 50]), []
    for seed in range(20):
        ground = np.full((191, 191, 3), 255, np.uint8)
        covered = cover(np.random.default_rng(seed), PHOTOGRAPHS, ground, box, procedural=True)
        shares.append((covered != 255).any(axis=2)[70:120, 60:120].mean())
    assert np.median(shares) > 0.8


@given(seeds)
@settings(max_examples=20, deadline=None)
def test_foliage_is_a_crown(seed):
    crown = foliage(np.random.default_rng(seed))
    assert crown.mask[SIDE // 2 - 4 : SIDE // 2 + 4, SIDE // 2 - 4 : SIDE // 2 + 4].all()
    assert 0.3 < (crown.mask > 0).mean() < 0.95


def test_objects_of_two_parts_change_between_the_crops():
    rng = np.random.default_rng(4)
    pairs = [draw_target(rng, PHOTOGRAPHS, procedural=True) for _ in range(60)]
    changed = [not np.array_equal(first.mask, later.mask) for first, later in pairs]
    assert 0.15 < np.mean(changed) < 0.55
    assert all(later.mask.any() for _, later in pairs)


@pytest.mark.parametrize(
    "place", [np.array([-80.0, 20]), np.array([170.0, 170]), np.full(2, 400.0)]
)
def test_objects_may_reach_beyond_the_crop(place):
    ground = np.full((191, 191, 3), 9, np.uint8)
    cut, _ = draw_target(np.random.default_rng(3), PHOTOGRAPHS, procedural=True)
    drawn = lay(ground, cut, placed(np.eye(2), np.zeros(2), place))
    assert drawn.shape == ground.shape
    assert (ground == 9).all()
