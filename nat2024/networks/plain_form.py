"""Whether networks compute what they are defined as, or a faster form of the same numbers."""

import contextlib
from collections.abc import Iterator
from contextvars import ContextVar

_is_plain: ContextVar[bool] = ContextVar("_is_plain", default=False)


@contextlib.contextmanager
def plain_form() -> Iterator[None]:
    """Compute with every product that the definition has meanwhile, to count them."""
    token = _is_plain.set(True)
    try:
        yield
    finally:
        _is_plain.reset(token)


def is_plain() -> bool:
    """Whether forms with fewer products are out of question now."""
    return _is_plain.get()
