"""Temporary files that would stay behind if the process had to end at once."""

from __future__ import annotations

import contextlib
from collections import deque
from pathlib import Path

__all__ = ["note_unfinished", "remove_unfinished"]

_MOST = 64  # at a time, of all threads: far fewer are written at once

_unfinished: deque[Path] = deque(maxlen=_MOST)


def note_unfinished(path: Path) -> None:
    """Remember a temporary file; renamed or removed later, it need not be forgotten.

    Parameters
    ----------
    path : Path
        With a part that nothing else is called.
    """
    _unfinished.append(path)


def remove_unfinished() -> None:
    """Remove those that are still there. Call it only where the process ends."""
    for path in [*_unfinished]:
        with contextlib.suppress(OSError):
            path.unlink(missing_ok=True)
