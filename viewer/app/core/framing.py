"""Fitting of the camera to the free view until the user moves it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from imgui_bundle import imgui

from viewer.app.core.motion_extent import MotionExtent
from viewer.rendering.camera import Camera, fit
from viewer.rig.arrays import Floats
from viewer.rig.scene import scene_points

if TYPE_CHECKING:
    from viewer.app.core.state import AppState

__all__ = ["Framing", "fit_again", "fit_points", "fit_shown", "keep_fitting", "restart_framing"]

_GAP = 6.0  # points between the tools and what is seen
_LEAST = 0.6  # of the view's height, however much lies over it
_NARROWEST = 40.0  # points: in a smaller view nothing can be seen


@dataclass(slots=True)
class Framing:
    """Whether and to what the camera is fitted.

    Attributes
    ----------
    is_fitting : bool
        Whether it is fitted again when the view changes its size, or more of the motion is known.
        Over as soon as the camera stands anywhere else than where it was put.
    extent : MotionExtent
        How far the scene reaches.
    points : (N, 3) or None
        What it is fitted to; None for the extent.
    """

    is_fitting: bool = False
    extent: MotionExtent = field(default_factory=MotionExtent)
    points: Floats | None = None
    _placed: tuple[object, ...] | None = None
    _fitted: tuple[object, ...] | None = None
    _is_stale: bool = True

    @property
    def is_settled(self) -> bool:
        """Whether nothing is left to find out."""
        return self.extent.is_done


def restart_framing(state: AppState, fits: bool = True) -> None:
    """Fit the camera to what is shown now, and keep fitting it.

    Parameters
    ----------
    state : AppState
        With other figures than before.
    fits : bool
        False leaves the camera where it is.
    """
    framing = state.framing
    framing.extent.restart()
    framing.is_fitting, framing.points = fits, None
    framing._placed, framing._fitted, framing._is_stale = None, None, True


def keep_fitting(state: AppState) -> None:
    """Go on with finding how far the scene reaches, and fit the camera to it if nobody moved it.

    To be called in each frame, when it is known how much room the panels leave.
    """
    framing = state.framing
    place = _place(state.camera)
    if framing._placed is not None and framing._placed != place:
        framing.is_fitting, framing._placed = False, None
    extent, grows = framing.extent, state.stream is not None
    if extent.look(state.scene, state.playback, state.options.show, grows):
        state.box = extent.box
        # The camera stays where a shape or motion is edited: the change is to be seen.
        framing._is_stale |= not extent.was_edited
    _, _, width, height = state.view_rect
    if not framing.is_fitting or min(width, height) < _NARROWEST:
        return
    size = (width, height, state.panels_visible)
    if framing._fitted != size or (framing._is_stale and framing.points is None):
        _fit(state, extent.points if framing.points is None else framing.points)
        framing._fitted, framing._is_stale = size, False


def fit_points(state: AppState, points: Floats) -> None:
    """Aim the camera at some points, fill the view with them, and keep it so.

    Parameters
    ----------
    state : AppState
        Its camera leaves a calibrated one's place.
    points : (N, 3)
        Scene space.
    """
    framing = state.framing
    framing.is_fitting, framing.points = True, points
    _fit(state, points)


def fit_again(state: AppState) -> None:
    """Fit the camera from where it looks now: to what it was fitted to, if nobody moved it."""
    framing = state.framing
    if not framing.is_fitting:
        fit_shown(state)
    else:
        _fit(state, framing.extent.points if framing.points is None else framing.points)


def fit_shown(state: AppState) -> None:
    """Aim the camera at the scene as it is posed, and keep it so."""
    fit_points(state, scene_points(state.scene, state.options.show))


def _fit(state: AppState, points: Floats) -> None:
    camera = state.camera
    camera.fixed = None
    fit(camera, points, state.aspect)
    state.limit_camera()
    covered = _covered_height(state, points)
    if covered:
        # As much is left out below, so that the camera turns about the middle of what it sees.
        height = max(state.view_rect[3], 1.0)
        fit(camera, points, state.aspect, max(1.0 - 2.0 * covered / height, _LEAST))
        state.limit_camera()
    state.framing._placed = _place(camera)


def _covered_height(state: AppState, points: Floats) -> float:
    """Return how far down the tools in the upper right corner reach if they cover any point.

    The settings that some tools have below their buttons do not count: whoever takes a tool in hand
    wants to go on with what is seen.
    """
    tools = state.item_rects.get("##tools")
    if tools is None:
        return 0.0
    x, y, width, height = state.view_rect
    matrix = state.camera.projection_matrix(state.aspect, state.box) @ state.camera.view_matrix()
    clip = points @ matrix[:, :3].T + matrix[:, 3]
    across = x + 0.5 * width * (1.0 + clip[:, 0] / clip[:, 3])
    down = y + 0.5 * height * (1.0 - clip[:, 1] / clip[:, 3])
    row = imgui.get_frame_height() + 2.0 * imgui.get_style().window_padding.y
    is_covered = (across > tools[0] - _GAP) & (down < tools[1] + row + _GAP)
    return tools[1] + row + _GAP - y if is_covered.any() else 0.0


def _place(camera: Camera) -> tuple[object, ...]:
    lens = camera.fov, id(camera.fixed)
    return camera.target.tobytes(), camera.distance, camera.azimuth, camera.inclination, *lens
