"""Files that are referenced by other files: where they may be, and images.

A file may reference only files in or below its folder, with links resolved: opening or converting a
downloaded model must not show or copy images from elsewhere on the disk. Refused references are
reported: the figure is drawn without the texture, and a ``.rig`` that references such a file is
rejected.

The folder is the one that contains the opened path. If the path is a link, names are looked up next
to the link, as other programs do, not next to its target. Files that the user specifies on the
command line or in a dialog may be anywhere, as may the files of a folder that the user opens.
"""

from __future__ import annotations

import os
import re
from pathlib import Path

from viewer.diagnostics import Phrase, wording
from viewer.errors import FormatError
from viewer.formats._source import Source, read_bytes
from viewer.media.image import decode_picture
from viewer.rigs.arrays import Bytes

_DRIVE = re.compile(r"[A-Za-z]:")


def referenced_path(folder: Path, name: str) -> Path | None:
    """Return the path of a referenced file; None if it leads out of the folder."""
    written = name.replace("\\", "/")
    if _is_absolute(written):
        return None
    path = folder / written
    try:
        # Unlike Path.resolve(), this does not raise for circular links; reading reports them.
        inside, base = Path(os.path.realpath(path)), Path(os.path.realpath(folder))
    except ValueError:  # the name has a NUL character, which is invalid in a path
        return path
    return path if inside != base and inside.is_relative_to(base) else None


def refused_text(name: str) -> Phrase:
    """Return the reason why ``referenced_path`` returns None, phrased to follow the file name."""
    is_absolute = _is_absolute(name.replace("\\", "/"))
    return (
        Phrase("is an absolute path: not read")
        if is_absolute
        else Phrase("is outside the folder: not read")
    )


def is_file(path: Path) -> bool:
    """Return whether a path is an existing file."""
    try:
        return path.is_file()
    except OSError:  # the name is too long for a file
        return False


def _is_absolute(written: str) -> bool:
    return written.startswith("/") or _DRIVE.match(written) is not None


def load_image(source: Source, name: str, offset: int | str | None) -> Bytes | None:
    """Return a texture's pixels as ``read_picture``, or None with a warning about its path."""
    path = referenced_path(source.path.parent, name)
    if path is None:
        source.warn(
            "F005.texture-refused: texture {name} {reason}",
            offset,
            name=name,
            reason=refused_text(name),
        )
        return None
    source.also_read.append(path)
    try:
        return decode_picture(path, read_bytes(path))
    except FormatError as problem:
        source.warn(wording.TEXTURE, offset, problem=problem.diagnostic)
        return None


def read_picture(source: Source) -> Bytes:
    """Return the pixels of an image file: (H, W, 4) uint8, sRGB with alpha, top row first."""
    return decode_picture(source.path, source.data)
