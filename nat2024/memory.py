"""What the C library does with memory that is free again."""

import contextlib
import ctypes

_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3  # of GNU's malloc.h
_MOST_BYTES = 1 << 29


def keep_freed_memory() -> None:
    """Let this process keep up to half a gigabyte of freed memory for what comes next.

    GNU's library gives the feature maps of a network back to the system after every frame, and
    takes new pages for the next ones: a fifth of the time of LDEnhancer on a crop. Elsewhere this
    does nothing.
    """
    with contextlib.suppress(AttributeError, OSError, TypeError):  # another C library
        library = ctypes.CDLL(None)
        library.mallopt(_MMAP_THRESHOLD, _MOST_BYTES)
        library.mallopt(_TRIM_THRESHOLD, _MOST_BYTES)


def return_freed_memory() -> None:
    """Give back to the system what is free now; a process that stays keeps no more than it uses."""
    with contextlib.suppress(AttributeError, OSError, TypeError):
        ctypes.CDLL(None).malloc_trim(0)
