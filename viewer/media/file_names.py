"""Names derived from the paths of opened files and folders."""

from __future__ import annotations

import os
import re
from pathlib import Path

_DIGITS = re.compile(r"[0-9]+")
_LONGEST = 100  # maximum length of a stem in characters
_INSIDE = ("smpl_full", "smplfull", "smpl", "keypoints3d", "core_txt_files")
"""Names of folders that exist in every EasyMocap recording or copy of the PIG model."""


def folder_name(path: Path) -> str:
    """Return a name for a folder's contents: that of the nearest folder named by the user.

    >>> folder_name(Path("/takes/dance.v2/smpl")), folder_name(Path("/models/hog"))
    ('dance.v2', 'hog')
    """
    whole = _whole(path)
    named = (folder.name for folder in (whole, *whole.parents) if folder.name not in _INSIDE)
    return next(named, "") or whole.name


def opened_text(path: Path) -> str:
    """Return the name of an opened file or folder in titles and menus.

    >>> opened_text(Path("takes/walk.bvh")), opened_text(Path("/takes/dance/smpl"))
    ('walk.bvh', 'dance/smpl')
    """
    whole = _whole(path)
    name = whole.name or str(whole)
    return f"{folder_name(whole)}/{name}" if name in _INSIDE else name


def _whole(path: Path) -> Path:
    """Return an absolute path, because "." has no name; links keep their own name."""
    return Path(os.path.abspath(path))  # noqa: PTH100  resolve() would follow links


def file_stem(name: str, otherwise: str = "picture") -> str:
    """Return a name as the stem of a file; characters special to shells become underscores.

    >>> file_stem("dance 0"), file_stem("a/b"), file_stem("")
    ('dance_0', 'a_b', 'picture')
    """
    safe = "".join(letter if letter.isalnum() or letter in "-_." else "_" for letter in name)
    return safe[:_LONGEST] or otherwise


def natural_key(path: str) -> tuple[str, str]:
    """Return a sort key that orders paths part by part, with numbers by value.

    >>> sorted(["a/walk10", "a/walk9", "a-b/walk1"], key=natural_key)
    ['a/walk9', 'a/walk10', 'a-b/walk1']
    """
    # A longer number is larger, and a folder is compared as a whole before its contents.
    return _DIGITS.sub(_with_length, path.casefold()).replace("/", "\0"), path


def _with_length(number: re.Match[str]) -> str:
    digits = number[0].lstrip("0")
    return f"{len(digits):03}{digits}"
