"""Frames decoded ahead in a background thread, so that whoever uses them waits less."""

import threading
from collections.abc import Iterator
from queue import SimpleQueue
from types import TracebackType
from typing import Protocol, runtime_checkable

from nat2024.errors import UsageError
from nat2024.types import FrameSource, Image

AHEAD = 4


@runtime_checkable
class Closing(Protocol):
    """Frames that keep a file open."""

    def close(self) -> None:
        """Close it; it is opened again where needed."""
        ...


class Prefetch:
    """Frames of a source in order, decoded ahead of their use; use it in a `with` block.

    At most `ahead` frames wait or are being decoded at any time. A frame that cannot be read
    raises its error when it is taken, and the next one can still be taken. Threads, and a file
    that the source keeps open, end with the block, however it is left.

    >>> import numpy as np
    >>> from nat2024.datasets.prefetch import prefetch
    >>> with prefetch([np.zeros((2, 2, 3), np.uint8)] * 3) as frames:
    ...     len([frame.shape for frame in frames])
    3
    """

    def __init__(
        self, frames: FrameSource, start: int = 0, ahead: int = AHEAD, threads: int = 1
    ) -> None:
        """Keep what is to be read; nothing is read before the block is entered.

        Args:
            frames: of a sequence.
            start: the frame to begin with, 0-based.
            ahead: how many frames are decoded ahead; 0 reads each when it is taken, without a
                thread.
            threads: how many of them decode at the same time, where the source says
                `reads_in_parallel`; others are read by one thread.

        Raises:
            UsageError: `ahead` or `start` is below 0.
        """
        if ahead < 0 or start < 0:
            msg = f"start and ahead must be 0 or more, not {start} and {ahead}"
            raise UsageError(msg)
        self._frames, self._next, self._count = frames, start, len(frames)
        self._stopped = False
        several = max(1, threads) if getattr(frames, "reads_in_parallel", False) else 1
        several = min(several, ahead)
        self._readers = [
            _Reader(frames, range(start + turn, self._count, several), ahead // several)
            for turn in range(several)
        ]
        self._start = start

    def __enter__(self) -> "Prefetch":
        for reader in self._readers:
            reader.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._stopped = True
        for reader in self._readers:
            reader.ask_to_stop()
        for reader in self._readers:
            reader.wait()
        if isinstance(self._frames, Closing):
            self._frames.close()

    def take(self) -> Image:
        """The next frame, uint8 (H, W, 3) BGR.

        Raises:
            FrameUnreadable: it cannot be decoded; the one after it can be taken nonetheless.
            IndexError: there is none left, or the block has been left.
        """
        if self._next >= self._count or self._stopped:
            msg = f"no frame {self._next} of {self._count} to take"
            raise IndexError(msg)
        self._next += 1
        if not self._readers:
            return self._frames[self._next - 1]
        item = self._readers[(self._next - 1 - self._start) % len(self._readers)].take()
        if isinstance(item, BaseException):
            raise item
        return item

    def __iter__(self) -> Iterator[Image]:
        """All frames that are left."""
        while self._next < self._count:
            yield self.take()


class _Reader:
    """A thread that reads its share of the frames."""

    def __init__(self, frames: FrameSource, indices: range, ahead: int) -> None:
        self._frames, self._indices, self._ahead = frames, indices, ahead
        # Queues in C: with a Python lock for each frame, many threads would wait for each other.
        self._ready: SimpleQueue[Image | BaseException] = SimpleQueue()
        self._wanted: SimpleQueue[int] = SimpleQueue()
        self._together, self._taken = max(1, ahead // 2), 0  # it is woken for that many
        self._stopped = False
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        if self._indices:
            self._wanted.put(self._ahead)
            self._thread = threading.Thread(
                target=self._read_all, name="nat2024 prefetch", daemon=True
            )
            self._thread.start()

    def ask_to_stop(self) -> None:
        self._stopped = True
        self._wanted.put(0)

    def wait(self) -> None:
        if self._thread:
            self._thread.join()
        self._ready = SimpleQueue()

    def take(self) -> Image | BaseException:
        item = self._ready.get()
        self._taken += 1
        if self._taken == self._together:
            self._taken = 0
            self._wanted.put(self._together)
        return item

    def _read_all(self) -> None:
        room = 0
        for index in self._indices:
            while not room and not self._stopped:
                room = self._wanted.get()
            if self._stopped:
                return
            room -= 1
            self._ready.put(self._read(index))

    def _read(self, index: int) -> Image | BaseException:
        try:
            return self._frames[index]
        except BaseException as error:  # whatever it is belongs to the frame, not to this thread
            return error


def prefetch(frames: FrameSource, start: int = 0, ahead: int = AHEAD, threads: int = 1) -> Prefetch:
    """Read frames in order in background threads; see `Prefetch`."""
    return Prefetch(frames, start, ahead, threads)
