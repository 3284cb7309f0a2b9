"""The key of the picture in the view: it is drawn anew when the key changes."""

from __future__ import annotations

import copy

from viewer.app.core.state import AppState
from viewer.rendering.renderer import Renderer
from viewer.rig.pose import pose_key

__all__ = ["picture_key"]


def picture_key(state: AppState, renderer: Renderer, size: tuple[int, int]) -> object:
    """Return everything the picture of the scene depends on.

    Parameters
    ----------
    state : AppState
        What is shown.
    renderer : Renderer
        With the marks, the template and the annotations of this frame.
    size : (int, int)
        Width and height in pixels.
    """
    camera = state.camera
    poses = tuple(
        (
            id(actor),
            id(actor.figure),
            actor.is_drawn,
            actor.color,
            b"" if actor.points is None else actor.points.tobytes(),
            actor.placement.tobytes(),
            *(pose_key(actor.pose) if actor.pose else ()),
        )
        for actor in state.scene.actors
    )
    selected = (state.chosen_actor, state.selected_joint)
    place = (camera.target.tobytes(), camera.distance, camera.azimuth, camera.inclination)
    lens = (camera.fov, camera.orthographic, camera.up, id(camera.fixed))
    ground, options = state.box.tobytes(), copy.deepcopy(state.options)
    drawn_over = renderer.marks, renderer.ghost, renderer.annotations
    return (size, place, lens, ground, options, poses, *selected, *drawn_over)
