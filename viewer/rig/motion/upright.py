"""Actors for exporters, which leave placements out: what is up in an actor's own world."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from viewer.rig.figure import Figure
from viewer.rig.pose import Pose, joint_rotations, local_matrices
from viewer.rig.posing.pose_vector import set_joint_rotations
from viewer.rig.scene import Actor, Scene
from viewer.rig.shape import shaped

__all__ = ["own_up", "upright_actor"]

_OVER = np.array([1.0, -1.0, -1.0])  # half a turn about x


def own_up(scene: Scene, actor: Actor) -> tuple[Literal["y", "z"], bool]:
    """Return what is up in an actor's own world, before its placement.

    Parameters
    ----------
    scene : Scene
        Says what is up.
    actor : Actor
        Placed in it.

    Returns
    -------
    up : "y" or "z"
        The axis that lies along the scene's; that of the scene itself where it is x.
    hangs : bool
        Whether it points down.
    """
    along = np.zeros(3)
    along["xyz".index(scene.up)] = 1.0
    own = np.linalg.solve(actor.placement[:3, :3], along)
    axis = int(np.abs(own).argmax())
    if axis == 0:
        return scene.up, False
    return ("z" if axis == 2 else "y"), bool(own[axis] < 0.0)


def upright_actor(scene: Scene, actor: Actor) -> Actor:
    """Return an actor whose figure says what is up in its pose, stood up if it hangs head down.

    A body in a capture with z up stands along z, whatever its model's own axis is.

    Parameters
    ----------
    scene : Scene
        Says what is up.
    actor : Actor
        In it; not changed.

    Returns
    -------
    Actor
        With the same placement, which no longer counts; the actor itself if nothing is different.
    """
    up, hangs = own_up(scene, actor)
    figure = actor.figure if actor.figure.up == up else replace(actor.figure, up=up)
    pose = actor.pose
    if hangs and pose is not None:
        pose = _rotated_upright(actor.figure, pose)
    points = actor.points
    if hangs and points is not None:
        points = points * np.append(_OVER, 1.0)  # confidences stay
    if figure is actor.figure and pose is actor.pose and points is actor.points:
        return actor
    return replace(actor, figure=figure, pose=pose, points=points)


def _rotated_upright(figure: Figure, pose: Pose) -> Pose:
    """Return a pose turned by half a turn Q about x: R' = Q R and s l' + T' = Q (s l + T) at roots.

    The first root stays where it is within the figure, l' = l; the figure's translation T moves it.
    """
    skeleton = shaped(figure, pose.shape_weights).skeleton
    assert skeleton is not None  # whoever has a pose has one
    turned = pose.copy()
    roots = np.flatnonzero(skeleton.parents < 0).astype(np.int32)
    within = pose.figure_scale * local_matrices(skeleton, pose)[roots, :3, 3]
    wanted = (within + pose.figure_translation) * _OVER
    turned.figure_translation = wanted[0] - within[0]
    if pose.figure_scale:
        shifts = (wanted - turned.figure_translation - within) / pose.figure_scale
        turned.translations[roots] += shifts
    rotations = _OVER[:, None] * joint_rotations(skeleton, pose)[roots]
    # The limits are those of the figure's own world, which hangs.
    set_joint_rotations(skeleton, turned, roots, rotations, clamp=False)
    return turned
