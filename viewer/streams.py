"""Standard streams, including closed, full and abandoned ones."""

from __future__ import annotations

import contextlib
import io
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TextIO, cast

from viewer.errors import OutputError
from viewer.phrases import printable

_STDOUT = ("/dev/stdout", "/dev/fd/1", "/proc/self/fd/1")
_MOST_LINKS = 40  # the limit of the Linux kernel


def is_stdout(path: str | Path) -> bool:
    """Return whether a path names standard output, or is a link to such a name."""
    # A file to which the stream is redirected does not count. It must never be replaced, because
    # the caller may append to it.
    text = str(path)
    for _ in range(_MOST_LINKS):
        if text in _STDOUT:
            return True
        try:
            text = str(Path(text).parent / Path(text).readlink())
        except (OSError, ValueError):
            return False
    return False


def require_stdout(path: str | Path) -> None:
    """Check that standard output, which a path names, is not closed."""
    if is_stdout(path) and getattr(sys.stdout, "buffer", None) is None:
        raise OutputError(f"{printable(path, 300)}: standard output is closed")


def write_stdout(path: str | Path, data: bytes) -> None:
    """Write bytes to standard output."""
    require_stdout(path)
    try:
        sys.stdout.flush()
        sys.stdout.buffer.write(data)
        sys.stdout.buffer.flush()
    except BrokenPipeError:
        raise
    except (OSError, ValueError) as problem:
        raise OutputError.at(path, problem) from None


def summary_stream(output: str | Path) -> TextIO:
    """Return the stream for a summary: standard error if the output goes to standard output."""
    return sys.stderr if is_stdout(output) else sys.stdout


@contextlib.contextmanager
def standard_streams() -> Iterator[None]:
    """Ignore errors of messages in the block, and reserve the standard descriptors."""
    # A message that cannot be written changes neither result nor exit code. If the error stream is
    # closed, messages are dropped; ``print`` would write them into the output.
    before = sys.stderr
    with contextlib.ExitStack() as stack:
        if sys.stdin is None or sys.stdout is None or before is None:
            # Closed descriptors are opened, so that a library's output can't end up in a result.
            while (descriptor := os.open(os.devnull, os.O_RDWR)) < 3:
                stack.callback(os.close, descriptor)
            os.close(descriptor)
        messages = stack.enter_context(Path(os.devnull).open("w")) if before is None else before
        sys.stderr = cast("TextIO", _Messages(messages))
        try:
            yield
        finally:
            sys.stderr = before


class _Messages(io.TextIOBase):
    """A text stream that ignores its errors."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        """Write text, or drop it if that fails."""
        try:
            self._stream.write(text)
        except (OSError, ValueError):
            self._lose()
        return len(text)

    def flush(self) -> None:
        """Write buffered text, or drop it if that fails."""
        try:
            self._stream.flush()
        except (OSError, ValueError):
            self._lose()

    def isatty(self) -> bool:
        """Return whether the stream is a terminal."""
        return not self._stream.closed and self._stream.isatty()

    def fileno(self) -> int:
        """Return the descriptor of the stream itself."""
        return self._stream.fileno()

    def _lose(self) -> None:
        # Python would report text that is still buffered when it exits.
        with contextlib.suppress(OSError, ValueError):  # not a real file, as in tests
            null = os.open(os.devnull, os.O_WRONLY)
            os.dup2(null, self._stream.fileno())
            os.close(null)
