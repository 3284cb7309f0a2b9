"""View through a calibrated camera, which may move."""

from __future__ import annotations

from viewer.app.core.state import AppState
from viewer.rendering.camera import Camera, camera_from_view, follow_view
from viewer.rig.captures.cameras import CameraView
from viewer.rig.captures.carried_view import view_in

__all__ = ["follow_calibrated", "look_through_view"]


def look_through_view(state: AppState, view: CameraView) -> None:
    """Look through a calibrated camera of the scene.

    Raises
    ------
    RigError
        If the size of the camera's images is unknown.
    """
    scene = state.scene
    seen = camera_from_view(view, _size(state), scene.up, state.box, view_in(view, scene))
    seen.front = state.camera.front
    for name in Camera.__slots__:
        setattr(state.camera, name, getattr(seen, name))


def follow_calibrated(state: AppState) -> None:
    """Update the view through a moving calibrated camera, if it looks through one."""
    follow_view(state.camera, _size(state), state.scene, state.box)


def _size(state: AppState) -> tuple[int, int]:
    _, _, width, height = state.view_rect
    return max(round(width), 1), max(round(height), 1)
