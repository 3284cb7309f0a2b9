"""Files that a file names: the one rule for where they may be.

A file may name only what lies below its own folder, links resolved: opening or converting a
stranger's model must not show or pass on pictures from elsewhere on the disk. What is refused is
said: a figure is drawn without the texture, and a ``.rig`` that names such a file is refused.

The folder is that of the path as it was opened. If the path is a link, names are looked up beside
the link, as other programs do, not beside the file it leads to. What the user names on the command
line or in a dialog may lie anywhere, and so may the files of a folder that the user opens.
"""

from __future__ import annotations

import os
import re
from pathlib import Path

from viewer.diagnostics import Phrase

__all__ = ["referenced_path", "refused_text"]

_DRIVE = re.compile(r"[A-Za-z]:")


def referenced_path(folder: Path, name: str) -> Path | None:
    """Return the path of a file that another file names, None if it leads out of the folder.

    Parameters
    ----------
    folder : Path
        Of the file that names it.
    name : str
        As written; back slashes count as slashes. The file need not exist.
    """
    written = name.replace("\\", "/")
    if _is_absolute(written):
        return None
    path = folder / written
    try:
        # Unlike Path.resolve(), this raises nothing for links in a circle: reading says it.
        inside, base = Path(os.path.realpath(path)), Path(os.path.realpath(folder))
    except ValueError:  # a name with a NUL, which no file has
        return path
    return path if inside != base and inside.is_relative_to(base) else None


def refused_text(name: str) -> Phrase:
    """Return why ``referenced_path`` gives no path, to follow the file's name in a message.

    >>> str(refused_text("../a.png")), str(refused_text("/home/a.png"))
    ('lies outside the folder: not read', 'is an absolute path: not followed, not read')
    """
    is_absolute = _is_absolute(name.replace("\\", "/"))
    return Phrase("absolute-path") if is_absolute else Phrase("outside-folder")


def _is_absolute(written: str) -> bool:
    return written.startswith("/") or _DRIVE.match(written) is not None
