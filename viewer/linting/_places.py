"""Positions that a finding refers to in the scene, for the camera and for highlighting."""

from __future__ import annotations

from dataclasses import field

import numpy as np

from viewer.data_classes import dataclass
from viewer.linting._finding import Finding
from viewer.rigs.arrays import Floats
from viewer.rigs.geometry.transform import apply_transform
from viewer.rigs.scene import Actor, Scene, actor_points
from viewer.rigs.skinning import Skinning, deform, joint_matrices


@dataclass(frozen=True, slots=True, eq=False)
class Places:
    """Positions that a finding refers to in the posed scene, in scene space."""

    vertices: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    """(N, 3): positions, worst first."""
    triangles: Floats = field(default_factory=lambda: np.zeros((0, 3, 3)))
    """(T, 3, 3): corners of triangles; the worst triangle first."""
    joints: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    """(J, 3): joints or visible captured points; for findings about a whole motion, the actor's
    position."""
    facing: Floats = field(default_factory=lambda: np.zeros(3))
    """(3,): mean normal of the marked surface: length 1 if it all faces one direction, 0 if it
    faces all directions or there is no surface."""


def places_of(
    finding: Finding, scene: Scene, skinning: Skinning | None = None, binding: bool = False
) -> Places:
    """Return the positions that a finding refers to, in the current pose of the scene."""
    if finding.actor is None or finding.actor >= len(scene.actors):
        return Places()
    actor = scene.actors[finding.actor]
    joints = _joint_places(finding, actor)
    mesh = actor.figure.mesh
    if mesh is None or not (len(finding.vertices) or len(finding.triangles)):
        return Places(joints=joints)
    if binding:
        positions, normals = mesh.positions, mesh.normals
    else:
        positions, normals = deform(actor.figure, actor.own_pose, skinning or Skinning())
    corners = mesh.triangles[finding.triangles]
    touched = np.concatenate([finding.vertices, corners.ravel()])
    return Places(
        vertices=apply_transform(actor.placement, positions[finding.vertices]),
        triangles=apply_transform(actor.placement, positions[corners]),
        joints=joints,
        facing=_facing(normals[touched], actor),
    )


def _facing(normals: Floats, actor: Actor) -> Floats:
    """Return the mean of unit normals, rotated with the actor: (3,)."""
    mean = normals.mean(axis=0)
    rotated = actor.placement[:3, :3] @ mean
    length = float(np.linalg.norm(rotated))
    # A placement's scale must not lengthen the mean; a broken rig may have no finite normals.
    return rotated * (np.linalg.norm(mean) / length) if 0.0 < length < np.inf else np.zeros(3)


def _names_places(finding: Finding) -> bool:
    return bool(len(finding.vertices) or len(finding.triangles) or len(finding.joints))


def _joint_places(finding: Finding, actor: Actor) -> Floats:
    joints, figure = finding.joints, actor.figure
    if finding.part == "clip" and not _names_places(finding):
        return _middle(actor)
    if len(joints) and actor.moves_points:
        if actor.points is None:
            return np.zeros((0, 3))
        seen = actor.points[joints]
        return apply_transform(actor.placement, seen[seen[:, 3] > 0.0, :3])
    if len(joints) and figure.skeleton is not None and actor.own_pose is not None:
        world = joint_matrices(figure, actor.own_pose)[joints]
        return apply_transform(actor.placement, world[:, :3, 3])
    return np.zeros((0, 3))


def _middle(actor: Actor) -> Floats:
    """Return the positions that stand for an actor: its roots or the mean of its points, (N, 3)."""
    figure, points = actor.figure, actor.points
    if actor.moves_points:
        seen = np.zeros((0, 3)) if points is None else points[points[:, 3] > 0.0, :3]
        middle = seen.mean(axis=0, keepdims=True) if len(seen) else seen
        return apply_transform(actor.placement, middle)
    if figure.skeleton is None or actor.own_pose is None:
        return np.zeros((0, 3))
    roots = np.flatnonzero(figure.skeleton.parents < 0)
    return apply_transform(actor.placement, joint_matrices(figure, actor.own_pose)[roots, :3, 3])


def points_of(finding: Finding, scene: Scene, places: Places | None = None) -> Floats:
    """Return a finding's vertices, or else corners, joints or actor, in scene space: (N, 3)."""
    if finding.actor is None or finding.actor >= len(scene.actors):
        return np.zeros((0, 3))
    if not _names_places(finding):
        return actor_points(scene.actors[finding.actor])
    found = places or places_of(finding, scene)
    corners = found.triangles.reshape(-1, 3)
    several = (part for part in (found.vertices, corners, found.joints) if len(part))
    return next(several, actor_points(scene.actors[finding.actor]))
