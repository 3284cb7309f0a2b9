"""Where a finding is in the scene, for a camera that shall look there."""

from __future__ import annotations

import numpy as np

from viewer.lint._finding import Finding
from viewer.rig.arrays import Floats
from viewer.rig.points import PointClip
from viewer.rig.scene import Scene, actor_points
from viewer.rig.skinning import deform, joint_matrices
from viewer.rig.transform import apply_transform

__all__ = ["points_of"]


def points_of(finding: Finding, scene: Scene) -> Floats:
    """Return the points of a scene that a finding is about, posed as the scene is now.

    Findings about frames are seen best with the scene at ``finding.times[0]``.

    Parameters
    ----------
    finding : Finding
        Of this scene.
    scene : Scene
        As it was when it was checked.

    Returns
    -------
    (N, 3)
        Scene space: of the vertices, of the triangles' corners, or of the joints, in this order;
        all of the actor if it names none; none at all without an actor.
    """
    if finding.actor is None or finding.actor >= len(scene.actors):
        return np.zeros((0, 3))
    actor = scene.actors[finding.actor]
    figure = actor.figure
    vertices = finding.vertices
    if len(vertices) == 0 and len(finding.triangles) and figure.mesh is not None:
        vertices = figure.mesh.triangles[finding.triangles].ravel()
    if len(vertices) and figure.mesh is not None:
        return apply_transform(actor.placement, deform(figure, actor.pose)[0][vertices])
    joints = finding.joints
    if len(joints) and isinstance(actor.clip, PointClip):
        if actor.points is None:
            return np.zeros((0, 3))
        seen = actor.points[joints]
        return apply_transform(actor.placement, seen[seen[:, 3] > 0.0, :3])
    if len(joints) and figure.skeleton is not None and actor.pose is not None:
        world = joint_matrices(figure, actor.pose)[joints]
        return apply_transform(actor.placement, world[:, :3, 3])
    return actor_points(actor)
