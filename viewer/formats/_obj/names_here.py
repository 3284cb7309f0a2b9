"""Names of referenced files in this folder, if a library contains names from another computer."""

from __future__ import annotations

from pathlib import Path, PurePosixPath

from viewer.formats._references import referenced_path

__all__ = ["name_here"]


def name_here(folder: Path, written: str) -> str | None:
    """Return the name under which a referenced file exists in a folder, None if it does not.

    The name without quotes and its last component are tried in turn, ignoring case as Windows does,
    since many programs write the path that the file had when it was exported.

    Parameters
    ----------
    folder : Path
        Folder of the library.
    written : str
        Name as written, possibly with backslashes.
    """
    name = written.strip("\"'").replace("\\", "/")
    for tried in (name, name.rsplit("/", 1)[-1]):
        path = referenced_path(folder, tried) if tried else None
        if path is not None and _is_file(path):
            return tried
        found = None if path is None else _in_any_case(folder, tried)
        if found is not None:
            return found
    return None


def _in_any_case(folder: Path, name: str) -> str | None:
    """Return the only file whose path differs from a name only by case."""
    here, parts = folder, []
    for part in PurePosixPath(name).parts:
        try:
            same = [each.name for each in here.iterdir() if each.name.lower() == part.lower()]
        except (OSError, ValueError):
            return None
        if len(same) != 1:
            return None
        parts.append(same[0])
        here = here / same[0]
    return "/".join(parts) if _is_file(here) else None


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except OSError:  # the name is too long for a file
        return False
