"""Camera panel, and the actions on the camera: fit, look along an axis or through a camera."""

from __future__ import annotations

import numpy as np
from imgui_bundle import imgui

from viewer.app.core.camera_moves import fit_again, fit_points, fit_shown, look_through_view
from viewer.app.core.state import AppState, shows_errors
from viewer.app.core.widgets import (
    button,
    checkbox,
    choice,
    draw_setting,
    explain,
    note_item,
    slider,
    with_key,
)
from viewer.app.posing.posed_joint import posed_joint
from viewer.app.view.flight import fly_from
from viewer.phrases import capitalized, printable
from viewer.rendering.camera import SMALLEST, VIEWS, NamedView, front_azimuth, look_from
from viewer.rendering.camera_views import image_notes, lens_notes
from viewer.rigs.arrays import Floats
from viewer.rigs.inspection.front import WantedFront, front_axes
from viewer.rigs.mesh import bounding_box, box_size
from viewer.rigs.scene import actor_points

_CLAMP = int(imgui.SliderFlags_.always_clamp)
_LOG = int(imgui.SliderFlags_.logarithmic | imgui.SliderFlags_.no_round_to_format)
_AROUND = 0.12  # extent shown around a joint, relative to the actor's size


def draw(state: AppState) -> None:
    """Draw the panel."""
    camera = state.camera
    _draw_views(state)
    before = _place(state)
    size = box_size(state.box) or 1.0
    digits = "%.3g" if size < 0.1 or size > 1e4 else "%.2f"  # enough for the figure's unit
    distance = slider(state, "Distance", camera.distance, 0.05 * size, 20.0 * size, digits, _LOG)
    camera.distance = max(distance, SMALLEST)
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
    up, ahead = state.scene.up, state.camera.front
    fronts = front_axes(up)
    now: WantedFront = next((axis for axis in fronts if front_azimuth(axis, up) == ahead), "auto")
    texts: dict[WantedFront, str] = {axis: axis for axis in fronts}
    texts["auto"] = "automatic"
    chosen = choice(state, "Front axis", now, texts)
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
    options, text = state.options, "frusta of the calibrated cameras, with their images"
    draw_setting(state, "Show cameras", options, "cameras", text)
    if fixed is not None and state.scene.images is not None:
        draw_setting(state, "Image brightness", options, "image_brightness")


def fit_view(state: AppState) -> None:
    """Aim the camera at the scene in its current pose and fill the view with it."""
    fit_shown(state)


def fit_selection(state: AppState) -> None:
    """Aim the camera at the selected joint, or at the chosen actor, and fill the view."""
    joint = posed_joint(state.actor, state.selected_joint)
    if joint is None or not state.actor.is_drawn:
        fit_actor(state)
        return
    size = box_size(bounding_box(actor_points(state.actor))) or 1.0
    beside = [row for row, above in enumerate(joint.skeleton.parents) if above == joint.joint]
    points: Floats = joint.world[[joint.joint, *beside], :3, 3]
    room = points.mean(axis=0) + _AROUND * size * np.array([[-1.0], [1.0]])
    before = state.camera.copy()
    fit_points(state, np.concatenate([points, room]))
    fly_from(state, before)


def fit_actor(state: AppState) -> None:
    """Aim the camera at the chosen actor, and fill the view with it."""
    before, points = state.camera.copy(), actor_points(state.actor)
    if state.actor.is_drawn and len(points):
        fit_points(state, points)
        fly_from(state, before)


def look(state: AppState, name: NamedView) -> None:
    """Rotate the camera to a named view, and fit it to the scene."""
    state.camera.fixed = None
    look_from(state.camera, name)
    fit_again(state)


def fly_to(state: AppState, name: NamedView) -> None:
    """Do the same as ``look``, but animate the camera for a fifth of a second."""
    before = state.camera.copy()
    look(state, name)
    fly_from(state, before)


def face(state: AppState, front: WantedFront) -> None:
    """Set the axis that the figures face ("auto" estimates it), and rotate the camera with it."""
    state.set_front(front)
    fit_again(state)


@shows_errors
def look_through(state: AppState, index: int) -> None:
    """Look through a calibrated camera of the capture; -1 frees the camera at its position."""
    if index < 0:
        state.camera.fixed = None
        return
    view = state.scene.views[index]
    look_through_view(state, view)
    for note in (*image_notes(state.scene, view), *lens_notes(state.scene, view)):
        state.say(capitalized(note))


def toggle_projection(state: AppState) -> None:
    """Switch between perspective and parallel projection."""
    state.camera.fixed = None
    state.camera.orthographic = not state.camera.orthographic
    state.say_status("Orthographic" if state.camera.orthographic else "Perspective")
