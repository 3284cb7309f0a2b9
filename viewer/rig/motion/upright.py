"""Up axis of an actor's own world, for exporters that ignore placements."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from viewer.rig.arrays import Floats
from viewer.rig.figure import Figure
from viewer.rig.pose import Pose, joint_rotations, local_matrices
from viewer.rig.posing.pose_vector import set_joint_rotations
from viewer.rig.scene import Actor, Scene
from viewer.rig.shape import shaped_skeleton

__all__ = ["own_up", "upright_actor", "upright_placement"]

_OVER = np.array([1.0, -1.0, -1.0])  # rotation by 180 degrees about x


def own_up(scene: Scene, actor: Actor) -> tuple[Literal["y", "z"], bool]:
    """Return the up axis of an actor's own world, before its placement.

    Parameters
    ----------
    scene : Scene
        Provides the up axis.
    actor : Actor
        Actor placed in the scene.

    Returns
    -------
    up : "y" or "z"
        The axis that is mapped to the scene's up axis; the scene's up axis if that is x.
    hangs : bool
        Whether that axis points down.
    """
    along = np.zeros(3)
    along["xyz".index(scene.up)] = 1.0
    own = np.linalg.solve(actor.placement[:3, :3], along)
    axis = int(np.abs(own).argmax())
    if axis == 0:
        return scene.up, False
    return ("z" if axis == 2 else "y"), bool(own[axis] < 0.0)


def upright_actor(scene: Scene, actor: Actor) -> Actor:
    """Return an actor whose figure records the up axis of its pose, rotated if upside down.

    A body in a z-up capture is upright along z, regardless of the up axis of its model.

    Parameters
    ----------
    scene : Scene
        Provides the up axis.
    actor : Actor
        Actor in the scene; not modified.

    Returns
    -------
    Actor
        Actor with the same placement, which no longer applies to it; the given actor if nothing
        changes.
    """
    up, hangs = own_up(scene, actor)
    figure = actor.figure if actor.figure.up == up else replace(actor.figure, up=up)
    pose = actor.pose
    if hangs and pose is not None:
        pose = _rotated_upright(actor.figure, pose)
    points = actor.points
    if hangs and points is not None:
        points = points * np.append(_OVER, 1.0)  # confidences are unchanged
    if figure is actor.figure and pose is actor.pose and points is actor.points:
        return actor
    return replace(actor, figure=figure, pose=pose, points=points)


def upright_placement(scene: Scene, actor: Actor) -> Floats:
    """Return the matrix that places the actor of ``upright_actor`` in the scene: (4, 4)."""
    hangs = own_up(scene, actor)[1]
    return actor.placement @ np.diag([*_OVER, 1.0]) if hangs else actor.placement


def _rotated_upright(figure: Figure, pose: Pose) -> Pose:
    """Return a pose rotated by 180 degrees, Q: R' = Q R and s l' + T' = Q (s l + T) at roots.

    The first root keeps its position in the figure, l' = l; the figure's translation T moves it.
    """
    skeleton = shaped_skeleton(figure, pose.shape_weights)
    upright = pose.copy()
    roots = np.flatnonzero(skeleton.parents < 0).astype(np.int32)
    within = pose.figure_scale * local_matrices(skeleton, pose)[roots, :3, 3]
    wanted = (within + pose.figure_translation) * _OVER
    upright.figure_translation = wanted[0] - within[0]
    if pose.figure_scale:
        shifts = (wanted - upright.figure_translation - within) / pose.figure_scale
        upright.translations[roots] += shifts
    rotations = _OVER[:, None] * joint_rotations(skeleton, pose)[roots]
    # The limits apply to the figure's original world, which is upside down.
    set_joint_rotations(skeleton, upright, roots, rotations, clamp=False)
    return upright
