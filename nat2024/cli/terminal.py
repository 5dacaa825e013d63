"""Names from files on a terminal: what would steer it is shown instead of obeyed.

A folder, an archive or a manifest of a stranger can hold names with escape sequences, which clear
lines, forge output or write to the clipboard. Files and pipes get every letter as it is.
"""

import contextlib
import re
import sys
from collections.abc import Iterator
from typing import Any, TextIO

# all control characters but tab and line end; the colours of our own tables pass
_STEERING = re.compile(
    "\x1b(?!\\[[0-9;]*m)|[\0-\x08\x0b-\x1a\x1c-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]"
)


def shown(text: str) -> str:
    """The text with characters that steer a terminal in letters of ASCII; colours stay."""
    return _STEERING.sub(lambda found: ascii(found[0])[1:-1], text)


class _Shown:
    """A terminal to which `shown` text is written; a progress bar may go back in its line."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        """Write text, harmless; gives its length."""
        if not isinstance(text, str):
            msg = f"a terminal takes text, not {type(text).__name__}"
            raise TypeError(msg)
        start = text[:1] if text.startswith("\r") else ""
        self._stream.write(start + shown(text[len(start) :].replace("\r\n", "\n")))
        return len(text)

    def writelines(self, lines: Any) -> None:
        """Write several texts."""
        for line in lines:
            self.write(line)

    def __getattr__(self, name: str) -> Any:
        """All else is the stream's own."""
        return getattr(self._stream, name)


@contextlib.contextmanager
def harmless_terminal() -> Iterator[None]:
    """While this lasts, nothing that is printed can steer the terminal."""
    before = sys.stdout, sys.stderr
    wrapped: list[Any] = [
        _Shown(stream) if stream is not None and stream.isatty() else stream for stream in before
    ]
    sys.stdout, sys.stderr = wrapped
    try:
        yield
    finally:
        sys.stdout, sys.stderr = before
