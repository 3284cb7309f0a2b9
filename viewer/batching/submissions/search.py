"""Search for submissions: the folders and archives in a folder."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from viewer.batching.submissions.choosing import is_junk, suffix_of
from viewer.data_classes import dataclass
from viewer.formats import SUFFIXES

__all__ = ["Found", "find_submissions", "is_archive"]

_ARCHIVES = (".zip", ".rar", ".7z", ".tar", ".tgz", ".tar.gz", ".tar.bz2", ".tar.xz")


@dataclass(frozen=True, slots=True)
class Found:
    """Submissions, and other files.

    Attributes
    ----------
    submissions : tuple of Path
        Folders and archives.
    ignored : tuple of Path
        Other files next to them.
    """

    submissions: tuple[Path, ...]
    ignored: tuple[Path, ...] = ()


def is_archive(path: str) -> bool:
    """Return whether a file is named like an archive; only zip archives are opened."""
    return path.lower().endswith(_ARCHIVES)


def find_submissions(paths: Sequence[str | Path]) -> Found:
    """Return the submissions that paths refer to, in the order of the paths, then by name.

    Parameters
    ----------
    paths : sequence of str or Path
        If there are several, each is a submission. A single folder is a submission if it directly
        contains readable files; otherwise, each of its folders and archives is one.
    """
    given = [Path(path) for path in paths]
    entries = _entries(given[0]) if len(given) == 1 else []
    inside = [one for one in entries if one.is_dir() or is_archive(one.name)]
    if not inside or any(_is_rig_file(entry) for entry in entries):
        return Found(tuple(dict.fromkeys(given)))
    return Found(tuple(inside), tuple(one for one in entries if one not in inside))


def _entries(folder: Path) -> list[Path]:
    if not folder.is_dir():
        return []
    return sorted(one for one in folder.iterdir() if not is_junk(one.name))


def _is_rig_file(file: Path) -> bool:
    # Grade tables are often next to the submissions.
    suffix = suffix_of(file.name)
    return file.is_file() and suffix in SUFFIXES and suffix not in (".txt", ".json")
