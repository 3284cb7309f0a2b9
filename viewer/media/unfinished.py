"""Temporary files that would be left behind if the process had to end immediately."""

from __future__ import annotations

import contextlib
from collections import deque
from pathlib import Path

__all__ = ["note_unfinished", "remove_unfinished"]

# Maximum number of registered files in all threads; far fewer are written simultaneously.
_MOST = 64

_unfinished: deque[Path] = deque(maxlen=_MOST)


def note_unfinished(path: Path) -> None:
    """Register a temporary file; it need not be unregistered when it is renamed or removed.

    Parameters
    ----------
    path : Path
        Path that contains a unique part.
    """
    _unfinished.append(path)


def remove_unfinished() -> None:
    """Remove registered files that still exist. Call it only when the process ends."""
    for path in [*_unfinished]:
        with contextlib.suppress(OSError):
            path.unlink(missing_ok=True)
