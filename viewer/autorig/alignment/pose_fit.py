"""A template whose joints are turned, and limbs resized, until it lies on the target.

Articulated iterative closest points (Pellegrini et al. 2008): vertices of the template look for
the target's surface, points of the target for the template's vertices, and every round moves all
joints at once (``pose_step``). Partners may be far apart at first, as arms that hang down are from
those stretched out, and come closer round by round.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from viewer.autorig.alignment.icp import Side
from viewer.autorig.alignment.pose_step import Laid, Pairs, PoseStep, solve_step
from viewer.autorig.alignment.proportions import Limbs, limbs_of, resized
from viewer.autorig.alignment.similarity import Similarity
from viewer.autorig.surface.samples import even_vertices
from viewer.rig._scipy import scipy_part
from viewer.rig.arrays import Floats, Ints
from viewer.rig.figure import Figure
from viewer.rig.geometry.rotation import (
    matrix_to_euler,
    matrix_to_quaternion,
    quaternion_to_matrix,
    rotation_vector_to_matrix,
)
from viewer.rig.geometry.transform import apply_transform
from viewer.rig.geometry.vectors import unit
from viewer.rig.kinematics import skinning_matrices, world_matrices
from viewer.rig.mesh import vertex_normals
from viewer.rig.pose import Pose, dof_rotations, joint_rotations, placement_matrix
from viewer.rig.posing.pose_vector import rotation_rows
from viewer.rig.skeleton import Skeleton, clamp_dofs
from viewer.rig.skinning.lbs import move

__all__ = ["Fitted", "fit_pose"]

_ROUNDS = 32
_NEARING = 16  # rounds in which the reach shrinks
_VERTICES = 1500  # of the template that look for the target
_FAR, _NEAR = 0.25, 0.03  # of the size: how far partners may be, at first and in the end
_SAME_WAY = 0.5  # cosine of 60 degrees between the normals of a pair
_STILL = 2e-3  # radians: late rounds that turn no joint by more are the last ones
_FEWEST = 50  # pairs that still tell how a figure stands
_SMALLEST, _LARGEST = np.log(0.5), np.log(2.0)  # of limbs


@dataclass(frozen=True, slots=True, eq=False)
class Fitted:
    """A template that was made to fit.

    Attributes
    ----------
    figure : Figure
        With its limbs resized.
    pose : Pose
        DOFs are within their limits; what these do not allow is in the joints' quaternions.
    placed : Similarity
        From the posed figure to the target.
    turned : (J, 3)
        Rotation vectors that the joints were turned by in all, radians.
    grown : (2, J)
        Logarithms of the factors along and across the limbs.
    """

    figure: Figure
    pose: Pose
    placed: Similarity
    turned: Floats
    grown: Floats


def fit_pose(
    template: Figure,
    pose: Pose,
    placed: Similarity,
    far: Side,
    near: Side,
    scales: bool,
    report: Callable[[float], None],
) -> Fitted:
    """Turn a template's joints and resize its limbs until its surface lies on the target's.

    Limbs of a symmetric template grow alike on both sides.

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
        Whether the template's size may change, and its proportions.
    report : callable
        Told the share that is done; may raise to cancel.
    """
    assert template.mesh is not None and template.skeleton is not None  # the caller looked
    limbs, skeleton = limbs_of(template), template.skeleton
    chosen = even_vertices(template.mesh.positions, template.mesh.triangles, _VERTICES)
    turned = np.zeros((skeleton.n_joints, 3))
    state = Fitted(template, pose.copy(), placed, turned, np.zeros((2, skeleton.n_joints)))
    for number in range(_ROUNDS):
        report(number / _ROUNDS)
        laid = _lay(state, limbs)
        late = min(number / _NEARING, 1.0)
        target = far if late < 1.0 else near
        pairs = _pairs(laid, chosen, target, target.size * _FAR * (_NEAR / _FAR) ** late)
        if len(pairs.vertices) < _FEWEST:
            break
        parents, size = skeleton.parents, target.size
        step = solve_step(laid, limbs, parents, pairs, size, state.turned, state.grown, scales)
        state = _moved(template, limbs, state, step)
        if late == 1.0 and np.abs(step.joint_turns).max(initial=0.0) < _STILL:
            break
    return state


def _lay(state: Fitted, limbs: Limbs) -> Laid:
    mesh, skeleton, skin = state.figure.mesh, state.figure.skeleton, state.figure.skin
    assert mesh is not None and skeleton is not None and skin is not None  # the caller looked
    world = world_matrices(skeleton, state.pose)
    palette = skinning_matrices(world, skin.inverse_bind)
    place = placement_matrix(state.pose)
    posed = move(mesh.positions, skin, palette)[0]
    positions = state.placed.apply(apply_transform(place, posed))
    joints = state.placed.apply(apply_transform(place, world[:, :3, 3]))
    axes = unit(np.einsum("jab,jb->ja", palette[:, :3, :3], limbs.axes)) @ state.placed.rotation.T
    return Laid(positions, vertex_normals(positions, mesh.triangles), joints, axes)


def _pairs(laid: Laid, chosen: Ints, target: Side, reach: float) -> Pairs:
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


def _moved(template: Figure, limbs: Limbs, state: Fitted, step: PoseStep) -> Fitted:
    """Return what a round leads to: the whole goes by x' = e^u R (x - m) + m + t."""
    placed, skeleton = state.placed, state.figure.skeleton
    assert skeleton is not None  # the caller looked
    growths = state.grown + step.limb_growths
    growths = np.clip(0.5 * (growths + growths[:, limbs.partners]), _SMALLEST, _LARGEST)
    pose = state.pose.copy()
    _turn_joints(skeleton, pose, placed, step.joint_turns)
    figure = resized(template, limbs, *np.exp(growths))
    turn, growth = rotation_vector_to_matrix(step.turn), float(np.exp(step.growth))
    shift = growth * turn @ (placed.shift - step.middle) + step.middle + step.shift
    moved = Similarity(growth * placed.scale, turn @ placed.rotation, shift, placed.factors)
    return Fitted(figure, pose, moved, state.turned + step.joint_turns, growths)


def _turn_joints(skeleton: Skeleton, pose: Pose, placed: Similarity, turns: Floats) -> None:
    """Turn joints by rotation vectors of the target's frame, in place.

    A joint with the parent's axes P within the figure, which the alignment turned by A, is turned
    by the vector (A P)^T w within its parent.
    """
    parents = skeleton.parents
    within = joint_rotations(skeleton, pose)
    world = within.copy()
    below = np.flatnonzero(parents >= 0).astype(np.int32)
    for joint in below.tolist():
        # Parents come first, so the parent's axes are final.
        world[joint] = world[parents[joint]] @ within[joint]
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
