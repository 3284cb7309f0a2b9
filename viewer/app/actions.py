"""What keys, menus and buttons do, each a function of the state."""

from __future__ import annotations

from viewer.app.state import AppState
from viewer.rendering.camera import VIEWS, fit
from viewer.rendering.options import SHOWN, Lights
from viewer.rig.pose import rest_pose
from viewer.rig.scene import scene_points

__all__ = [
    "cancel",
    "fit_view",
    "look",
    "redo",
    "reset_lights",
    "reset_pose",
    "show",
    "toggle_binding",
    "toggle_option",
    "toggle_projection",
    "toggle_skeleton",
    "undo",
]


def reset_pose(state: AppState) -> None:
    """Set every DOF of every actor back to the file's pose; shapes stay."""
    for actor in state.scene.actors:
        if actor.figure.skeleton is not None and actor.pose is not None:
            weights = actor.pose.shape_weights
            actor.pose = rest_pose(actor.figure.skeleton)
            actor.pose.shape_weights = weights
    state.say_status("Pose reset")


def toggle_skeleton(state: AppState) -> None:
    """Draw the skeleton with the skin, or leave it out."""
    shown = {"skin": "both", "both": "skin", "skeleton": "skin", "binding": "skeleton"}
    show(state, shown[state.options.show])


def toggle_binding(state: AppState) -> None:
    """Switch between the attached skin and the skin in its binding space."""
    show(state, "skin" if state.options.show == "binding" else "binding")


def show(state: AppState, what: str) -> None:
    """Choose what is drawn, a key of ``SHOWN``, and say so."""
    state.options.show = what
    state.say_status(SHOWN[what])


def toggle_option(state: AppState, name: str, text: str) -> None:
    """Flip a display option and say so."""
    value = not getattr(state.options, name)
    setattr(state.options, name, value)
    state.say_status(f"{text} {'on' if value else 'off'}")


def fit_view(state: AppState) -> None:
    """Aim the camera at the scene as it is posed and fill the view with it."""
    fit(state.camera, scene_points(state.scene, state.options.show), state.aspect)


def look(state: AppState, name: str) -> None:
    """Turn the camera to a named view."""
    state.camera.azimuth, state.camera.inclination = VIEWS[name]


def toggle_projection(state: AppState) -> None:
    """Switch between perspective and parallel projection."""
    state.camera.orthographic = not state.camera.orthographic
    state.say_status("Orthographic" if state.camera.orthographic else "Perspective")


def reset_lights(state: AppState) -> None:
    """Set both lights, ambient and highlight back to what they were at first."""
    state.options.lights = Lights()


def undo(state: AppState) -> None:
    """Take back the last change of pose or display."""
    if not state.history.undo(state.scene, state.options):
        state.say_status("Nothing to undo")


def redo(state: AppState) -> None:
    """Bring back the change that was undone last."""
    if not state.history.redo(state.scene, state.options):
        state.say_status("Nothing to redo")


def cancel(state: AppState) -> None:
    """Close what lies on top: message, dialog, key list; else drop the selection."""
    if state.error:
        state.error = ""
    elif state.dialog is not None:
        state.dialog = None
    elif state.loader is not None:
        state.loader = None
        state.say_status("Opening was cancelled")
    elif state.keys_visible:
        state.keys_visible = False
    else:
        state.selected_joint = -1
