"""The scene's clock in the frame loop: edits are kept, then the actors are posed for the time."""

from __future__ import annotations

from collections.abc import Sequence

from imgui_bundle import imgui

from viewer.app.actors.following import follow_actor
from viewer.app.core.state import AppState
from viewer.app.posing.state import Posing
from viewer.app.rigging.state import Rigging
from viewer.rig.scene import Actor, Scene

__all__ = ["Clock"]


def is_held(state: AppState) -> bool:
    """Return whether an edit is going on: a widget or a handle is held."""
    drag = state.of(Posing).drag
    is_dragged = drag is not None and not drag.is_over
    moves_template = state.of(Rigging).holds_mouse and imgui.is_mouse_down(imgui.MouseButton_.left)
    return imgui.is_any_item_active() or is_dragged or moves_template


class Clock:
    """Poses the scene of one state, once a frame, and keeps edits apart from that.

    Attributes
    ----------
    is_first : bool
        Whether the scene has not been posed since it was opened.
    """

    def __init__(self, state: AppState) -> None:
        self.state, self.is_first = state, True
        self._clips: tuple[object, ...] = ()

    def advance(self) -> None:
        """Let time run on, by how long it is since the last frame was begun.

        It waits while a handle is held that has not been dragged yet: a click must not pause, and
        the pose in which a drag began must stay.
        """
        drag = self.state.of(Posing).drag
        if drag is None or drag.has_moved:
            self.state.playback.advance(imgui.get_io().delta_time)

    def keep_edits(self) -> None:
        """Keep what was edited as a step, before the clock poses the scene; or restore a step.

        Undo has brought back clips and poses: the clock follows to their time.
        """
        state, history = self.state, self.state.history
        history.observe(state.scene, state.options, is_held(state))
        if history.has_restored:
            self._clips = _clips(state.scene)
            state.playback.follow(state.scene.actors, state.actor)
            state.playback.seek(history.time)
            state.playback.pose(state.scene, again=True)
            history.settle(state.scene, state.playback.time)
            follow_actor(state)

    def pose(self) -> None:
        """Pose the actors for the time that is shown, if it or their clips changed."""
        state, clips = self.state, _clips(self.state.scene)
        changed = clips != self._clips
        if changed:
            self._clips = clips
            state.playback.follow(state.scene.actors, state.actor)
        if state.playback.pose(state.scene, again=changed and not self.is_first):
            state.history.follow(state.scene, state.playback.time)
            follow_actor(state)
        self.is_first = False

    def add(self, actors: Sequence[Actor]) -> None:
        """Take in actors, and clips that grew, as captures are read."""
        state = self.state
        state.scene.actors += actors
        self._clips = _clips(state.scene)
        state.playback.follow(state.scene.actors, state.actor)
        state.playback.pose(state.scene, again=True)
        state.history.add_actors(state.scene, state.options)
        state.history.follow(state.scene, state.playback.time)


def _clips(scene: Scene) -> tuple[object, ...]:
    """Return what actors are posed by, and when."""
    return tuple((actor.clip, actor.offset) for actor in scene.actors)
