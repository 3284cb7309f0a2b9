"""Actions that move the camera."""

from __future__ import annotations

from viewer.app.core.fitting import fit_again, fit_shown
from viewer.app.core.state import AppState
from viewer.errors import ViewerError
from viewer.rendering.camera import Camera, camera_from_view, look_from
from viewer.rendering.camera_notes import image_notes, lens_notes
from viewer.rig.inspection.front import Front

__all__ = ["face", "fit_view", "look", "look_through", "toggle_projection"]


def fit_view(state: AppState) -> None:
    """Aim the camera at the scene as it is posed and fill the view with it."""
    fit_shown(state)


def look(state: AppState, name: str) -> None:
    """Rotate the camera to a named view, and fit it to the scene."""
    state.camera.fixed = None
    look_from(state.camera, name)
    fit_again(state)


def face(state: AppState, front: Front) -> None:
    """Set the axis that the figures face, "auto" to estimate it, and rotate the camera with it."""
    state.set_front(front)
    fit_again(state)


def look_through(state: AppState, index: int) -> None:
    """Look through a calibrated camera of the capture; -1 frees the camera at its position."""
    if index < 0:
        state.camera.fixed = None
        return
    view = state.scene.views[index]
    size = (max(round(state.view_rect[2]), 1), max(round(state.view_rect[3]), 1))
    try:
        seen = camera_from_view(view, size, state.scene.up, state.box)
    except ViewerError as problem:
        state.error = str(problem)
        return
    seen.front = state.camera.front
    for name in Camera.__slots__:
        setattr(state.camera, name, getattr(seen, name))
    for note in (*image_notes(state.scene, view), *lens_notes(state.scene, view)):
        state.say(note[0].upper() + note[1:])


def toggle_projection(state: AppState) -> None:
    """Switch between perspective and parallel projection."""
    state.camera.fixed = None
    state.camera.orthographic = not state.camera.orthographic
    state.say_status("Orthographic" if state.camera.orthographic else "Perspective")
