"""Key that identifies the image in the view: the image is redrawn when the key changes."""

from __future__ import annotations

import copy
from collections.abc import Sequence

from viewer.app.core.state import AppState
from viewer.rendering.options import DisplayOptions
from viewer.rendering.overlay.annotation import Annotation, Marks
from viewer.rendering.passes.ghost_pass import Ghost
from viewer.rig.memo import NumberKey
from viewer.rig.pose import pose_key
from viewer.rig.scene import Actor

__all__ = ["PictureKeys"]


class PictureKeys:
    """Builds one key per frame; large parts are copied only when they have changed.

    Poses cache their own keys; the keys of options and of the actors' placements are cached here.
    Figures and clips are compared by identity: they are replaced and never mutated.
    """

    def __init__(self) -> None:
        self._options: DisplayOptions | None = None
        self._places: list[NumberKey] = []

    def key(
        self,
        state: AppState,
        size: tuple[int, int],
        marks: Marks | None = None,
        ghost: Ghost | None = None,
        annotations: Sequence[Annotation] = (),
    ) -> tuple[object, ...]:
        """Return everything on which the image of the scene depends.

        Parameters
        ----------
        state : AppState
            State that is shown.
        size : (int, int)
            Width and height in pixels.
        marks, ghost, annotations : Marks or None, Ghost or None, sequence of Annotation
            Items drawn over the scene in this frame; compared by identity.
        """
        camera, options = state.camera, state.options
        if options != self._options:
            self._options = copy.deepcopy(options)
        place = (camera.target.tobytes(), camera.distance, camera.azimuth, camera.inclination)
        lens = (camera.fov, camera.orthographic, camera.up, id(camera.fixed))
        # Motion paths show the motion around the current time, and cameras show their current
        # images.
        shows_images = camera.fixed is not None or options.cameras
        time = state.scene.time if options.path_joints or shows_images else None
        actors = self._actors(state.scene.actors)
        selected = (state.chosen_actor, state.selected_joint)
        drawn_over = marks, ghost, *annotations
        ground = state.box.tobytes()
        return (size, place, lens, ground, self._options, time, actors, selected, drawn_over)

    def _actors(self, actors: Sequence[Actor]) -> tuple[object, ...]:
        """Return a key of the visible state of all actors."""
        del self._places[len(actors) :]
        found = []
        for row, actor in enumerate(actors):
            arrays = [actor.placement] if actor.points is None else [actor.placement, actor.points]
            if row == len(self._places):
                self._places.append(NumberKey(*arrays))
            else:
                self._places[row] = self._places[row].updated(*arrays)
            look = (actor, actor.figure, actor.is_drawn, actor.color, actor.opacity)
            motion = actor.clip, actor.offset, actor.hidden_parts
            pose = None if actor.pose is None else pose_key(actor.pose)
            found.append((look, motion, self._places[row], pose))
        return tuple(found)
