"""Fitting of a skeleton to new proportions: same joints and DOFs, different bone lengths."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from viewer.autorig.alignment.similarity import Similarity
from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, note
from viewer.errors import RigError
from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.rotation import (
    matrix_to_euler,
    matrix_to_quaternion,
    nearest_angles,
    quaternion_to_matrix,
)
from viewer.rigs.geometry.vectors import Up
from viewer.rigs.kinematics import world_matrices
from viewer.rigs.pose import (
    Pose,
    dof_rotations,
    joint_rotations,
    rest_pose,
    rotation_rows,
    zero_pose,
)
from viewer.rigs.retargeting.mirror import joint_partners, mirror_axis
from viewer.rigs.skeleton import FIRST_ROTATION, Skeleton, joint_label

# Maximum distance of feet from the lowest joint, as a fraction of the joints' vertical extent.
_LOW = 0.1

# Minimum distance of the root from the feet of a figure with legs, as a fraction of that extent.
_LEGS = 0.2


@dataclass(frozen=True, slots=True, eq=False)
class RestSkeleton:
    """The target's skeleton, its binding, and the pose in which the target was found."""

    skeleton: Skeleton
    """It has the template's rest pose in the template's axes and the target's unit, so clips and
    poses of the template remain valid."""
    inverse_bind: Floats
    """(J, 4, 4). Inverse bind matrices for the template's bind pose."""
    pose: Pose
    """Pose that puts the joints at their positions in the target."""
    root_scale: float
    """Scale of the root's lengths, see ``leg_scale``."""
    lines: tuple[Diagnostic, ...]
    """Messages about changes other than lengths."""


def fit_rest_skeleton(
    template: Figure,
    pose: Pose,
    similarity: Similarity,
    joints: Floats,
    transferred: Bools | None,
    original: Skeleton | None = None,
    pinned: Collection[int] = (),
) -> RestSkeleton:
    """Find rest offsets that put a posed skeleton's joints at given positions (J, 3).

    ``transferred``: (J,), joints that were measured on the target. A symmetric template then gives
    a symmetric skeleton: left and right offsets are averaged, or taken from the measured side. None
    keeps the joints unchanged, as are those in ``pinned``. ``original``: the template's skeleton
    before its limbs were scaled.
    """
    skeleton, skin = template.require_skeleton(), template.require_skin()
    # The target's joint j has the world linear part R P_j, where P_j is the joint's linear part in
    # the template's pose and R is the alignment's rotation. So the offset from its parent i is (R
    # P_i)^-1 (p_j - p_i), which includes the scaled translations of the DOFs. The rest root is the
    # template's, scaled like the legs; the figure's translation moves it to the target, and R is
    # included in the root's rotation.
    scale = similarity.scale * pose.figure_scale
    rotated = world_matrices(skeleton, pose)[:, :3, :3]
    moves = scale * _moves(skeleton, pose)
    world = similarity.rotation @ rotated
    offsets = _offsets(skeleton.parents, world, joints) - moves
    roots = skeleton.parents < 0
    # Roots are in figure space: their rotation there is removed from the vectors between them.
    spread = (joints - joints[0]) @ similarity.rotation
    offsets[roots] = (scale * skeleton.rest_translations[0] + spread - moves + moves[0])[roots]
    offsets[0] = scale * skeleton.rest_translations[0]
    if transferred is not None:
        offsets = _symmetric(template, offsets, scale, transferred)
        offsets = _with_pins(skeleton.parents, world, offsets + moves, joints, pinned) - moves
    provisional = with_offsets(skeleton, offsets, np.full(len(roots), scale))
    root_scale = leg_scale(original or skeleton, provisional, template.up, scale)
    offsets[roots] += (root_scale - scale) * skeleton.rest_translations[0]
    longer = offsets - scale * skeleton.rest_translations
    joint_scales = np.where(roots, root_scale, scale)
    fitted = with_offsets(skeleton, offsets, joint_scales)
    if skeleton.boxes is not None:
        fitted = replace(fitted, boxes=scale * skeleton.boxes)
    posed = scaled_pose(skeleton, pose, joint_scales)
    fitted, lines = rotate_roots(fitted, posed, similarity.rotation)
    _move_roots(fitted, posed, joints)
    bind = _bind_matrices(skeleton.parents, skin.inverse_bind, longer, scale)
    inverse_bind = np.asarray(np.linalg.inv(bind), dtype=np.float64)
    return RestSkeleton(fitted, inverse_bind, posed, root_scale, tuple(lines))


def _moves(skeleton: Skeleton, pose: Pose) -> Floats:
    """Return a pose's additions to the rest translations: (J, 3)."""
    moves = pose.translations.copy()
    rows = skeleton.dof_kinds < FIRST_ROTATION
    np.add.at(moves, (skeleton.dof_joints[rows], skeleton.dof_kinds[rows]), pose.dofs[rows])
    return moves


def _offsets(parents: Ints, world: Floats, joints: Floats) -> Floats:
    """Return each joint's position in its parent's axes: (J, 3); roots are unchanged."""
    offsets = joints.copy()
    below = np.flatnonzero(parents >= 0)
    above = parents[below]
    ways = joints[below] - joints[above]
    # A linear system is solved, as the transpose is not the inverse if poses scale joints.
    offsets[below] = np.linalg.solve(world[above], ways[..., None])[..., 0]
    return offsets


def _with_pins(
    parents: Ints, world: Floats, offsets: Floats, joints: Floats, pinned: Collection[int]
) -> Floats:
    """Return offsets (J, 3) that put some joints where they were, in spite of changes above."""
    offsets, places = offsets.copy(), joints.copy()
    for joint, parent in enumerate(parents.tolist() if pinned else ()):
        if parent < 0:
            continue
        if joint in pinned:
            offsets[joint] = np.linalg.solve(world[parent], joints[joint] - places[parent])
        places[joint] = places[parent] + world[parent] @ offsets[joint]
    return offsets


def _symmetric(template: Figure, offsets: Floats, scale: float, transferred: Bools) -> Floats:
    """Return offsets with equal changes left and right, if the template's joints are symmetric."""
    skeleton = template.require_skeleton()
    try:
        partners = joint_partners(template)
    except RigError:
        return offsets  # the template is not symmetric, so there is no symmetry to preserve
    flip = np.ones(3)
    flip[mirror_axis(template)] = -1.0
    rest = world_matrices(skeleton, zero_pose(skeleton))[:, :3, :3]
    has_parent = skeleton.parents >= 0
    frames = np.where(has_parent[:, None, None], rest[skeleton.parents], np.eye(3))
    # The averaged values are changes from the scaled template, in its rest axes.
    changes = offsets - scale * skeleton.rest_translations
    straight = np.einsum("jab,jb->ja", frames, changes)
    mirrored = straight[partners] * flip
    own, other = transferred.astype(float), transferred[partners].astype(float)
    # The mean of both sides if both or neither were measured, else the measured side.
    neither = own + other == 0.0
    own, other = np.where(neither, 1.0, own), np.where(neither, 1.0, other)
    mixed = (own[:, None] * straight + other[:, None] * mirrored) / (own + other)[:, None]
    mixed[~has_parent] = straight[~has_parent]
    back = np.linalg.solve(frames, mixed[..., None])[..., 0]
    symmetric: Floats = scale * skeleton.rest_translations + back
    return symmetric


def with_offsets(skeleton: Skeleton, offsets: Floats, joint_scales: Floats) -> Skeleton:
    """Return a skeleton with new rest offsets (J, 3) and its lengths scaled by (J,)."""
    scales = _dof_scales(skeleton, joint_scales)
    return replace(
        skeleton,
        rest_translations=offsets,
        dof_limits=scales[:, None] * skeleton.dof_limits,
        rest_dofs=scales * skeleton.rest_dofs,
    )


def _dof_scales(skeleton: Skeleton, joint_scales: Floats) -> Floats:
    is_move = skeleton.dof_kinds < FIRST_ROTATION
    return np.where(is_move, joint_scales[skeleton.dof_joints], 1.0)


def scaled_pose(skeleton: Skeleton, pose: Pose, joint_scales: Floats) -> Pose:
    """Return a pose in the target's unit, without the figure's shape, scale and translation."""
    posed = pose.copy()
    posed.dofs *= _dof_scales(skeleton, joint_scales)
    posed.translations *= joint_scales[:, None]
    posed.shape_weights = np.zeros(0)
    posed.figure_scale = 1.0
    posed.figure_translation[:] = 0.0
    return posed


def rotate_roots(
    skeleton: Skeleton, pose: Pose, rotation: Floats
) -> tuple[Skeleton, list[Diagnostic]]:
    """Rotate the roots by the alignment, in place; ball joints are rotated by their DOFs."""
    roots = np.flatnonzero(skeleton.parents < 0)
    wanted = rotation @ joint_rotations(skeleton, pose)[roots]
    rows = rotation_rows(skeleton)[roots]
    ball = rows[:, 0] >= 0
    beneath = quaternion_to_matrix(pose.rotations[roots])
    if np.abs(rotation - np.eye(3)).max() < 1e-12:
        return skeleton, []
    limits = skeleton.dof_limits.copy()
    low, high = limits[rows[ball], 0], limits[rows[ball], 1]
    # R(quaternion) R(DOFs) must equal the target rotation: for ball joints, the DOFs are solved
    # for; for other joints, the DOFs are unchanged and the quaternion is solved for.
    angles = _angles_within((np.swapaxes(beneath, 1, 2) @ wanted)[ball], low, high)
    pose.dofs[rows[ball]] = angles
    # Limits of a root apply to the template's world, not to the target's, so the pose widens them.
    beyond = ((angles < low) | (angles > high)).any(axis=1)
    limits[rows[ball], 0] = np.minimum(low, angles)
    limits[rows[ball], 1] = np.maximum(high, angles)
    others = roots[~ball]
    held = dof_rotations(skeleton, pose.dofs)[others]
    left = wanted[~ball] @ np.swapaxes(held, 1, 2)
    pose.rotations[others] = matrix_to_quaternion(left)
    lines = [
        note(
            "R008.limits-widened: limits of {joint} widened to include the target's pose",
            joint=joint_label(skeleton, int(joint)),
        )
        for joint in roots[ball][beyond]
    ]
    return replace(skeleton, dof_limits=limits), lines


def _angles_within(rotations: Floats, low: Floats, high: Floats) -> Floats:
    """Return angles about x, y, z: of the two triples of a rotation, the one within limits."""
    first = matrix_to_euler(rotations)
    # (x, y, z) and (x + pi, pi - y, z + pi) are the same rotation.
    other = np.stack([first[:, 0] + np.pi, np.pi - first[:, 1], first[:, 2] + np.pi], axis=1)
    other = nearest_angles(other, 0.0)
    excess = [
        (np.maximum(low - angles, 0.0) + np.maximum(angles - high, 0.0)).sum(axis=1)
        for angles in (first, other)
    ]
    return np.where((excess[0] <= excess[1])[:, None], first, other)


def _move_roots(skeleton: Skeleton, pose: Pose, joints: Floats) -> None:
    """Move the figure until the first root is in position, and other roots separately."""
    found = world_matrices(skeleton, pose)[:, :3, 3]
    pose.figure_translation[:] = joints[0] - found[0]
    others = np.flatnonzero(skeleton.parents < 0)[1:]
    pose.translations[others] += joints[others] - found[others] - pose.figure_translation


def _bind_matrices(parents: Ints, inverse_bind: Floats, longer: Floats, scale: float) -> Floats:
    """Return the bind matrices of the joints: the template's bind pose with the new lengths."""
    bind = np.asarray(np.linalg.inv(inverse_bind), dtype=np.float64)
    # Each local bind matrix B_parent^-1 B keeps its linear part; its translation is scaled, and
    # changed by the same amount as the rest offset.
    local = bind.copy()
    below = np.flatnonzero(parents >= 0)
    local[below] = inverse_bind[parents[below]] @ bind[below]
    local[:, :3, 3] = scale * local[:, :3, 3] + longer
    result = local.copy()
    for joint in below.tolist():
        # Parents come first, so result[parent] is already final.
        result[joint] = result[parents[joint]] @ local[joint]
    return result


def leg_scale(before: Skeleton, after: Skeleton, up: Up, otherwise: float) -> float:
    """Return the ratio of two rest roots' heights above the feet; ``otherwise`` without legs."""
    # The root's height above the feet is roughly the leg length, and step length is proportional to
    # it. If limbs were scaled or the whole figure was stretched, root heights and translations
    # therefore scale with the legs. Hands, heads and a root on the ground have no legs.
    axis = "xyz".index(up)
    heights = _heights(before, axis)
    low, span = heights.min(), np.ptp(heights)
    feet = heights <= low + _LOW * span
    own = heights[0] - heights[feet].mean()
    if own <= _LEGS * span:
        return otherwise
    other = _heights(after, axis)
    found = float((other[0] - other[feet].mean()) / own)
    return found if found > 0.0 else otherwise


def _heights(skeleton: Skeleton, axis: int) -> Floats:
    heights: Floats = world_matrices(skeleton, rest_pose(skeleton))[:, axis, 3]
    return heights
