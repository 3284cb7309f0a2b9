"""Screenshots of the view."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from viewer.app.core.state import AppState
from viewer.errors import ViewerError
from viewer.formats import free_path, save_image
from viewer.phrases import printable
from viewer.rig.arrays import Bytes

__all__ = ["save_screenshot"]


def save_screenshot(state: AppState, picture: Callable[[], Bytes]) -> None:
    """Save an image of the scene under an unused name in the current folder.

    Parameters
    ----------
    state : AppState
        State that receives a message.
    picture : callable
        Returns the image, (H, W, 4) uint8; may raise ViewerError.
    """
    try:
        path = free_path(Path.cwd(), state.scene.title, ".png")
        save_image(path, picture())
        state.say(f"Saved {printable(path, 200)}")
        if "##legend" in state.item_rects:  # drawn over the image, not into it
            state.say('Saved without the legend: turn on "Legend in pictures" in the Weights panel')
    except ViewerError as problem:
        state.error = str(problem)
    except OSError as problem:
        state.error = f"the current folder: {problem.strerror}"
