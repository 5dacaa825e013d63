"""The loop with a network small enough to see through: correlation of grey pixels."""

import numpy as np
import pytest
import torch
import torch.nn.functional as F
from torch import nn

from nat2024.backends import is_installed
from nat2024.cards import Card
from nat2024.errors import ArrayContract, UsageError
from nat2024_trackers.siamese.state import Candidates, Constants, Target
from nat2024_trackers.siamese.tracker import SiameseTracker

CONSTANTS = Constants(
    instance_size=48,
    map_size=17,
    stride=2,
    penalty_k=0.1,
    window_influence=0.1,
    learning_rate=0.3,
    exemplar_size=16,
)


class Correlation(nn.Module):
    def __init__(self):
        super().__init__()
        self.gain = nn.Parameter(torch.ones(1))
        self.seen = []

    def embed(self, template):
        self.seen.append(template)
        centered = template - template.mean(dim=(1, 2, 3), keepdim=True)
        return (self.gain * F.normalize(centered.flatten(1)).view_as(template),)

    def match(self, features, search):
        self.seen.append(search)
        [kernels] = features
        pairs = zip(search, kernels, strict=True)
        maps = [F.conv2d(one[None], kernel[None], stride=2) for one, kernel in pairs]
        return (torch.cat(maps),)


def decode(maps):
    [scores] = maps
    count = len(scores)
    offsets = (np.arange(17) - 8) * 2.0
    y, x = np.meshgrid(offsets, offsets, indexing="ij")
    size = np.full(17 * 17, 8.0)
    boxes = np.stack([x.ravel(), y.ravel(), size, size])
    flat = scores.reshape(count, -1)
    return Candidates(flat / np.abs(flat).max(axis=1, keepdims=True), np.stack([boxes] * count))


class Counting:
    """An enhancer that changes nothing and counts its calls."""

    count = 0

    def enhance_batch(self, batch):
        self.count += 1
        return batch


class Simple(SiameseTracker):
    name = "simple"
    card = Card(title="simple", summary="for tests")

    def __init__(self, **options):
        super().__init__(Correlation(), decode, CONSTANTS, **options)


@pytest.fixture
def follow(clip):
    frames, box = clip

    def run(tracker, count=5):
        return np.stack(
            [tracker.init(frames[0], box)] + [tracker.update(f)[0] for f in frames[1:count]]
        )

    return run


def test_row_0_is_shifted_by_half_a_pixel(clip):
    frames, _ = clip
    row = Simple().init(frames[0], [10, 20.5, 30, 40])
    np.testing.assert_array_equal(row, [10.5, 21, 30, 40])
    assert row.dtype == np.float64


def test_the_start_center_has_no_shift(clip):
    frames, box = clip
    tracker = Simple()
    tracker.init(frames[0], box)
    assert tracker.target == Target(115, 87, 30, 54)


def test_a_twin_has_the_network_and_nothing_else(clip, follow):
    frames, box = clip
    tracker, enhancer = Simple(), Counting()
    alone = follow(tracker)
    tracker.init(frames[0], box)
    twin = tracker.twin(enhancer)
    assert twin.model is tracker.model
    with pytest.raises(UsageError, match="update before init"):
        twin.update(frames[1])
    shifted = (box[0] + 8, *box[1:])
    twin.init(frames[0], shifted)
    both = [(tracker.update(frame)[0], twin.update(frame)[0]) for frame in frames[1:5]]
    np.testing.assert_array_equal([own for own, _ in both], alone[1:])
    assert enhancer.count == 5
    assert tracker.enhancer is None
    one = Simple(enhancer=Counting())
    one.init(frames[0], shifted)
    np.testing.assert_array_equal(
        [other for _, other in both], [one.update(frame)[0] for frame in frames[1:5]]
    )


def test_a_twin_answers_for_itself():
    tracker = Simple()
    tracker._parts["match"].answered["openvino"] += 3
    twin = tracker.twin(None)
    assert tracker.answered == {"openvino": 3}
    assert not twin.answered
    twin._parts["match"].answered["torch"] += 1
    assert twin.answered == {"torch": 1}


def test_it_follows_what_its_network_sees(clip):
    frames, box = clip
    tracker = Simple()
    tracker.init(frames[0], box)
    for frame in frames[1:]:
        tracker.update(frame)
    target = tracker.target
    cell = 2 * 84 / 16  # stride of the map, in image pixels
    assert abs(target.center_x - (115 + 4 * 7)) < cell
    assert abs(target.center_y - (87 - 2 * 7)) < cell


def test_crops_are_raw_bgr_floats(clip):
    frames, box = clip
    frame = np.zeros_like(frames[0])
    frame[:] = (10, 120, 250)
    tracker = Simple()
    tracker.init(frame, box)
    tracker.update(frame)
    template, search = tracker.model.seen
    assert template.shape == (1, 3, 16, 16)
    assert search.shape == (1, 3, 48, 48)
    for crops in (template, search):
        assert crops.dtype == torch.float32
        np.testing.assert_array_equal(crops[0, :, 0, 0], [10, 120, 250])


def test_the_enhancer_sees_both_crops_in_0_to_1_and_nothing_is_rounded(clip, gamma):
    frames, box = clip
    enhancer, plain = gamma(), Simple()
    enhanced = Simple(enhancer=enhancer)
    for tracker in (plain, enhanced):
        tracker.init(frames[0], box)
        tracker.update(frames[1])
    for raw, given, fed in zip(
        plain.model.seen, enhancer.batches, enhanced.model.seen, strict=True
    ):
        torch.testing.assert_close(given, raw / 255)
        torch.testing.assert_close(fed, 255 * (raw / 255) ** 0.5)
        assert not torch.equal(fed, fed.round())


def test_the_template_may_stay_as_it_is(clip, gamma):
    frames, box = clip
    enhancer, plain = gamma(), Simple()
    enhanced = Simple(enhancer=enhancer, enhance_template=False)
    for tracker in (plain, enhanced):
        tracker.init(frames[0], box)
        tracker.update(frames[1])
    torch.testing.assert_close(enhanced.model.seen[0], plain.model.seen[0])
    assert [batch.shape[-1] for batch in enhancer.batches] == [48]


def test_a_crop_beyond_the_image_is_filled_with_the_plain_mean(gamma):
    frame = np.full((40, 40, 3), 100, dtype=np.uint8)
    frame[:20] = 51
    tracker = Simple(enhancer=gamma())
    tracker.init(frame, [0, 0, 30, 30])
    template = tracker.model.seen[0]
    expected = 255 * (75 / 255) ** 0.5  # mean 75.5, truncated, then enhanced
    np.testing.assert_allclose(template[0, :, 0, 0], expected, rtol=1e-6)


def test_with_frame_scope_the_frame_is_enhanced_and_the_crops_are_not(clip, gamma):
    frames, box = clip
    enhancer = gamma()
    tracker = Simple(enhancer=enhancer, scope="frame")
    tracker.init(frames[0], box)
    tracker.update(frames[1])
    assert [tuple(batch.shape) for batch in enhancer.batches] == [(1, 3, 180, 240)] * 2
    brightened = Simple()
    table = np.rint(255 * (np.arange(256) / 255) ** 0.5).astype(np.uint8)
    brightened.init(table[frames[0]], box)
    np.testing.assert_array_equal(brightened.model.seen[0], tracker.model.seen[0])


def test_an_enhancer_that_changes_the_shape_is_refused(clip):
    class Halving:
        def enhance_batch(self, batch):
            return batch[..., ::2, ::2]

    frames, box = clip
    with pytest.raises(ArrayContract, match="must keep the shape"):
        Simple(enhancer=Halving()).init(frames[0], box)


def test_gradients_of_a_foreign_enhancer_stay_outside(clip):
    class Learned:
        layer = nn.Conv2d(3, 3, 1)

        def enhance_batch(self, batch):
            return self.layer(batch).sigmoid()

    frames, box = clip
    tracker = Simple(enhancer=Learned())
    tracker.init(frames[0], box)
    assert np.isfinite(tracker.update(frames[1])[0]).all()


def test_weights_loaded_later_count_from_the_next_init(clip):
    frames, box = clip
    tracker = Simple()
    tracker.init(frames[0], box)
    before = tracker.begin(frames[0], box)[0].features[0]
    tracker.model.load_state_dict({"gain": torch.full((1,), 3.0)})
    tracker.init(frames[0], box)
    torch.testing.assert_close(tracker._first.features[0], 3 * before)


def test_several_sequences_advance_in_one_batch_as_they_do_alone(clip):
    frames, box = clip
    tracker = Simple()
    small = [frame[20:170, 30:].copy() for frame in frames]
    sequences = [
        (frames, box),
        (small, box - [30, 20, 0, 0]),
        (frames[::-1], np.array([128.0, 46, 30, 54])),
    ]
    alone = []
    for images, start in sequences:
        tracker.init(images[0], start)
        alone.append([tracker.update(image)[0] for image in images[1:]])
    tracker.init(frames[0], box)
    state = tracker.target
    begun = [tracker.begin(images[0], start) for images, start in sequences]
    firsts, targets = [first for first, _ in begun], [target for _, target in begun]
    for index in range(1, len(frames)):
        images = [sequence[index] for sequence, _ in sequences]
        steps = tracker.update_many(images, firsts, targets)
        targets = [step.target for step in steps]
        for step, rows in zip(steps, alone, strict=True):
            np.testing.assert_allclose(step.box, rows[index - 1], atol=1e-3)
    assert tracker.target == state


@pytest.mark.skipif(not is_installed("onnxruntime", "cpu"), reason="no other runtime is installed")
def test_a_backend_opens_the_whole_network_at_the_start(clip, tmp_path, monkeypatch):
    monkeypatch.setenv("NAT2024_CACHE", str(tmp_path))
    frames, box = clip
    enhancer = Counting()
    tracker = Simple(backend="onnxruntime", enhancer=enhancer)
    tracker.init(frames[0], box)
    opened = {path.name.split("-")[1] for path in tmp_path.rglob("*.onnx")}
    assert opened == {"embed", "match"}
    assert enhancer.count == 1  # the template alone
    seen = len(tracker.model.seen)
    tracker.update(frames[1])
    assert len(tracker.model.seen) == seen  # nothing is left to export or to check


def test_nothing_is_left_of_an_earlier_sequence(follow, clip):
    frames, _ = clip
    tracker = Simple()
    rows = follow(tracker)
    tracker.init(frames[3], [5, 5, 60, 20])
    tracker.update(frames[2])
    np.testing.assert_array_equal(follow(tracker), rows)


def test_the_last_step_tells_more(clip):
    frames, box = clip
    tracker = Simple()
    tracker.init(frames[0], box)
    assert tracker.last_step is None
    row, score = tracker.update(frames[1])
    step = tracker.last_step
    np.testing.assert_array_equal(step.box, row)
    assert step.score == score
    assert 0 <= step.index < 17 * 17


def test_the_state_may_be_set(clip):
    frames, box = clip
    tracker = Simple()
    tracker.init(frames[0], box)
    tracker.update(frames[1])
    expected = tracker.last_step
    tracker.update(frames[2])
    tracker.target = Target(115, 87, 30, 54)
    tracker.update(frames[1])
    assert tracker.last_step == expected


def test_update_before_init_is_a_usage_error(clip):
    frames, _ = clip
    with pytest.raises(UsageError, match="update before init"):
        Simple().update(frames[0])


def test_frames_of_another_size_are_followed_inside_their_own_border(clip):
    frames, box = clip
    tracker = Simple()
    tracker.init(frames[0], box)
    tracker.update(np.ascontiguousarray(frames[1][:40, :50]))
    assert tracker.target.center_x <= 50
    assert tracker.target.center_y <= 40


@pytest.mark.parametrize("box", [(100, 60, 6, 4), (100, 60, 0.2, 0.1), (-900, -900, 3000, 3000)])
def test_degenerate_start_boxes_give_finite_boxes(clip, box):
    frames, _ = clip
    tracker = Simple()
    tracker.init(frames[0], box)
    for frame in frames[1:3]:
        assert np.isfinite(tracker.update(frame)[0]).all()
    assert min(tracker.target.width, tracker.target.height) >= 10
