"""Reading ahead: the same frames and errors, never more than a few, a thread that always ends."""

import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from nat2024.datasets import load_dataset, prefetch
from nat2024.errors import FrameUnreadable, UsageError


class Source:
    """Frames that hold their number; keeps count of what was read and closed."""

    frame_size = (4, 4)

    def __init__(self, count: int = 20, bad: tuple[int, ...] = (), seconds: float = 0.0) -> None:
        self.count, self.bad, self.seconds = count, bad, seconds
        self.read: list[int] = []
        self.closed = 0

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, index: int) -> Any:
        time.sleep(self.seconds)
        self.read.append(index)
        if index in self.bad:
            message = f"x.jpg (frame {index}, counted from 0): broken"
            raise FrameUnreadable(message)
        return np.full((4, 4, 3), index, np.uint8)

    def close(self) -> None:
        self.closed += 1


def threads() -> int:
    return sum(thread.name == "nat2024 prefetch" for thread in threading.enumerate())


@pytest.mark.parametrize("ahead", [0, 1, 4, 50])
@pytest.mark.parametrize("start", [0, 7, 20, 25])
def test_all_frames_in_order(ahead: int, start: int) -> None:
    with prefetch(Source(), start, ahead) as frames:
        assert [int(frame[0, 0, 0]) for frame in frames] == list(range(start, 20))
        with pytest.raises(IndexError):
            frames.take()
    assert threads() == 0


@pytest.mark.parametrize("ahead", [1, 4])
def test_no_more_than_a_few_are_read_ahead(ahead: int) -> None:
    source = Source(100)
    with prefetch(source, ahead=ahead) as frames:
        for number in range(10):
            time.sleep(0.01)
            assert len(source.read) <= number + ahead
            frames.take()
        time.sleep(0.02)
        assert len(source.read) == 10 + ahead
    assert len(source.read) == 10 + ahead


def test_frames_that_were_taken_are_let_go() -> None:
    import weakref

    alive: list[weakref.ref[Any]] = []

    class Kept(np.ndarray):
        pass

    class Tracing(Source):
        def __getitem__(self, index: int) -> Any:
            frame = super().__getitem__(index).view(Kept)
            alive.append(weakref.ref(frame))
            return frame

    with prefetch(Tracing(60), ahead=4) as frames:
        for _ in range(60):
            frame = frames.take()
            assert sum(ref() is not None for ref in alive) <= 1 + 4
            del frame


@pytest.mark.parametrize("ahead", [0, 3])
def test_an_error_comes_with_its_own_frame_and_the_next_can_be_taken(ahead: int) -> None:
    with prefetch(Source(8, bad=(2, 3)), ahead=ahead) as frames:
        seen: list[Any] = []
        for _ in range(8):
            try:
                seen.append(int(frames.take()[0, 0, 0]))
            except FrameUnreadable as error:
                seen.append(str(error))
    broken = [f"x.jpg (frame {number}, counted from 0): broken" for number in (2, 3)]
    assert seen == [0, 1, *broken, 4, 5, 6, 7]


def test_any_error_reaches_the_reader() -> None:
    class Ill(Source):
        def __getitem__(self, index: int) -> Any:
            raise SystemExit(3)

    with prefetch(Ill(), ahead=2) as frames, pytest.raises(SystemExit):
        frames.take()
    assert threads() == 0


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt, GeneratorExit])
def test_the_thread_ends_however_the_block_is_left(error: type[BaseException]) -> None:
    source = Source(1000, seconds=0.002)
    with pytest.raises(error), prefetch(source) as frames:  # noqa: PT012
        frames.take()
        assert threads() == 1
        raise error
    assert threads() == 0
    assert source.closed == 1
    assert len(source.read) < 20
    with pytest.raises(IndexError):
        frames.take()


def test_without_reading_ahead_there_is_no_thread() -> None:
    with prefetch(Source(), ahead=0) as frames:
        frames.take()
        assert threads() == 0


@pytest.mark.parametrize(("start", "ahead"), [(-1, 4), (0, -1)])
def test_negative_numbers(start: int, ahead: int) -> None:
    with pytest.raises(UsageError, match="must be 0 or more"):
        prefetch(Source(), start, ahead)


@pytest.mark.parametrize(("ahead", "several"), [(4, 4), (4, 3), (2, 4), (9, 2)])
def test_several_threads_read_what_may_be_read_in_parallel(ahead: int, several: int) -> None:
    class Parallel(Source):
        reads_in_parallel = True
        at_once, most = 0, 0

        def __getitem__(self, index: int) -> Any:
            type(self).at_once += 1
            type(self).most = max(self.most, self.at_once)
            try:
                time.sleep(0.001 * (index % 3))
                return super().__getitem__(index)
            finally:
                type(self).at_once -= 1

    source = Parallel(30, bad=(7,), seconds=0.002)
    seen: list[int] = []
    with prefetch(source, 2, ahead, several) as frames:
        assert threads() == min(ahead, several)
        while len(seen) < 28:
            assert len(source.read) <= len(seen) + ahead
            try:
                seen.append(int(frames.take()[0, 0, 0]))
            except FrameUnreadable:
                seen.append(-1)
    assert threads() == 0
    assert seen == [-1 if number == 7 else number for number in range(2, 30)]
    assert 1 < source.most <= min(ahead, several)
    plain = Source(30)
    with prefetch(plain, 0, ahead, several) as frames:
        assert threads() == 1
        assert next(iter(frames))[0, 0, 0] == 0


def test_waiting_is_shorter_than_reading() -> None:
    def waited(ahead: int) -> float:
        total = 0.0
        with prefetch(Source(20, seconds=0.005), ahead=ahead) as frames:
            for _ in range(20):
                start = time.perf_counter()
                frames.take()
                total += time.perf_counter() - start
                time.sleep(0.01)
        return total

    assert waited(0) > 0.1
    assert waited(4) < 0.06


def test_the_frames_of_a_dataset(night_clip: Path) -> None:
    sequence = load_dataset(night_clip)["wide"]
    with prefetch(sequence.frames) as frames:
        assert all((a == b).all() for a, b in zip(frames, sequence.frames, strict=True))
