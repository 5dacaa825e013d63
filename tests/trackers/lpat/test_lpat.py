import pytest

import nat2024


@pytest.mark.parametrize(
    ("options", "seen"),
    [({}, []), ({"enhance_template": False}, []), ({"enhance_template": True}, [127])],
)
def test_the_template_is_enhanced_only_where_that_is_asked_for(clip, gamma, options, seen):
    frames, box = clip
    enhancer = gamma()
    tracker = nat2024.create_tracker("lpat", weights=False, enhancer=enhancer, **options)
    tracker.init(frames[0], box)
    assert [batch.shape[-1] for batch in enhancer.batches] == seen
    tracker.update(frames[1])
    assert enhancer.batches[-1].shape == (1, 3, 287, 287)
    assert len(enhancer.batches) == len(seen) + 1  # once for each search crop


def test_the_card_says_how_the_published_results_were_made():
    from nat2024_trackers.lpat.plugin import LPAT

    assert any("not the template" in line for line in LPAT.card.differences)
