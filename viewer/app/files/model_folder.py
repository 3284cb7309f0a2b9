"""Choice of the folder of body models."""

from __future__ import annotations

from pathlib import Path

from viewer.app.core.state import AppState
from viewer.app.files.state import Files
from viewer.errors import ViewerError
from viewer.models import known_models, save_model_folder
from viewer.phrases import counted, printable

__all__ = ["set_model_folder"]


def set_model_folder(state: AppState, paths: list[Path]) -> None:
    """Remember the first path as the folder of body models, and show how many it contains."""
    try:
        folder = save_model_folder(paths[0])
    except ViewerError as problem:
        state.error = str(problem)
        return
    state.of(Files).model_folder = folder
    count = len(known_models(folder))
    state.say(f"{counted(count, 'body model')} in {printable(folder, 200)}")
