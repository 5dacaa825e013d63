"""Padding keeps the image in place and fills by reflection, or replication where it is small."""

import torch
from hypothesis import given
from hypothesis import strategies as st

from nat2024.networks.padding import pad_to_multiple

SIDES = st.integers(1, 40)


@given(SIDES, SIDES, st.sampled_from([1, 8, 12, 16]), st.sampled_from(["end", "centre"]))
def test_the_image_stays_whole_and_both_sides_fit(h, w, multiple, where):
    batch = torch.arange(h * w, dtype=torch.float32).reshape(1, 1, h, w)
    padded, top, left = pad_to_multiple(batch, multiple, where=where)
    assert padded.shape[-2] % multiple == 0
    assert padded.shape[-1] % multiple == 0
    assert padded.shape[-2] - h < multiple
    assert torch.equal(padded[..., top : top + h, left : left + w], batch)
    extra = padded.shape[-1] - w
    assert left == (extra // 2 if where == "centre" else 0)


@given(SIDES, st.sampled_from([8, 12, 16]))
def test_the_end_is_reflected_or_replicated(w, multiple):
    batch = torch.arange(w, dtype=torch.float32).reshape(1, 1, 1, w)
    padded, _, _ = pad_to_multiple(batch, multiple)
    extra = padded.shape[-1] - w
    if 0 < extra < w:
        assert torch.equal(padded[..., w], batch[..., w - 2].expand(1, 1, multiple))
    elif extra:
        assert torch.equal(padded[..., -1], batch[..., -1].expand(1, 1, multiple))
