"""Actions that move the camera."""

from __future__ import annotations

import numpy as np

from viewer.app.core.calibrated import look_through_view
from viewer.app.core.fitting import fit_again, fit_points, fit_shown
from viewer.app.core.state import AppState
from viewer.app.posing.posed_joint import posed_joint
from viewer.app.view.flight import fly_from
from viewer.errors import ViewerError
from viewer.rendering.camera import look_from
from viewer.rendering.camera_views import image_notes, lens_notes
from viewer.rig.arrays import Floats
from viewer.rig.inspection.front import Front
from viewer.rig.mesh import bounding_box, box_size
from viewer.rig.scene import actor_points

__all__ = [
    "face",
    "fit_actor",
    "fit_selection",
    "fit_view",
    "fly_to",
    "look",
    "look_through",
    "toggle_projection",
]

_AROUND = 0.12  # extent shown around a joint, relative to the actor's size


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


def look(state: AppState, name: str) -> None:
    """Rotate the camera to a named view, and fit it to the scene."""
    state.camera.fixed = None
    look_from(state.camera, name)
    fit_again(state)


def fly_to(state: AppState, name: str) -> None:
    """Do the same as ``look``, but animate the camera for a fifth of a second."""
    before = state.camera.copy()
    look(state, name)
    fly_from(state, before)


def face(state: AppState, front: Front) -> None:
    """Set the axis that the figures face ("auto" estimates it), and rotate the camera with it."""
    state.set_front(front)
    fit_again(state)


def look_through(state: AppState, index: int) -> None:
    """Look through a calibrated camera of the capture; -1 frees the camera at its position."""
    if index < 0:
        state.camera.fixed = None
        return
    view = state.scene.views[index]
    try:
        look_through_view(state, view)
    except ViewerError as problem:
        state.error = str(problem)
        return
    for note in (*image_notes(state.scene, view), *lens_notes(state.scene, view)):
        state.say(note[0].upper() + note[1:])


def toggle_projection(state: AppState) -> None:
    """Switch between perspective and parallel projection."""
    state.camera.fixed = None
    state.camera.orthographic = not state.camera.orthographic
    state.say_status("Orthographic" if state.camera.orthographic else "Perspective")
