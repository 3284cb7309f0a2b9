"""Skeletons in ``.skel`` form: joints in depth-first order, three rotations each, a moving root."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from viewer.data_classes import dataclass
from viewer.formats._skel.keywords import KEYWORDS
from viewer.media.saving import as_words
from viewer.rig.arrays import Bools, Floats, Ints
from viewer.rig.figure import Figure
from viewer.rig.geometry.rotation import matrix_to_euler, quaternion_to_matrix
from viewer.rig.hierarchy import depth_first
from viewer.rig.kinematics import forward_kinematics
from viewer.rig.motion.single_frame import pose_frames
from viewer.rig.pose import Pose, rest_pose
from viewer.rig.skeleton import FIRST_ROTATION, Skeleton

_SAME = 1e-12  # tolerance of rotation matrices and scales
_CUBE = 0.01  # half the edge length of default boxes, relative to the skeleton's size


@dataclass(frozen=True, slots=True, eq=False)
class CourseSkeleton:
    """A skeleton in the form of ``.skel`` files, whose joints only rotate about x, then y, then z.

    Attributes
    ----------
    skeleton : Skeleton
        Joints in depth-first order, with the pose as rest pose.
    order : (J,) int32
        The old index of each new joint.
    turned : sequence of int
        Old indices of joints whose three angles include a rest rotation, another order of rotations
        or a constraint: they have no limits.
    unlimited : sequence of int
        Those of them that had limits.
    is_scaled : bool
        Whether the pose scales joints, which a ``.skel`` cannot: the bindings have to.
    renamed : sequence of str
        Names that the format cannot store.
    """

    skeleton: Skeleton
    order: Ints
    turned: Sequence[int]
    unlimited: Sequence[int]
    is_scaled: bool
    renamed: Sequence[str]


def course_skeleton(skeleton: Skeleton, pose: Pose) -> CourseSkeleton:
    """Return a skeleton in the form of ``.skel`` files, with the pose as its rest pose.

    A joint of a ``.skel`` has the local matrix T(offset) Rz Ry Rx, in the axes of its parent. So
    translations are part of the offsets. A joint with a rest rotation R0 has the angles of
    R0 R(DOFs), its rotation in the pose, instead of its DOFs. In a scaled pose, offsets are those
    of the posed joints.

    ``skeleton``: its lengths already include the figure's scale.
    ``pose``: the figure's translation is added to the roots' offsets.
    """
    pose, moved = _scaled(skeleton, pose)
    order = depth_first(skeleton.parents)
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    above = skeleton.parents[order]
    rows, is_plain = _plain_rows(skeleton, pose)
    offsets = skeleton.rest_translations + moved
    frames = pose_frames(Figure("", skeleton=skeleton), pose)[1]
    rotations = quaternion_to_matrix(frames.rotations[0])
    is_scaled = bool((np.abs(pose.scales - 1.0) > _SAME).any())
    if is_scaled:
        offsets = _unscaled_offsets(skeleton, pose, offsets, rotations)
    offsets[skeleton.parents < 0] += pose.figure_translation
    values = np.where(rows >= 0, pose.dofs[rows], 0.0)
    values[~is_plain] = matrix_to_euler(rotations[~is_plain])
    limits = np.where(rows[..., None] >= 0, skeleton.dof_limits[rows], 0.0)
    limits[~is_plain] = -np.inf, np.inf
    count = skeleton.n_joints
    names, renamed = _course_names([skeleton.names[joint] for joint in order])
    limited = skeleton.dof_joints[np.isfinite(skeleton.dof_limits).any(axis=1)]
    return CourseSkeleton(
        Skeleton(
            names=names,
            parents=np.where(above >= 0, place[above], -1).astype(np.int32),
            rest_translations=offsets[order],
            rest_rotations=np.tile([0.0, 0.0, 0.0, 1.0], (count, 1)),
            rest_scales=np.ones((count, 3)),
            dof_joints=np.concatenate([np.zeros(3, int), np.repeat(np.arange(count), 3)]),
            dof_kinds=np.concatenate([np.arange(3), np.tile([3, 4, 5], count)]),
            rest_dofs=np.concatenate([np.zeros(3), values[order].ravel()]),
            dof_limits=np.concatenate(
                [np.tile([-np.inf, np.inf], (3, 1)), limits[order].reshape(-1, 2)]
            ),
            boxes=_boxes(skeleton)[order],
        ),
        order,
        np.flatnonzero(~is_plain).tolist(),
        np.intersect1d(np.flatnonzero(~is_plain), limited).tolist(),
        is_scaled,
        renamed,
    )


def course_pose(figure: Figure, pose: Pose) -> tuple[Figure, Pose]:
    """Return the skeleton that is written for a figure at rest, and a pose of the figure for it.

    Angles of turned joints mean something else in the file than in the figure.
    """
    skeleton, plain = figure.require_skeleton(), pose.copy()
    plain.figure_scale, plain.figure_translation = 1.0, np.zeros(3)
    written = course_skeleton(skeleton, rest_pose(skeleton)).skeleton
    posed = course_skeleton(skeleton, plain).skeleton
    found = rest_pose(written)
    found.dofs[:] = posed.rest_dofs
    found.translations[:] = posed.rest_translations - written.rest_translations
    found.figure_scale, found.figure_translation = pose.figure_scale, pose.figure_translation
    return Figure(figure.name, skeleton=written, up=figure.up, unit=figure.unit), found


def _scaled(skeleton: Skeleton, pose: Pose) -> tuple[Pose, Floats]:
    """Return a pose with the lengths of the scaled figure, and the translations of its joints."""
    factor = pose.figure_scale
    moves = np.flatnonzero(skeleton.dof_kinds < FIRST_ROTATION)
    scaled = replace(
        pose.copy(),
        figure_scale=1.0,
        translations=factor * pose.translations,
        shape_weights=np.zeros(0),  # applied already
    )
    scaled.dofs[moves] *= factor
    moved = scaled.translations.copy()
    np.add.at(moved, (skeleton.dof_joints[moves], skeleton.dof_kinds[moves]), scaled.dofs[moves])
    if skeleton.posing is not None:
        own = skeleton.posing.translations(pose.dofs)
        scaled.translations += (factor - 1.0) * own
        moved += factor * own
    return scaled, moved


def _plain_rows(skeleton: Skeleton, pose: Pose) -> tuple[Ints, Bools]:
    """Return the DOF rows about x, y and z, -1 if missing, and which joints have only these."""
    rows = np.full((skeleton.n_joints, 3), -1, dtype=np.int32)
    rotated = np.abs(quaternion_to_matrix(pose.rotations) - np.eye(3)).max(axis=(1, 2))
    is_plain: Bools = (rotated <= _SAME) & (skeleton.posing is None)
    for row in np.flatnonzero(skeleton.dof_kinds >= FIRST_ROTATION).tolist():
        joint, axis = int(skeleton.dof_joints[row]), int(skeleton.dof_kinds[row]) - FIRST_ROTATION
        if rows[joint, axis:].max() >= 0:
            is_plain[joint] = False  # another order of rotations
        rows[joint, axis] = row
    is_plain[[constraint.joint for constraint in skeleton.constraints]] = False
    return rows, is_plain


def _unscaled_offsets(
    skeleton: Skeleton, pose: Pose, translations: Floats, rotations: Floats
) -> Floats:
    """Return the offsets that put unscaled joints where the scaled ones are: (J, 3).

    With the product D of the rotations down to the parent: D^-1 (p_j - p_parent).
    """
    local = np.zeros((2, skeleton.n_joints, 4, 4))
    local[..., 3, 3] = 1.0
    local[0, :, :3, :3], local[1, :, :3, :3] = rotations * pose.scales[:, None], rotations
    local[0, :, :3, 3] = translations
    places = forward_kinematics(skeleton.parents, local[0])[:, :3, 3]
    turns = forward_kinematics(skeleton.parents, local[1])[:, :3, :3]
    inner = skeleton.parents >= 0
    offsets = translations.copy()
    above = skeleton.parents[inner]
    offsets[inner] = np.einsum("jba,jb->ja", turns[above], places[inner] - places[above])
    return offsets


def _course_names(names: Sequence[str]) -> tuple[tuple[str, ...], list[str]]:
    """Return names of words without braces or keywords, and the names that had to be changed."""
    found, renamed = [], []
    for name in names:
        words = as_words(name)
        if words is not None and not KEYWORDS & set(words):
            found.append(name)
            continue
        renamed.append(name)
        plain = name.translate({ord("{"): "(", ord("}"): ")"}).encode("utf-8", "replace").decode()
        found.append(" ".join(f"_{w}" if w.encode() in KEYWORDS else w for w in plain.split()))
    return tuple(found), renamed


def _boxes(skeleton: Skeleton) -> Floats:
    if skeleton.boxes is not None:
        return skeleton.boxes
    half = _CUBE * (float(np.abs(skeleton.rest_translations).max()) or 1.0)
    return np.tile([[-half] * 3, [half] * 3], (skeleton.n_joints, 1, 1))
