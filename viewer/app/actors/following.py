"""Camera that follows an actor or one of its joints."""

from __future__ import annotations

from viewer.app.core.camera_moves import follow_calibrated
from viewer.app.core.state import AppState
from viewer.data_classes import dataclass
from viewer.phrases import printable
from viewer.rendering.recorder import followed_point
from viewer.rigs.arrays import Floats


@dataclass(slots=True)
class Following:
    """Target that the camera follows."""

    target: tuple[int, int] | None = None
    """Indices of an actor and of its joint; joint -1 for the actor's centre."""
    place: Floats | None = None
    """Position of the target when the camera was last moved: (3,)."""
    n_posed: int = 0
    """Value of the clock's ``n_posed`` at that time."""


def follow_actor(state: AppState) -> None:
    """Keep the target on the followed actor or joint at the same distance while the clock moves."""
    follow_calibrated(state)
    following, n_posed = state.of(Following), state.clock.n_posed
    if following.target is None or following.n_posed == n_posed:
        return
    following.n_posed = n_posed
    index, joint = following.target
    place = None
    if index < len(state.scene.actors):
        place = followed_point(state.scene.actors[index], joint)
    if place is not None:
        if following.place is not None:
            state.camera.target = state.camera.target + place - following.place
        following.place = place


def toggle_following(state: AppState, actor: int, joint: int) -> None:
    """Let the camera follow an actor's joint, or its centre (-1), from here; or stop following."""
    following = state.of(Following)
    if following.target == (actor, joint):
        stop_following(state)
        return
    state.framing.is_fitting = False
    following.target = actor, joint
    following.place = followed_point(state.scene.actors[actor], joint)
    following.n_posed = state.clock.n_posed
    name = state.scene.actors[actor].name
    state.say_status(f"The camera follows {printable(name, 60)}")


def stop_following(state: AppState) -> None:
    """Stop following; the camera stays where it is."""
    following = state.of(Following)
    following.target = following.place = None
