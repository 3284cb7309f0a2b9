"""Recent files, closed panels and their arrangement, stored between runs."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Sequence
from pathlib import Path

import platformdirs

from viewer.errors import OutputError
from viewer.formats import save_bytes

__all__ = [
    "load_arranged",
    "load_closed_panels",
    "load_recent",
    "remember",
    "save_arranged",
    "save_closed_panels",
    "state_folder",
]

_MOST = 12


def state_folder() -> Path:
    """Return the folder in which layout and recent files are stored."""
    return Path(platformdirs.user_state_dir("viewer", appauthor=False))


def load_recent() -> list[tuple[str, ...]]:
    """Return groups of files that were opened together, latest first; empty if unreadable."""
    try:
        groups = json.loads((state_folder() / "recent.json").read_text("utf-8"))
        lists = [group for group in groups if isinstance(group, list) and group]
        return [tuple(map(str, group)) for group in lists][:_MOST]
    except (OSError, ValueError, TypeError, RecursionError):
        return []


def remember(recent: list[tuple[str, ...]], paths: Sequence[Path]) -> str:
    """Move files to the front of the list and save it; return an error message, empty if saved.

    Parameters
    ----------
    recent : list
        Groups of files, modified in place.
    paths : sequence of Path
        Files that were opened together.
    """
    if not paths:
        return ""
    try:
        group = tuple(str(path.resolve()) for path in paths)
        recent[:] = [group, *(old for old in recent if old != group)][:_MOST]
        state_folder().mkdir(parents=True, exist_ok=True)
        text = json.dumps([list(old) for old in recent], indent=1)
        save_bytes(state_folder() / "recent.json", text.encode("utf-8", "replace"))
    except (OSError, RuntimeError, OutputError) as problem:  # resolve() raises both
        return f"recent files could not be saved: {problem}"
    return ""


def load_closed_panels() -> set[str]:
    """Return the panels that were closed in the last run; empty if unreadable."""
    try:
        names = json.loads((state_folder() / "closed.json").read_text("utf-8"))
        return {name for name in names if isinstance(name, str)}
    except (OSError, ValueError, TypeError, RecursionError):
        return set()


def save_closed_panels(names: set[str]) -> None:
    """Store which panels are closed; an unwritable folder is ignored."""
    with contextlib.suppress(OSError, OutputError):
        state_folder().mkdir(parents=True, exist_ok=True)
        save_bytes(state_folder() / "closed.json", json.dumps(sorted(names)).encode())


def load_arranged() -> bool:
    """Return whether the stored layout is the user's own; a stored default is rebuilt."""
    try:
        return json.loads((state_folder() / "arranged.json").read_text("utf-8")) is True
    except (OSError, ValueError, RecursionError):
        return False


def save_arranged(is_arranged: bool) -> None:
    """Store whether the user has arranged the panels; an unwritable folder is ignored."""
    with contextlib.suppress(OSError, OutputError):
        state_folder().mkdir(parents=True, exist_ok=True)
        save_bytes(state_folder() / "arranged.json", json.dumps(is_arranged).encode())
