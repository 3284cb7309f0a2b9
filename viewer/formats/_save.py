"""Write files so that nobody ever sees half of one: a temporary file first, then a rename."""

from __future__ import annotations

import contextlib
import os
import stat
import tempfile
from pathlib import Path

from viewer.errors import OutputError, printable

__all__ = ["save_bytes", "save_text"]


def save_text(path: str | Path, text: str) -> None:
    """Write text as UTF-8 with LF line ends; see ``save_bytes``."""
    save_bytes(path, text.encode("utf-8", "surrogateescape"))


def save_bytes(path: str | Path, data: bytes) -> None:
    """Replace a file's content in one step, or leave everything as it was.

    A link is followed. A device or pipe is written to directly, never replaced. The new file
    keeps the old one's permissions.

    Parameters
    ----------
    path : str or Path
        The file to create or replace.
    data : bytes
        Its new content.

    Raises
    ------
    OutputError
        With the path and the system's reason.
    """
    path = Path(path)
    try:
        target = path.resolve()
        mode = _mode(target)
        if stat.S_ISDIR(mode):
            raise IsADirectoryError(None, "is a folder")
        if not stat.S_ISREG(mode):
            _write_through(target, data)
        else:
            _replace(target, data, stat.S_IMODE(mode))
    except (OSError, ValueError, RuntimeError) as problem:
        reason = getattr(problem, "strerror", None) or problem
        raise OutputError(f"{printable(path, 300)}: {reason}") from None


def _mode(target: Path) -> int:
    """Return type and permissions of the target, or those that a new file would get."""
    try:
        return target.stat().st_mode
    except FileNotFoundError:
        mask = os.umask(0)
        os.umask(mask)
        return stat.S_IFREG | (0o666 & ~mask)


def _write_through(target: Path, data: bytes) -> None:
    # Closing may fail too: /dev/full reports its error only there.
    with target.open("wb") as stream:
        stream.write(data)


def _replace(target: Path, data: bytes, permissions: int) -> None:
    if not target.parent.is_dir():
        raise FileNotFoundError(None, f"the folder {target.parent} does not exist")
    handle, name = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name[:40]}.")
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(data)
            stream.flush()
            os.fsync(stream.fileno())
        Path(name).chmod(permissions)
        Path(name).replace(target)
    except BaseException:  # also Ctrl-C: the temporary file must not stay behind
        with contextlib.suppress(OSError):
            Path(name).unlink()
        raise
