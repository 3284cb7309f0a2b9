"""Saving of files from the window, with a message about the result."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from viewer.app.core.state import AppState
from viewer.errors import ViewerError
from viewer.formats import check_targets
from viewer.phrases import printable

__all__ = ["save_files"]


def save_files(state: AppState, act: Callable[[], None], files: list[Path]) -> None:
    """Write files unless one of them is open; show which were saved, or why none was."""
    try:
        # The dialog has asked what becomes of files that are there.
        check_targets(files, state.inputs, force=True)
        act()
        state.say(f"Saved {', '.join(printable(file, 200) for file in files)}")
    except ViewerError as problem:
        state.error = str(problem)
