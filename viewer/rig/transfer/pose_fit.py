"""A posed template turned joint by joint until it lies on the target.

Articulated iterative closest points (Pellegrini et al. 2008): vertices of the template look for
the target's surface, points of the target for the template's vertices, and every round moves all
joints at once (``pose_step``). Partners may be far apart at first, as arms that hang down are from
those stretched out, and come closer round by round.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from viewer.rig._scipy import scipy_part
from viewer.rig.arrays import Floats, Ints
from viewer.rig.figure import Figure
from viewer.rig.kinematics import skinning_matrices, world_matrices
from viewer.rig.mesh import vertex_normals
from viewer.rig.pose import Pose, dof_rotations, joint_rotations, placement_matrix
from viewer.rig.pose_vector import rotation_rows
from viewer.rig.rotation import (
    matrix_to_euler,
    matrix_to_quaternion,
    quaternion_to_matrix,
    rotation_vector_to_matrix,
)
from viewer.rig.skeleton import Skeleton, clamp_dofs
from viewer.rig.skin import Skin, influence_counts, weight_sums
from viewer.rig.skinning.lbs import move
from viewer.rig.transfer.icp import Side
from viewer.rig.transfer.pose_step import Pairs, PoseStep, solve_step
from viewer.rig.transfer.similarity import Similarity
from viewer.rig.transfer.surface_samples import even_vertices
from viewer.rig.transform import apply_transform

__all__ = ["fit_pose", "joint_shares"]

_ROUNDS = 28
_NEARING = 16  # rounds in which the reach shrinks
_VERTICES = 1500  # of the template that look for the target
_FAR, _NEAR = 0.25, 0.03  # of the size: how far partners may be, at first and in the end
_SAME_WAY = 0.5  # cosine of 60 degrees between the normals of a pair
_STILL = 1e-3  # radians: late rounds that turn no joint by more are the last ones
_FEWEST = 50  # pairs that still tell how a figure stands


@dataclass(frozen=True, slots=True, eq=False)
class _Laid:
    """A template as it stands: vertices and normals (V, 3) and joints (J, 3) in the target."""

    positions: Floats
    normals: Floats
    joints: Floats


def fit_pose(
    template: Figure,
    pose: Pose,
    placed: Similarity,
    far: Side,
    near: Side,
    scales: bool,
    report: Callable[[float], None],
) -> tuple[Pose, Similarity]:
    """Turn a template's joints until its surface lies on the target's.

    Parameters
    ----------
    template : Figure
        With mesh, skeleton and skin, already shaped.
    pose : Pose
        To begin with; left as it is. Pose correctives are not looked at.
    placed : Similarity
        From the posed template to the target, to begin with; without factors.
    far, near : Side
        The target: searched quickly at first, and exactly in the end.
    scales : bool
        Whether the template's size may change.
    report : callable
        Told the share that is done; may raise to cancel.

    Returns
    -------
    pose : Pose
        DOFs are within their limits; what these do not allow is in the joints' quaternions.
    placed : Similarity
        With its own rotation, shift and scale.
    """
    mesh, skeleton, skin = template.mesh, template.skeleton, template.skin
    assert mesh is not None and skeleton is not None and skin is not None  # the caller looked
    chosen = even_vertices(mesh.positions, mesh.triangles, _VERTICES)
    shares = joint_shares(skin, skeleton.parents)
    pose, turned = pose.copy(), np.zeros((skeleton.n_joints, 3))
    for number in range(_ROUNDS):
        report(number / _ROUNDS)
        laid = _lay(template, pose, placed)
        late = min(number / _NEARING, 1.0)
        target = far if late < 1.0 else near
        pairs = _pairs(laid, chosen, target, target.size * _FAR * (_NEAR / _FAR) ** late)
        if len(pairs.vertices) < _FEWEST:
            break
        step = solve_step(
            laid.positions,
            laid.joints,
            shares,
            skeleton.parents,
            turned,
            pairs,
            target.size,
            scales,
        )
        _turn_joints(skeleton, pose, placed, step.joint_turns)
        placed = _moved(placed, step)
        turned += step.joint_turns
        if late == 1.0 and np.abs(step.joint_turns).max(initial=0.0) < _STILL:
            break
    return pose, placed


def joint_shares(skin: Skin, parents: Ints) -> Floats:
    """Return how much of each vertex hangs on a joint or below it: (V, J), from 0 to 1."""
    owners = np.repeat(np.arange(skin.n_vertices), influence_counts(skin))
    shares = np.zeros((skin.n_vertices, skin.n_joints))
    np.add.at(shares, (owners, skin.joints), skin.weights)
    sums = weight_sums(skin)
    shares /= np.where(sums > 0.0, sums, 1.0)[:, None]
    for joint in range(len(parents) - 1, -1, -1):
        # Children come after their parents, so this joint's own sum is final.
        if parents[joint] >= 0:
            shares[:, parents[joint]] += shares[:, joint]
    return shares


def _lay(template: Figure, pose: Pose, placed: Similarity) -> _Laid:
    mesh, skeleton, skin = template.mesh, template.skeleton, template.skin
    assert mesh is not None and skeleton is not None and skin is not None  # the caller looked
    world = world_matrices(skeleton, pose)
    posed = move(mesh.positions, skin, skinning_matrices(world, skin.inverse_bind))[0]
    place = placement_matrix(pose)
    positions = placed.apply(apply_transform(place, posed))
    joints = placed.apply(apply_transform(place, world[:, :3, 3]))
    return _Laid(positions, vertex_normals(positions, mesh.triangles), joints)


def _pairs(laid: _Laid, chosen: Ints, target: Side, reach: float) -> Pairs:
    """Match both ways; what is too far away or on the border of a hole is no pair."""
    points = laid.positions[chosen]
    found = target.find(points)
    near = found.usable & (np.linalg.norm(found.positions - points, axis=1) <= reach)
    facing = np.einsum("na,na->n", found.normals, laid.normals[chosen]) >= _SAME_WAY
    asked = target.samples
    distances, nearest = scipy_part("spatial").cKDTree(laid.positions).query(asked.positions)
    same_way = np.einsum("na,na->n", asked.normals, laid.normals[nearest]) >= _SAME_WAY
    towards = (distances <= reach) & same_way
    away = near & facing
    return Pairs(
        np.concatenate([chosen[away], nearest[towards]]),
        np.concatenate([found.positions[away], asked.positions[towards]]),
        np.concatenate([found.normals[away], asked.normals[towards]]),
        chosen[near],
        found.positions[near],
    )


def _moved(placed: Similarity, step: PoseStep) -> Similarity:
    """Return the template's place after a round: x' = g R (x - m) + m + t."""
    turn = rotation_vector_to_matrix(step.turn)
    shift = step.growth * turn @ (placed.shift - step.middle) + step.middle + step.shift
    return Similarity(step.growth * placed.scale, turn @ placed.rotation, shift, placed.factors)


def _turn_joints(skeleton: Skeleton, pose: Pose, placed: Similarity, turns: Floats) -> None:
    """Turn joints by rotation vectors of the target's frame, in place.

    A joint with the parent's axes P within the figure, which the alignment turned by A, is turned
    by the vector (A P)^T w within its parent.
    """
    parents = skeleton.parents
    within = joint_rotations(skeleton, pose)
    world = within.copy()
    for joint in np.flatnonzero(parents >= 0).tolist():
        # Parents come first, so the parent's axes are final.
        world[joint] = world[parents[joint]] @ within[joint]
    below = np.flatnonzero(parents >= 0)
    axes = placed.rotation @ world[parents[below]]
    local = np.einsum("jba,jb->ja", axes, turns[below])
    _put_rotations(skeleton, pose, below, rotation_vector_to_matrix(local) @ within[below])


def _put_rotations(skeleton: Skeleton, pose: Pose, joints: Ints, rotations: Floats) -> None:
    """Set rotations (N, 3, 3) by DOFs within their limits, and by quaternions for the rest."""
    rows = rotation_rows(skeleton)[joints]
    ball = rows[:, 0] >= 0
    base = quaternion_to_matrix(skeleton.rest_rotations[joints[ball]])
    pose.dofs[rows[ball]] = matrix_to_euler(np.swapaxes(base, 1, 2) @ rotations[ball])
    pose.dofs[:] = clamp_dofs(skeleton, pose.dofs)
    held = dof_rotations(skeleton, pose.dofs)[joints]
    pose.rotations[joints] = matrix_to_quaternion(rotations @ np.swapaxes(held, 1, 2))
