"""Camera panel: distance, azimuth, inclination, projection and named views."""

from __future__ import annotations

from imgui_bundle import imgui

from viewer.app.core.key_names import with_key
from viewer.app.core.state import AppState
from viewer.app.core.widgets import button, checkbox, choice, explain, note_item, slider
from viewer.app.view.camera_actions import face, fit_view, look, look_through, toggle_projection
from viewer.phrases import printable
from viewer.rendering.camera import VIEWS, front_azimuth
from viewer.rig.inspection.front import front_axes
from viewer.rig.mesh import box_size

__all__ = ["draw"]

_CLAMP = imgui.SliderFlags_.always_clamp
_LOG = imgui.SliderFlags_.logarithmic | imgui.SliderFlags_.no_round_to_format


def draw(state: AppState) -> None:
    """Draw the panel."""
    camera = state.camera
    _draw_views(state)
    before = _place(state)
    size = box_size(state.box) or 1.0
    distance = slider(
        state, "Distance", camera.distance, 0.05 * size, 20.0 * size, _digits(size), _LOG
    )
    camera.distance = max(distance, 1e-9)
    camera.azimuth = slider(state, "Azimuth", camera.azimuth, -180.0, 180.0, "%.1f\N{DEGREE SIGN}")
    camera.inclination = slider(
        state, "Inclination", camera.inclination, -90.0, 90.0, "%.1f\N{DEGREE SIGN}", _CLAMP
    )
    camera.fov = slider(
        state, "Field of view", camera.fov, 5.0, 120.0, "%.0f\N{DEGREE SIGN}", _CLAMP
    )
    if camera.fixed is not None and _place(state) != before:
        camera.fixed = None  # continue from the position of the calibrated camera
    if checkbox(state, "Orthographic", camera.orthographic) != camera.orthographic:
        toggle_projection(state)
    imgui.same_line()
    if button(state, with_key(state, "Fit", "F")):
        fit_view(state)
    for number, name in enumerate(VIEWS):
        if number % 3:
            imgui.same_line()
        if button(state, name.capitalize()):
            look(state, name)
    _draw_front(state)


def _draw_front(state: AppState) -> None:
    """Draw the choice of the axis that the figures face, which defines the named views."""
    up, ahead = state.scene.up, state.camera.front
    texts = {axis: axis for axis in front_axes(up)}
    now = next((axis for axis in texts if front_azimuth(axis, up) == ahead), "auto")
    chosen = choice(state, "Front axis", now, {**texts, "auto": "automatic"})
    explain("axis that the figures face, which defines the named views")
    if chosen != now:
        face(state, chosen)


def _place(state: AppState) -> tuple[float, ...]:
    camera = state.camera
    return camera.distance, camera.azimuth, camera.inclination, camera.fov


def _draw_views(state: AppState) -> None:
    """Draw the list of calibrated cameras if there are any."""
    views, fixed = state.scene.views, state.camera.fixed
    if not views:
        return
    names = ["Free camera", *(printable(f"Camera {view.name}", 60) for view in views)]
    index = next((number for number, view in enumerate(views, 1) if view is fixed), 0)
    imgui.set_next_item_width(-1.0)
    changed, chosen = imgui.combo("##views", index, names)
    note_item(state, "Calibrated camera")
    if changed:
        look_through(state, chosen - 1)
    options = state.options
    options.cameras = checkbox(state, "Show cameras", options.cameras)
    explain("frusta of the calibrated cameras, with their images")
    if fixed is not None and state.scene.images is not None:
        options.image_brightness = slider(
            state, "Image brightness", options.image_brightness, 0.0, 1.0, "%.2f", _CLAMP
        )


def _digits(size: float) -> str:
    """Return a format with enough digits for the figure's unit."""
    return "%.3g" if size < 0.1 or size > 1e4 else "%.2f"
