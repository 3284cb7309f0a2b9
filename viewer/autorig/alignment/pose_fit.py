"""Fitting of a template's pose and proportions to a target by joint rotations and limb scales.

Articulated iterative closest points (Pellegrini et al. 2008): vertices of the template are matched
with the target's surface, points of the target with the template's vertices, and every iteration
moves all joints simultaneously (``pose_step``). Corresponding points may be far apart at first, as
for lowered and outstretched arms, and come closer with every iteration.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from viewer.autorig.alignment.icp import Side
from viewer.autorig.alignment.pose_step import AlignedTemplate, Pairs, PoseStep, solve_step
from viewer.autorig.alignment.proportions import Limbs, limbs_of, resized
from viewer.autorig.alignment.similarity import Similarity
from viewer.autorig.surface.samples import even_vertices
from viewer.data_classes import dataclass
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
_NEARING = 16  # number of iterations over which the search radius shrinks
_VERTICES = 1500  # number of template vertices that are matched with the target
_FAR, _NEAR = 0.25, 0.03  # ratio of the search radius to the size, at the start and at the end
_SAME_WAY = 0.5  # cosine of 60 degrees between the normals of a pair
_STILL = 2e-3  # rotation in radians; iterations end when no joint rotates by more
_FEWEST = 50  # minimum number of pairs for fitting a pose
_SMALLEST, _LARGEST = np.log(0.5), np.log(2.0)  # limits of the logarithms of limb scales


@dataclass(frozen=True, slots=True, eq=False)
class Fitted:
    """A template fitted to a target.

    Attributes
    ----------
    figure : Figure
        Figure with resized limbs.
    pose : Pose
        DOFs are within their limits; the joints' quaternions contain the remaining rotation.
    similarity : Similarity
        Map from the posed figure to the target.
    rotated : (J, 3)
        Total rotation vectors of the joints, radians.
    grown : (2, J)
        Logarithms of the scales along and across the limbs.
    """

    figure: Figure
    pose: Pose
    similarity: Similarity
    rotated: Floats
    grown: Floats


def fit_pose(
    template: Figure,
    pose: Pose,
    similarity: Similarity,
    far: Side,
    near: Side,
    scales: bool,
    report: Callable[[float], None],
) -> Fitted:
    """Rotate a template's joints and scale its limbs until its surface matches the target's.

    Limbs of a symmetric template are scaled equally on both sides.

    Parameters
    ----------
    template : Figure
        Figure with mesh, skeleton and skin, and its shape applied.
    pose : Pose
        Initial pose; not modified. Pose correctives are ignored.
    similarity : Similarity
        Initial map from the posed template to the target; without factors.
    far, near : Side
        The target, with a fast search for the first iterations and an exact search for the last.
    scales : bool
        Whether the template's size and its proportions may change.
    report : callable
        Called with the completed fraction; may raise to cancel.
    """
    mesh, skeleton, _ = template.attached()
    limbs = limbs_of(template)
    chosen = even_vertices(mesh.positions, mesh.triangles, _VERTICES)
    rotated = np.zeros((skeleton.n_joints, 3))
    state = Fitted(template, pose.copy(), similarity, rotated, np.zeros((2, skeleton.n_joints)))
    for number in range(_ROUNDS):
        report(number / _ROUNDS)
        aligned = _aligned_template(state, limbs)
        late = min(number / _NEARING, 1.0)
        target = far if late < 1.0 else near
        pairs = _pairs(aligned, chosen, target, target.size * _FAR * (_NEAR / _FAR) ** late)
        if len(pairs.vertices) < _FEWEST:
            break
        parents, size = skeleton.parents, target.size
        step = solve_step(aligned, limbs, parents, pairs, size, state.rotated, state.grown, scales)
        state = _moved(template, limbs, state, step)
        if late == 1.0 and np.abs(step.rotation_vectors).max(initial=0.0) < _STILL:
            break
    return state


def _aligned_template(state: Fitted, limbs: Limbs) -> AlignedTemplate:
    mesh, skeleton, skin = state.figure.attached()
    world = world_matrices(skeleton, state.pose)
    palette = skinning_matrices(world, skin.inverse_bind)
    place = placement_matrix(state.pose)
    posed = move(mesh.positions, skin, palette)[0]
    positions = state.similarity.apply(apply_transform(place, posed))
    joints = state.similarity.apply(apply_transform(place, world[:, :3, 3]))
    axes = (
        unit(np.einsum("jab,jb->ja", palette[:, :3, :3], limbs.axes)) @ state.similarity.rotation.T
    )
    return AlignedTemplate(positions, vertex_normals(positions, mesh.triangles), joints, axes)


def _pairs(aligned: AlignedTemplate, chosen: Ints, target: Side, reach: float) -> Pairs:
    """Match in both directions; distant points and those on the border of a hole are ignored."""
    points = aligned.positions[chosen]
    found = target.find(points)
    near = found.usable & (np.linalg.norm(found.positions - points, axis=1) <= reach)
    facing = np.einsum("na,na->n", found.normals, aligned.normals[chosen]) >= _SAME_WAY
    asked = target.samples
    distances, nearest = scipy_part("spatial").cKDTree(aligned.positions).query(asked.positions)
    same_way = np.einsum("na,na->n", asked.normals, aligned.normals[nearest]) >= _SAME_WAY
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
    """Return the state after an iteration. The whole figure moves by x' = e^u R (x - m) + m + t."""
    similarity, skeleton = state.similarity, state.figure.require_skeleton()
    growths = state.grown + step.limb_growths
    growths = np.clip(0.5 * (growths + growths[:, limbs.partners]), _SMALLEST, _LARGEST)
    pose = state.pose.copy()
    _rotate_joints(skeleton, pose, similarity, step.rotation_vectors)
    figure = resized(template, limbs, *np.exp(growths))
    rotation, growth = rotation_vector_to_matrix(step.rotation), float(np.exp(step.growth))
    shift = growth * rotation @ (similarity.shift - step.middle) + step.middle + step.shift
    moved = Similarity(
        growth * similarity.scale, rotation @ similarity.rotation, shift, similarity.factors
    )
    return Fitted(figure, pose, moved, state.rotated + step.rotation_vectors, growths)


def _rotate_joints(
    skeleton: Skeleton, pose: Pose, similarity: Similarity, rotations: Floats
) -> None:
    """Rotate joints by rotation vectors in the target's frame, in place.

    A joint whose parent has the axes P in the figure, which the alignment rotated by A, is rotated
    by the vector (A P)^T w within its parent.
    """
    parents = skeleton.parents
    within = joint_rotations(skeleton, pose)
    world = within.copy()
    below = np.flatnonzero(parents >= 0).astype(np.int32)
    for joint in below.tolist():
        # Parents come first, so the parent's axes are already final.
        world[joint] = world[parents[joint]] @ within[joint]
    axes = similarity.rotation @ world[parents[below]]
    local = np.einsum("jba,jb->ja", axes, rotations[below])
    _put_rotations(skeleton, pose, below, rotation_vector_to_matrix(local) @ within[below])


def _put_rotations(skeleton: Skeleton, pose: Pose, joints: Ints, rotations: Floats) -> None:
    """Set rotations (N, 3, 3) by DOFs within their limits, and quaternions for the remainder."""
    rows = rotation_rows(skeleton)[joints]
    ball = rows[:, 0] >= 0
    base = quaternion_to_matrix(skeleton.rest_rotations[joints[ball]])
    pose.dofs[rows[ball]] = matrix_to_euler(np.swapaxes(base, 1, 2) @ rotations[ball])
    pose.dofs[:] = clamp_dofs(skeleton, pose.dofs)
    held = dof_rotations(skeleton, pose.dofs)[joints]
    pose.rotations[joints] = matrix_to_quaternion(rotations @ np.swapaxes(held, 1, 2))
