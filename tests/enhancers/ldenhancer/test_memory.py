"""A full frame in a fresh process: the attention matrix alone would take 2 GB."""

import pytest
from enhancer_speed import Case, in_own_process


@pytest.mark.slow
def test_a_full_frame_adds_less_than_800_mb():
    added = in_own_process(Case("ldenhancer", 1920, 1080, 1), 300, side="ours")["ours"]
    # A frame as float32 has 25 MB, so a smaller number would mean that nothing was measured.
    assert 25 < added < 800
