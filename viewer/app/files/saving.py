"""Saving of files from the window, which says what was saved or why nothing was."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from viewer.app.core.state import AppState
from viewer.errors import ViewerError, printable
from viewer.formats import check_targets

__all__ = ["save_files"]


def save_files(state: AppState, act: Callable[[], None], files: list[Path]) -> None:
    """Write files unless one of them was opened, and say which, or why not."""
    try:
        # The dialog has asked what becomes of files that are there.
        check_targets(files, state.inputs, force=True)
        act()
        state.say(f"Saved {', '.join(printable(file, 200) for file in files)}")
    except ViewerError as problem:
        state.error = str(problem)
