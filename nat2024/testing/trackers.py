"""What every tracker must keep, whoever wrote it: the suite that our own trackers run too."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NoReturn, TypeAlias

import numpy as np

from nat2024.errors import ArrayContract, BrokenPlugin, NatBenchError
from nat2024.interfaces import Tracker
from nat2024.types import Box, Boxes, Image

MakeTracker: TypeAlias = Callable[[], Tracker]

_WIDTH, _HEIGHT = 160, 120
_SIDE = 28


def check_tracker(make_tracker: MakeTracker) -> None:
    """Run the conformance suite on small generated frames.

    It checks the shapes, types and finiteness of answers; that frames and boxes given are neither
    changed nor kept, and that boxes returned are the caller's own; that a sequence gives the same
    boxes whatever was tracked before or is tracked beside it (left out where the card says
    `repeatable = false`); that tiny, huge and cut-off start boxes, targets that leave and frames
    of another size give finite boxes; that bad input is refused with one line.

    Args:
        make_tracker: gives a new tracker at each call.

    Raises:
        BrokenPlugin: with the first rule that is broken.

    Example:
        >>> import nat2024
        >>> check_tracker(lambda: nat2024.create_tracker("mil"))
    """
    for check in CHECKS:
        check(make_tracker)


def check_answers(make_tracker: MakeTracker) -> None:
    """Rows are float64 (4,) and finite; `update` gives (box, score)."""
    tracker = _new(make_tracker)
    frames, box = moving_square(seed=0)
    _follow(tracker, frames, box)


def check_inputs_untouched(make_tracker: MakeTracker) -> None:
    """Frames and the start box keep their values."""
    tracker = _new(make_tracker)
    frames, box = moving_square(seed=0)
    kept_frames, kept_box = [frame.copy() for frame in frames], box.copy()
    _follow(tracker, frames, box)
    if not np.array_equal(box, kept_box):
        _fail(tracker, "changes the start box that it is given")
    for index, (frame, kept) in enumerate(zip(frames, kept_frames, strict=True)):
        if not np.array_equal(frame, kept):
            _fail(tracker, f"writes into frame {index}")


def check_nothing_shared(make_tracker: MakeTracker) -> None:
    """Neither boxes returned nor frames and boxes given are used after the call."""
    tracker = _new(make_tracker)
    if not tracker.card.repeatable:
        return
    frames, box = moving_square(seed=0)
    expected = _follow(tracker, frames, box)
    given = box.copy()
    first = tracker.init(frames[0].copy(), given)
    rows = [first.copy()]
    given[:], first[:] = -1e6, 1e6
    for frame in frames[1:]:
        passed = frame.copy()
        row, _ = tracker.update(passed)
        rows.append(row.copy())
        row[:], passed[:] = 1e6, 0
    if not np.array_equal(np.stack(rows), expected):
        _fail(tracker, "keeps using arrays that belong to the caller")


def check_repeatable(make_tracker: MakeTracker) -> None:
    """One tracker gives the same boxes again, with another sequence in between."""
    tracker = _new(make_tracker)
    if not tracker.card.repeatable:
        return
    frames, box = moving_square(seed=0)
    first = _follow(tracker, frames, box)
    if not np.array_equal(_follow(tracker, frames, box), first):
        _fail(tracker, "gives other boxes when a sequence is tracked again")
    _follow(tracker, *moving_square(seed=1, size=(120, 96)))
    if not np.array_equal(_follow(tracker, frames, box), first):
        _fail(tracker, "gives other boxes after another sequence: state is left over")


def check_independent(make_tracker: MakeTracker) -> None:
    """Two trackers that take turns do not disturb each other."""
    one, other = _new(make_tracker), _new(make_tracker)
    if not one.card.repeatable:
        return
    frames, box = moving_square(seed=0)
    other_frames, other_box = moving_square(seed=1)
    alone = _follow(one, frames, box)
    rows = [one.init(frames[0], box)]
    other.init(other_frames[0], other_box)
    for frame, other_frame in zip(frames[1:], other_frames[1:], strict=True):
        other.update(other_frame)
        rows.append(one.update(frame)[0])
    if not np.array_equal(np.stack(rows), alone):
        _fail(one, "gives other boxes while a second tracker is at work: they share state")


def check_extreme_starts(make_tracker: MakeTracker) -> None:
    """Tiny, huge and cut-off start boxes give finite boxes."""
    tracker = _new(make_tracker)
    frames, _ = moving_square(seed=0, count=2)
    boxes = {
        "tiny": (40.0, 40.0, 6.0, 4.0),
        "smaller than a pixel": (40.3, 40.3, 0.6, 0.4),
        "of the image's size": (0.0, 0.0, _WIDTH, _HEIGHT),
        "larger than the image": (-2.0 * _WIDTH, -2.0 * _HEIGHT, 5.0 * _WIDTH, 5.0 * _HEIGHT),
        "long and thin": (0.0, 60.0, _WIDTH, 1.0),
        "cut off at the top left": (-20.0, -15.0, 30.0, 25.0),
        "cut off at the bottom right": (_WIDTH - 10.5, _HEIGHT - 8.5, 30.0, 25.0),
    }
    for what, box in boxes.items():
        _follow(tracker, frames, np.array(box), f"with a start box {what}")


def check_leaving_target(make_tracker: MakeTracker) -> None:
    """A target that leaves, then an even image, give finite boxes."""
    tracker = _new(make_tracker)
    frames, box = moving_square(seed=0, count=4, step=(60, 0))
    black = np.zeros_like(frames[0])
    _follow(tracker, [*frames, black, black], box, "when the target leaves the image")


def check_other_sizes(make_tracker: MakeTracker) -> None:
    """A frame of another size is followed or refused with one line, not with a crash."""
    tracker = _new(make_tracker)
    frames, box = moving_square(seed=0, count=1)
    for size in ((_WIDTH // 2, _HEIGHT // 2), (_WIDTH * 2, _HEIGHT * 2)):
        [other], _ = moving_square(seed=1, count=1, size=size)
        tracker.init(frames[0], box)
        try:
            answer = tracker.update(other)
        except NatBenchError:
            continue
        except Exception as error:
            _fail(tracker, f"fails on a frame of another size: {_named(error)}")
        _check_answer(tracker, answer, "on a frame of another size")


def check_refusals(make_tracker: MakeTracker) -> None:
    """Bad boxes and images raise `ArrayContract`; `update` before `init` a `NatBenchError`."""
    tracker = _new(make_tracker)
    [frame], box = moving_square(seed=0, count=1)
    _must_refuse(tracker, partial(tracker.update, frame), NatBenchError, "update before init")
    bad_boxes: dict[str, Any] = {
        "of no area": (10, 10, 0, 5),
        "of negative width": (10, 10, -4, 5),
        "with NaN": (10, float("nan"), 4, 5),
        "with infinity": (10, 10, float("inf"), 5),
        "of three numbers": (10, 10, 4),
        "outside the image": (_WIDTH + 5, 10, 4, 5),
    }
    for what, bad in bad_boxes.items():
        _must_refuse(
            tracker, partial(tracker.init, frame, bad), ArrayContract, f"a start box {what}"
        )
    bad_images: dict[str, Any] = {
        "a grey image of two axes": frame[..., 0],
        "a float image": frame.astype(np.float32),
        "an image without pixels": frame[:0],
    }
    for what, image in bad_images.items():
        _must_refuse(tracker, partial(tracker.init, image, box), ArrayContract, what)
    tracker.init(frame, box)
    for what, image in bad_images.items():
        _must_refuse(tracker, partial(tracker.update, image), ArrayContract, what)


CHECKS: tuple[Callable[[MakeTracker], None], ...] = (
    check_answers,
    check_inputs_untouched,
    check_nothing_shared,
    check_repeatable,
    check_independent,
    check_extreme_starts,
    check_leaving_target,
    check_other_sizes,
    check_refusals,
)
"""The rules of `check_tracker`, each of which can be run alone."""


def moving_square(
    seed: int,
    count: int = 4,
    size: tuple[int, int] = (_WIDTH, _HEIGHT),
    step: tuple[int, int] = (3, 2),
) -> tuple[list[Image], Box]:
    """A textured square that moves over dim noise.

    Args:
        seed: of texture and noise.
        count: number of frames.
        size: (width, height) of the frames.
        step: motion in pixels a frame, right and down.

    Returns:
        `count` frames, uint8 (H, W, 3) BGR, and the box of the square in the first.
    """
    width, height = size
    generator = np.random.default_rng(seed)
    ground = generator.integers(0, 60, (height, width, 3), dtype=np.uint8)
    texture = generator.integers(120, 256, (_SIDE // 4, _SIDE // 4, 3), dtype=np.uint8)
    square = texture.repeat(4, axis=0).repeat(4, axis=1)
    left, top = width // 3, height // 3
    frames = []
    for index in range(count):
        frame = ground.copy()
        x, y = left + index * step[0], top + index * step[1]
        room = frame[y : y + _SIDE, x : x + _SIDE]
        room[:] = square[: room.shape[0], : room.shape[1]]
        frames.append(frame)
    return frames, np.array([left, top, _SIDE, _SIDE], dtype=np.float64)


def _new(make_tracker: MakeTracker) -> Tracker:
    tracker = make_tracker()
    if not isinstance(tracker, Tracker):
        msg = f"make_tracker gave {type(tracker).__name__}, no nat2024.Tracker"
        raise BrokenPlugin(msg)
    return tracker


def _follow(tracker: Tracker, frames: Sequence[Image], box: Box, where: str = "") -> Boxes:
    """Track frames and return float64 (n, 4), each row checked."""
    try:
        first: Any = tracker.init(frames[0], box)
    except Exception as error:
        _fail(tracker, f"fails in init {where}: {_named(error)}")
    rows = [_check_row(tracker, first, f"init {where}")]
    for frame in frames[1:]:
        try:
            answer = tracker.update(frame)
        except Exception as error:
            _fail(tracker, f"fails in update {where}: {_named(error)}")
        rows.append(_check_answer(tracker, answer, where))
    return np.stack(rows)


def _check_answer(tracker: Tracker, answer: Any, where: str) -> Box:
    if not isinstance(answer, tuple) or len(answer) != 2:
        _fail(tracker, f"update must give (box, score), not {type(answer).__name__} {where}")
    row, score = answer
    # NaN is the score of trackers that have none.
    if not isinstance(score, float) or np.isinf(score):
        _fail(tracker, f"the score must be a float, finite or NaN, not {score!r} {where}")
    return _check_row(tracker, row, f"update {where}")


def _check_row(tracker: Tracker, row: Any, where: str) -> Box:
    if not isinstance(row, np.ndarray) or row.dtype != np.float64 or row.shape != (4,):
        kind = f"{row.dtype} {row.shape}" if isinstance(row, np.ndarray) else type(row).__name__
        _fail(tracker, f"{where.strip()} must give a float64 array of shape (4,), not {kind}")
    if not np.isfinite(row).all() or row[2] < 0 or row[3] < 0:
        _fail(tracker, f"{where.strip()} gives {row.tolist()}, no box of finite numbers")
    kept: Box = row.copy()
    return kept


def _must_refuse(
    tracker: Tracker, call: Callable[[], object], kind: type[NatBenchError], what: str
) -> None:
    try:
        call()
    except kind:
        return
    except Exception as error:
        _fail(tracker, f"meets {what} with {_named(error)}, not with {kind.__name__}")
    _fail(tracker, f"accepts {what}; it must raise {kind.__name__}")


def _named(error: Exception) -> str:
    return f"{type(error).__name__}: {error}"


def _fail(tracker: Tracker, rule: str) -> NoReturn:
    msg = f"tracker {tracker.name or type(tracker).__name__}: {' '.join(rule.split())}"
    raise BrokenPlugin(msg)
