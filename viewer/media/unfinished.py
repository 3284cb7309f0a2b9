"""Temporary files that would be left behind if the process had to end immediately."""

from __future__ import annotations

import contextlib
import os
import re
from collections import defaultdict, deque
from collections.abc import Iterable
from pathlib import Path

__all__ = [
    "note_unfinished",
    "remove_leftovers",
    "remove_unfinished",
    "temporary_prefix",
]

_LONGEST = 40  # maximum number of characters of a file's name in that of its temporary file
_MARK = ".tmp"  # distinguishes temporary files from hidden files of the user
# Maximum number of registered files in all threads; far fewer are written simultaneously.
_MOST = 64

_unfinished: deque[Path] = deque(maxlen=_MOST)


def temporary_prefix(name: str) -> str:
    """Return the beginning of the names of a file's temporary files, different for every file.

    >>> temporary_prefix("walk.bvh")
    '.walk.bvh.tmp'
    """
    if len(name) > _LONGEST:
        from hashlib import blake2b  # loads OpenSSL, which few names need

        digest = blake2b(os.fsencode(name), digest_size=8).hexdigest()
        name = f"{name[: _LONGEST - len(digest)]}{digest}"
    return f".{name}{_MARK}"


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


# The module tempfile appends a random part of eight characters.
_LEFTOVER = re.compile(r"(\..+)[a-z0-9_]{8}(\.\w+)?", re.DOTALL)


def remove_leftovers(targets: Iterable[str]) -> None:
    """Remove temporary files next to some files, left by processes that were killed.

    Parameters
    ----------
    targets : iterable of str
        Files that no other process is writing.
    """
    folders = defaultdict[str, set[str]](set)
    for target in targets:
        folder, name = os.path.split(target)
        path = Path(name)
        # Libraries that write a file by its name need its suffix.
        own = f"{temporary_prefix(name)}\n", f"{temporary_prefix(path.stem)}\n{path.suffix}"
        folders[folder] |= {*own}
    for folder, names in folders.items():
        with contextlib.suppress(OSError), os.scandir(folder or ".") as entries:
            for entry in entries:
                found = _LEFTOVER.fullmatch(entry.name)
                if found and f"{found[1]}\n{found[2] or ''}" in names:
                    with contextlib.suppress(OSError):
                        os.unlink(entry.path)  # noqa: PTH108
