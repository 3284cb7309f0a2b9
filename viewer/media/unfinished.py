"""Temporary files that would be left behind if the process had to end immediately.

Their names contain the machine and the process that owns them::

    .walk.bvh.tmp0a1b2c3d-4711-k3j2h1g0      8 hexadecimal digits of the machine, process, random

so that a later run can remove those of a process that was killed, and no others.
"""

from __future__ import annotations

import contextlib
import functools
import os
import re
import zlib
from collections import defaultdict, deque
from collections.abc import Iterable
from pathlib import Path

_LONGEST = 40  # maximum number of characters of a file's name in that of its temporary file
_MARK = ".tmp"  # distinguishes temporary files from hidden files of the user
# Maximum number of registered files in all threads; far fewer are written simultaneously.
_MOST = 64

_unfinished: deque[Path] = deque(maxlen=_MOST)

# The module tempfile appends a random part of eight characters.
_LEFTOVER = re.compile(r"(\..+\.tmp)(?:([0-9a-f]{8})-([0-9]+)-)?[a-z0-9_]{8}(\.\w+)?", re.DOTALL)


def temporary_prefix(name: str) -> str:
    """Return the beginning of the names of a file's temporary files, different for every file."""
    if len(name) > _LONGEST:
        from hashlib import blake2b  # loads OpenSSL, which few names need

        digest = blake2b(os.fsencode(name), digest_size=8).hexdigest()
        name = f"{name[: _LONGEST - len(digest)]}{digest}"
    return f".{name}{_MARK}"


def note_unfinished(path: Path) -> None:
    """Register a temporary file; it need not be unregistered when it is renamed or removed."""
    _unfinished.append(path)


def remove_unfinished() -> None:
    """Remove registered files that still exist. Call it only when the process ends."""
    for path in [*_unfinished]:
        with contextlib.suppress(OSError):
            path.unlink(missing_ok=True)


def new_prefix(folder: str | Path, name: str) -> str:
    """Return the prefix of a new temporary file or folder, and remove those of dead processes."""
    folder = os.path.abspath(folder)  # noqa: PTH100
    process = os.getpid()
    if (folder, process) not in _searched:
        _searched.add((folder, process))
        _remove_abandoned(folder)
    return f"{temporary_prefix(name)}{_machine()}-{process}-"


_searched: set[tuple[str, int]] = set()


@functools.cache
def _machine() -> str:
    """Return a key of this machine and, in a container, of its process numbers."""
    key = os.uname().nodename if hasattr(os, "uname") else ""
    with contextlib.suppress(OSError):
        key += os.readlink("/proc/self/ns/pid")  # noqa: PTH115
    return f"{zlib.crc32(key.encode('utf-8', 'replace')):08x}"


def _remove_abandoned(folder: str) -> None:
    """Remove temporary files and folders in a folder if their process on this machine has died."""
    if os.name != "posix":  # elsewhere, asking for a process would end it
        return
    import shutil

    with contextlib.suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            found = _LEFTOVER.fullmatch(entry.name)
            if not found or found[2] != _machine() or _is_alive(int(found[3])):
                continue
            with contextlib.suppress(OSError):
                if entry.stat(follow_symlinks=False).st_uid != os.getuid():
                    continue
                if entry.is_dir(follow_symlinks=False):
                    shutil.rmtree(entry.path, ignore_errors=True)
                else:
                    os.unlink(entry.path)  # noqa: PTH108


def _is_alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):  # of another user, or no number of a process
        return True
    return True


def remove_leftovers(targets: Iterable[str]) -> None:
    """Remove temporary files next to some files, left by processes that were killed."""
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
                if found and f"{found[1]}\n{found[4] or ''}" in names:
                    with contextlib.suppress(OSError):
                        os.unlink(entry.path)  # noqa: PTH108
