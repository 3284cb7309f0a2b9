"""What keys, menus and buttons do, each a function of the state."""

from __future__ import annotations

from viewer.app.core.framing import fit_again, fit_shown
from viewer.app.core.reasons import no_motion
from viewer.app.core.state import AppState
from viewer.app.posing.joint_tree import select_joint
from viewer.app.posing.tool_actions import cancel_drag
from viewer.app.rigging.tools import drop_rig_tool
from viewer.app.weights.actions import unpin
from viewer.errors import ViewerError, printable
from viewer.rendering.camera import Camera, camera_from_view, look_from
from viewer.rendering.options import SHOWN, Lights
from viewer.rendering.picking import Pick
from viewer.rendering.pinhole import distortion_error
from viewer.rig.inspection.front import Front
from viewer.rig.motion.follow import followed_point
from viewer.rig.number_text import number_text
from viewer.rig.pose import rest_pose
from viewer.rig.scene import Actor

__all__ = [
    "cancel",
    "face",
    "fit_view",
    "follow_actor",
    "go_to_end",
    "look",
    "look_through",
    "play",
    "range_in",
    "range_out",
    "redo",
    "reset_lights",
    "reset_pose",
    "show",
    "start_following",
    "step",
    "stop_following",
    "take_pick",
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
    fit_shown(state)


def look(state: AppState, name: str) -> None:
    """Turn the camera to a named view, and fill the view with what is shown."""
    state.camera.fixed = None
    look_from(state.camera, name)
    fit_again(state)


def face(state: AppState, front: Front) -> None:
    """Say which axis the figures face, "auto" for a guess; the camera sees them as before."""
    state.set_front(front)
    fit_again(state)


def look_through(state: AppState, index: int) -> None:
    """See what a calibrated camera of the capture saw; -1 leaves it where it is."""
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
    error = distortion_error(view)
    if error >= 0.5:
        state.say(f"The lens of {printable(view.name)} bends pictures by up to {error:.1f} pixels")


def take_pick(state: AppState, found: Pick, aims: bool) -> None:
    """Choose the actor and joint that were clicked; a double click aims the camera there."""
    if found.actor != state.chosen_actor:
        state.choose_actor(found.actor)
        state.say_status(printable(state.actor.name, 60))
    if found.joint >= 0:
        select_joint(state, found.joint)
    if aims:
        state.camera.fixed = None
        state.camera.target = found.point.copy()


def toggle_projection(state: AppState) -> None:
    """Switch between perspective and parallel projection."""
    state.camera.fixed = None
    state.camera.orthographic = not state.camera.orthographic
    state.say_status("Orthographic" if state.camera.orthographic else "Perspective")


def reset_lights(state: AppState) -> None:
    """Set both lights, ambient and highlight back to what they were at first."""
    state.options.lights = Lights()


def undo(state: AppState) -> None:
    """Take back the last change of pose or display."""
    before = state.actor
    if not state.history.undo(state.scene, state.options):
        state.say_status("Nothing to undo")
    _keep_choice(state, before)


def redo(state: AppState) -> None:
    """Bring back the change that was undone last."""
    before = state.actor
    if not state.history.redo(state.scene, state.options):
        state.say_status("Nothing to redo")
    _keep_choice(state, before)


def _keep_choice(state: AppState, before: Actor) -> None:
    """Keep the chosen actor, wherever it is now; choose anew if it is there no more."""
    actors, row = state.scene.actors, state.chosen_actor
    if row < len(actors) and actors[row] is before:
        return
    rows = [number for number, actor in enumerate(actors) if actor is before]
    state.choose_actor(rows[0] if rows else min(row, len(actors) - 1))


def play(state: AppState) -> None:
    """Play or pause."""
    if not state.playback.has_motion:
        state.say_status(no_motion(state))
        return
    state.playback.toggle()
    state.say_status("Playing" if state.playback.playing else "Paused")


def step(state: AppState, frames: int) -> None:
    """Go some frames on, or back."""
    if state.playback.has_motion:
        state.playback.step(frames)


def go_to_end(state: AppState, last: bool) -> None:
    """Go to the first or last frame of the range that is played."""
    playback = state.playback
    if playback.has_motion:
        playback.seek(playback.end if last else playback.start)


def range_in(state: AppState) -> None:
    """Let the range that is played start at the present time."""
    playback = state.playback
    if playback.has_motion:
        playback.set_range(playback.time, max(playback.end, playback.time))
        state.say_status(f"The range starts at {number_text(playback.start, '.3f')} s")


def range_out(state: AppState) -> None:
    """Let the range that is played end at the present time."""
    playback = state.playback
    if playback.has_motion:
        playback.set_range(min(playback.start, playback.time), playback.time)
        state.say_status(f"The range ends at {number_text(playback.end, '.3f')} s")


def follow_actor(state: AppState) -> None:
    """Keep the camera's target on the followed actor or joint, as far from it as before."""
    if state.followed is None:
        return
    index, joint = state.followed
    place = None
    if index < len(state.scene.actors):
        place = followed_point(state.scene.actors[index], joint)
    if place is not None:
        if state.followed_from is not None:
            state.camera.target = state.camera.target + place - state.followed_from
        state.followed_from = place


def start_following(state: AppState, actor: int, joint: int) -> None:
    """Let the camera follow an actor's joint, or its middle (-1), from where it is now."""
    state.framing.is_fitting = False
    state.followed = actor, joint
    state.followed_from = followed_point(state.scene.actors[actor], joint)
    name = state.scene.actors[actor].name
    state.say_status(f"The camera follows {printable(name, 60)}")


def stop_following(state: AppState) -> None:
    """Leave the camera where it is."""
    state.followed = state.followed_from = None


def cancel(state: AppState) -> None:
    """Close what lies on top: message, dialog, key list; else drop the selection."""
    if cancel_drag(state):
        return
    if state.error:
        state.error = ""
    elif state.dialog is not None:
        state.dialog = None
    elif state.messages_visible:
        state.messages_visible = False
    elif state.loader is not None:
        state.loader = None
        state.say_status("Opening was cancelled")
    elif state.job is not None and state.job.can_cancel:
        state.job.cancel()
        state.say_status("Cancelled")
    elif state.record is not None:
        state.record = None
    elif state.stream is not None:
        state.stream.cancel()
        state.stream = None
        state.say_status("Reading was cancelled; what was read stays")
    elif state.keys_visible:
        state.keys_visible = False
    elif drop_rig_tool(state):
        state.say_status("The template is left where it is")
    elif state.lint.chosen >= 0:
        state.lint.chosen = -1
    elif state.weights.pinned is not None:
        unpin(state)
        state.say_status("The vertex was unpinned")
    else:
        state.selected_joint = -1
