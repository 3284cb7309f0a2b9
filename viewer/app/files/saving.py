"""Saving of files, with a message about the result."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from viewer.app.core.state import AppState
from viewer.errors import ViewerError
from viewer.formats import check_targets
from viewer.phrases import printable

__all__ = ["save_files"]


def save_files(state: AppState, act: Callable[[], object], files: list[Path]) -> None:
    """Write files unless the scene was read from one of them, and show the result."""
    try:
        # The dialog has already asked whether to replace existing files.
        check_targets(files, state.inputs, force=True)
        act()
        state.say(f"Saved {', '.join(printable(file, 200) for file in files)}")
    except ViewerError as problem:
        state.error = str(problem)
