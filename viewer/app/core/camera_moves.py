"""Moves of the camera: fit the view to the scene, or look through a calibrated camera."""

from __future__ import annotations

from imgui_bundle import imgui

from viewer.app.core.state import AppState
from viewer.rendering.camera import Camera, camera_from_view, fit, follow_view
from viewer.rigs.arrays import Floats
from viewer.rigs.captures.cameras import CameraView
from viewer.rigs.captures.carried_view import view_in
from viewer.rigs.scene import scene_points

_GAP = 6.0  # margin between the tools and the scene, points
_LEAST = 0.6  # minimum fraction of the view's height to fill, even if overlays cover it
_NARROWEST = 40.0  # points: a smaller view is unusable


def keep_fitting(state: AppState, grows: bool) -> None:
    """Extend the known extent of the scene; fit the camera to it unless the user has moved it."""
    framing = state.framing
    framing.watch(state.camera)
    if framing.extent.look(state.scene, state.clock, state.options.show, grows):
        state.box = framing.extent.box
        framing.note_extent()
    _, _, width, height = state.view_rect
    if not framing.is_fitting or min(width, height) < _NARROWEST:
        return
    if framing.is_due((width, height, state.panels_visible)):
        _fit(state, framing.fitted_points)


def fit_points(state: AppState, points: Floats) -> None:
    """Aim the camera at points (N, 3) of the scene, fill the view with them, and keep it fitted."""
    framing = state.framing
    framing.is_fitting, framing.points = True, points
    _fit(state, points)


def fit_again(state: AppState) -> None:
    """Fit the camera in its direction, to the previous points unless the user has moved it."""
    framing = state.framing
    if not framing.is_fitting:
        fit_shown(state)
    else:
        _fit(state, framing.fitted_points)


def fit_shown(state: AppState) -> None:
    """Aim the camera at the scene as it is posed, and keep it fitted."""
    fit_points(state, scene_points(state.scene, state.options.show))


def _fit(state: AppState, points: Floats) -> None:
    camera = state.camera
    camera.fixed = None
    fit(camera, points, state.aspect)
    state.limit_camera()
    covered = _covered_height(state, points)
    if covered:
        # The same margin is left below, so that the camera orbits the middle of the view.
        height = max(state.view_rect[3], 1.0)
        fit(camera, points, state.aspect, max(1.0 - 2.0 * covered / height, _LEAST))
        state.limit_camera()
    state.framing.note_placed(camera)


def _covered_height(state: AppState, points: Floats) -> float:
    """Return the lower edge of the toolbar without its settings, if that covers any point."""
    tools = state.item_rects.get("##tools")
    if tools is None:
        return 0.0
    x, y, width, height = state.view_rect
    matrix = state.camera.projection_matrix(state.aspect, state.box) @ state.camera.view_matrix()
    row = imgui.get_frame_height() + 2.0 * imgui.get_style().window_padding.y
    lower = tools[1] + row + _GAP
    # Only few of what may be millions of points are high enough.
    depth = points @ matrix[3, :3] + matrix[3, 3]
    down = y + 0.5 * height * (1.0 - (points @ matrix[1, :3] + matrix[1, 3]) / depth)
    is_high = down < lower
    across = (points[is_high] @ matrix[0, :3] + matrix[0, 3]) / depth[is_high]
    is_covered = x + 0.5 * width * (1.0 + across) > tools[0] - _GAP
    return lower - y if is_covered.any() else 0.0


def look_through_view(state: AppState, view: CameraView) -> None:
    """Look through a calibrated camera; ``RigError`` if the size of its images is unknown."""
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
