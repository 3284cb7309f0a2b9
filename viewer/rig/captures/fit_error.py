"""Distances between captured keypoints and the joints of the body that was fitted to them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from viewer.rig.captures.keypoint_layouts import matching_joints
from viewer.rig.captures.person import is_tracked
from viewer.rig.geometry.transform import apply_transform
from viewer.rig.scene import Actor
from viewer.rig.skinning import joint_matrices

__all__ = ["fitted_body", "keypoint_distances"]


def fitted_body(points: Actor, actors: Sequence[Actor]) -> Actor | None:
    """Return the body of the person to whom captured keypoints belong, or None.

    Keypoints of untracked people cannot be associated with a body.
    """
    for actor in actors:
        same = actor.person == points.person and is_tracked(actor.person)
        if same and actor.pose is not None and actor.figure.mesh is not None:
            return actor
    return None


def keypoint_distances(points: Actor, body: Actor) -> dict[str, float]:
    """Return the distance from each visible keypoint to the corresponding joint.

    The joints are the model's: regressed from its shaped mesh, then posed.

    Parameters
    ----------
    points : Actor
        Captured keypoints at the current time.
    body : Actor
        A posed figure with the SMPL family's joint names.

    Returns
    -------
    dict of str to float
        Keypoint names to distances in scene units; empty if either actor is absent.
    """
    layout, skeleton = points.figure.points, body.figure.skeleton
    if layout is None or points.points is None or skeleton is None or body.pose is None:
        return {}
    if not (points.is_present and body.is_present):
        return {}
    joints = apply_transform(body.placement, joint_matrices(body.figure, body.pose)[:, :3, 3])
    places = apply_transform(points.placement, points.points[:, :3])
    found = {}
    for index, name in matching_joints(layout).items():
        if name in skeleton.names and points.points[index, 3] > 0.0:
            step = places[index] - joints[skeleton.names.index(name)]
            found[layout.names[index]] = float(np.linalg.norm(step))
    return found
