"""Switch between the world and the camera as the space of captured people."""

from __future__ import annotations

from viewer.app.core.calibrated import look_through_view
from viewer.app.core.state import AppState
from viewer.app.core.widgets import choice, explain
from viewer.errors import ViewerError
from viewer.rig.scene import Actor

__all__ = ["draw_space", "switch_space"]

_SPACES = {"world": "World", "camera": "Camera"}


def draw_space(state: AppState) -> None:
    """Draw the choice of the space if the files of the people contain both."""
    if state.scene.in_space is None:
        return
    chosen = choice(state, "Space", state.scene.space, _SPACES)
    explain(
        "space of the people: the world, or the camera that filmed them; switching discards edits"
    )
    if chosen != state.scene.space:
        switch_space(state, chosen)


def switch_space(state: AppState, space: str) -> None:
    """Show the people in another space; keep time, selection, appearance and calibrated camera.

    The people are read again, so edits of their motions and the undo history are discarded.
    """
    old = state.scene
    if old.in_space is None:
        return
    try:
        scene = old.in_space(space)
    except ViewerError as problem:
        state.error = str(problem)
        return
    for actor in scene.actors:
        _dress(actor, old.actors)
    time, chosen, joint = state.clock.time, state.actor, state.selected_joint
    was_selected, mode, speed = state.is_actor_selected, state.clock.mode, state.clock.speed
    is_playing, fixed = state.clock.playing, state.camera.fixed
    state.show_scene(scene, state.paths)
    state.clock.seek(time)
    state.clock.mode, state.clock.speed, state.clock.playing = mode, speed, is_playing
    index = next((i for i, a in enumerate(scene.actors) if _is_same(a, chosen)), 0)
    state.choose_actor(index)
    state.is_actor_selected, state.selected_joint = was_selected, joint
    state.clock.pose(state.actor, again=True)
    view = next((v for v in scene.views if fixed is not None and v.name == fixed.name), None)
    if view is not None:
        look_through_view(state, view)
        state.framing.is_fitting = False


def _is_same(actor: Actor, other: Actor) -> bool:
    """Return whether two actors are the same person or figure of the same files."""
    is_point = actor.figure.points is None
    return (actor.person, actor.title, is_point) == (
        other.person,
        other.title,
        other.figure.points is None,
    )


def _dress(actor: Actor, others: list[Actor]) -> None:
    """Give an actor the appearance that it had in the other space."""
    for other in others:
        if _is_same(actor, other):
            actor.color, actor.visible, actor.opacity = other.color, other.visible, other.opacity
            actor.hidden_parts = other.hidden_parts
            actor.offset = other.offset
            return
