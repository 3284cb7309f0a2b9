"""File formats: one module each, found by content first and by suffix second."""

from __future__ import annotations

import re
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

from viewer.errors import FormatError, UnsupportedFormatError
from viewer.formats._image import save_image
from viewer.formats._save import free_path, save_bytes
from viewer.formats._source import MAX_SIZE, Source
from viewer.rig.clip import Clip
from viewer.rig.figure import Figure

__all__ = [
    "FORMATS",
    "MAX_SIZE",
    "Format",
    "Source",
    "detect",
    "free_path",
    "read",
    "save_bytes",
    "save_image",
    "write",
]

_HEAD = 1 << 16  # bytes in which a file has to show what it is


@dataclass(frozen=True, slots=True)
class Format:
    """What menus and dialogs must know before a format's module is imported.

    Attributes
    ----------
    title : str
        For menus and the README.
    suffix : str
        With its dot.
    signature : bytes
        Regular expression that the head of every such file contains.
    """

    title: str
    suffix: str
    signature: bytes


FORMATS = {
    "skel": Format("skeleton (CSE169)", ".skel", rb"(?:^|[\s{}])balljoint(?=[\s{]|$)"),
    "skin": Format(
        "skin (CSE169)",
        ".skin",
        rb"(?:^|[\s}])(?:positions|normals|texcoords|skinweights|triangles|bindings)\s+[-+\w]",
    ),
    "anim": Format("clip (CSE169)", ".anim", rb"(?:^|\s)animation\s*\{"),
}
"""Modules in this folder; each has ``read(source)``, ``write(figure or clip, path)``, or both."""


def detect(source: Source) -> str:
    """Return the key in ``FORMATS`` of a file, judged by its content, then by its suffix.

    Parameters
    ----------
    source : Source
        The file; a suffix that belongs to another format is added to its warnings.

    Raises
    ------
    FormatError
        If no format claims it; the message says what it looks like.
    """
    suffix = source.path.suffix.lower()
    by_suffix = next((key for key, kind in FORMATS.items() if kind.suffix == suffix), None)
    head = source.head(_HEAD)
    if by_suffix and re.search(FORMATS[by_suffix].signature, head):
        return by_suffix
    for key, kind in FORMATS.items():
        if re.search(kind.signature, head):
            if by_suffix:
                source.warn(f"is a {kind.suffix}, named {suffix}")
            return key
    looks = source.looks_like()
    if by_suffix and looks is None:
        return by_suffix  # its reader knows best what is missing
    wanted = " or ".join(kind.suffix for kind in FORMATS.values())
    if by_suffix:
        wanted = FORMATS[by_suffix].suffix
    raise FormatError(source.path, f"expected a {wanted} file, found {looks or 'something else'}")


def read(source: Source) -> Figure | Clip:
    """Read whatever the file holds; see the format modules for what they raise."""
    return import_module(f"{__name__}.{detect(source)}").read(source)


def write(content: Figure | Clip, path: str | Path) -> None:
    """Write a clip or a figure, or the part of it that the format of the suffix holds.

    A file of that name is replaced.

    Parameters
    ----------
    content : Figure or Clip
        What to write.
    path : str or Path
        Its suffix chooses the format.

    Raises
    ------
    UnsupportedFormatError
        If no format has this suffix, or it cannot hold the content.
    OutputError
        If the file cannot be written.
    """
    suffix = Path(path).suffix.lower()
    for key, kind in FORMATS.items():
        if kind.suffix == suffix:
            import_module(f"{__name__}.{key}").write(content, path)
            return
    known = ", ".join(kind.suffix for kind in FORMATS.values())
    raise UnsupportedFormatError(f'no writer for "{suffix}"; there are: {known}')
