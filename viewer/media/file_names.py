"""Names derived from the files and folders that were opened."""

from __future__ import annotations

import os
from pathlib import Path

__all__ = ["file_stem", "folder_name", "opened_text"]

_LONGEST = 100  # letters of a stem
_INSIDE = ("smpl_full", "smplfull", "smpl", "keypoints3d", "core_txt_files")
"""Folders that every EasyMocap recording, or every copy of the PIG model, calls the same."""


def folder_name(path: Path) -> str:
    """Return what a folder's content is called: after the folder that a person has named.

    >>> folder_name(Path("/takes/dance.v2/smpl")), folder_name(Path("/models/hog"))
    ('dance.v2', 'hog')
    """
    whole = _whole(path)
    named = (folder.name for folder in (whole, *whole.parents) if folder.name not in _INSIDE)
    return next(named, "") or whole.name


def opened_text(path: Path) -> str:
    """Return what titles and menus call a file or folder that was opened.

    >>> opened_text(Path("takes/walk.bvh")), opened_text(Path("/takes/dance/smpl"))
    ('walk.bvh', 'dance/smpl')
    """
    whole = _whole(path)
    name = whole.name or str(whole)
    return f"{folder_name(whole)}/{name}" if name in _INSIDE else name


def _whole(path: Path) -> Path:
    """Return a path from the root: "." has no name of its own, and a link keeps the one it has."""
    return Path(os.path.abspath(path))  # noqa: PTH100  resolve() would follow links


def file_stem(name: str, otherwise: str = "picture") -> str:
    """Return a name as the stem of a file: what could confuse a shell becomes an underscore.

    >>> file_stem("dance 0"), file_stem("a/b"), file_stem("")
    ('dance_0', 'a_b', 'picture')
    """
    safe = "".join(letter if letter.isalnum() or letter in "-_." else "_" for letter in name)
    return safe[:_LONGEST] or otherwise
