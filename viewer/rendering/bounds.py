"""Bounding spheres of drawn actors, from joints instead of vertices."""

from __future__ import annotations

import numpy as np

from viewer.rendering.joint_spheres import box_spheres, skin_spheres, stretch
from viewer.rendering.options import DisplayOptions
from viewer.rendering.shown import placement_of, shows_mesh, shows_skeleton
from viewer.rig.arrays import Floats
from viewer.rig.kinematics import posed_skeleton
from viewer.rig.mesh import bounding_box, box_size
from viewer.rig.scene import Actor
from viewer.rig.shape import shaped, shaped_skeleton

__all__ = ["spheres_of"]

_BONE = 0.05  # largest half-width of a bone, relative to the skeleton's size


def spheres_of(actor: Actor, options: DisplayOptions) -> Floats:
    """Return spheres around the drawn parts of an actor, computed from its joints alone.

    Parameters
    ----------
    actor : Actor
        An actor that is drawn.
    options : DisplayOptions
        Display options.

    Returns
    -------
    (N, 4)
        Centre and radius, scene space.
    """
    parts = []
    if shows_mesh(actor.figure, options):
        parts.append(_of_mesh(actor, options))
    if shows_skeleton(actor, options):
        parts.append(_of_joints(actor))
    placement = placement_of(actor, options)
    found = np.concatenate(parts or [np.zeros((0, 4))])
    if actor.points is not None:
        seen = actor.points[:, 3] > 0.0
        places = np.pad(actor.points[seen, :3], ((0, 0), (0, 1)))
        found = np.concatenate([found, places])
    centers = found[:, :3] @ placement[:3, :3].T + placement[:3, 3]
    return np.column_stack([centers, found[:, 3] * stretch(placement[None])])


def _of_mesh(actor: Actor, options: DisplayOptions) -> Floats:
    figure, pose = actor.figure, actor.pose
    if options.show == "binding" or pose is None or not figure.is_attached:
        return box_spheres(bounding_box(figure.require_mesh().positions))
    return skin_spheres(shaped(figure, pose.shape_weights), pose)


def _of_joints(actor: Actor) -> Floats:
    """Return spheres around an actor's bones and joint boxes, figure space."""
    pose = actor.require_pose()
    skeleton = shaped_skeleton(actor.figure, pose.shape_weights)
    world = posed_skeleton(skeleton, pose).world
    places = world[:, :3, 3]
    size, mesh = box_size(bounding_box(places)), actor.figure.mesh
    if size == 0.0 and mesh is not None:  # used if all joints coincide
        size = box_size(bounding_box(mesh.positions))
    thick = np.full(len(places), _BONE * (size or 1.0))
    bones = np.column_stack([places, thick])
    if skeleton.boxes is None:
        return bones
    middles, halves = skeleton.boxes.mean(axis=1), 0.5 * np.ptp(skeleton.boxes, axis=1)
    centers = np.einsum("jik,jk->ji", world[:, :3, :3], middles) + world[:, :3, 3]
    boxes = np.column_stack([centers, np.linalg.norm(halves, axis=1) * stretch(world)])
    return np.concatenate([bones, boxes])
