"""Links of a drawn skeleton: bones from joints to their children, and short ends at leaf joints."""

from __future__ import annotations

import numpy as np

from viewer.data_classes import dataclass
from viewer.rig.arrays import Floats, Ints
from viewer.rig.geometry.vectors import unit
from viewer.rig.kinematics import world_matrices
from viewer.rig.mesh import bounding_box, box_size
from viewer.rig.pose import rest_pose
from viewer.rig.skeleton import Skeleton, shown_joints, shown_parents

__all__ = ["BoneLinks", "bone_links"]

_END = 0.4  # length of an end, relative to the previous bone
_END_LIMITS = 0.01, 0.07  # minimum and maximum length of an end, relative to the figure's size
_AXIS = 0.4  # length of axes, relative to the shortest bone at the joint
_AXIS_LIMITS = 0.008, 0.06  # minimum and maximum length of axes, relative to the figure's size
_REACH = 12.0  # maximum size of a figure relative to its long bones, as roots may be far away
_SAME = 1e-6  # distance below which joints coincide, relative to the figure's size


@dataclass(frozen=True, slots=True, eq=False)
class BoneLinks:
    """Bones of a skeleton at rest.

    Attributes
    ----------
    joints : (K,) int32
        Joints that are drawn.
    ids : (N, 3) int32
        Joint; its child, -1 for an end; the joint's axis that is most perpendicular to the bone.
    ends : (N, 4)
        For an end, its direction in joint space and its length in figure units; otherwise 0.
    longest : (J,)
        Length of the longest bone at each joint, figure units.
    axis_lengths : (J,)
        Length of the axes drawn at each joint, figure units.
    size : float
        Size from which widths are derived, figure units.
    """

    joints: Ints
    ids: Ints
    ends: Floats
    longest: Floats
    axis_lengths: Floats
    size: float


def bone_links(skeleton: Skeleton, size: float = 1.0) -> BoneLinks:
    """Return the links of a skeleton.

    A joint with several children has a bone to each. A joint without children has a short end in
    the direction of the previous bone if it can rotate, so that its rotation is visible. The bone
    reaches its far end if the file states that. Bones between coincident joints have length 0.

    Parameters
    ----------
    skeleton : Skeleton
        The skeleton; its rest pose is used.
    size : float
        Size of the figure if all joints coincide, figure units.
    """
    worlds = world_matrices(skeleton, rest_pose(skeleton))
    points, axes = worlds[:, :3, 3], unit(np.swapaxes(worlds[:, :3, :3], 1, 2))
    parents, drawn = shown_parents(skeleton), shown_joints(skeleton)
    children = drawn[parents[drawn] >= 0]
    above = parents[children]
    spans = points[children] - points[above]
    lengths = np.linalg.norm(spans, axis=1)
    size = _size(points[drawn], lengths) or size
    lengths = np.where(lengths > _SAME * size, lengths, 0.0)
    ends = _end_joints(skeleton, above)
    ways, reach = _ends(points, parents, ends, axes, size)
    if skeleton.boxes is not None and skeleton.boxes_from_bones:
        # These boxes reach from a leaf joint, at 0, to the far end of its bone.
        tips = np.einsum("nk,nka->na", skeleton.boxes[ends].sum(axis=1), axes[ends])
        known = np.linalg.norm(tips, axis=1) > _SAME * size
        ways[known], reach[known] = unit(tips[known]), np.linalg.norm(tips[known], axis=1)
    joints = np.concatenate([above, ends])
    along = np.abs(np.einsum("nka,na->nk", axes[joints], np.concatenate([unit(spans), ways])))
    ids = np.stack([joints, np.append(children, np.full(len(ends), -1)), along.argmin(axis=1)], 1)
    free = np.zeros((len(ids), 4))
    # Coordinates of the direction in the joint's own, possibly oblique, axes.
    back = np.linalg.pinv(np.swapaxes(axes[ends], 1, 2))
    free[len(children) :, :3] = np.einsum("nab,nb->na", back, ways)
    free[len(children) :, 3] = reach
    longest, nearest = np.zeros(len(points)), np.full(len(points), np.inf)
    for beside in (children, above):
        np.maximum.at(longest, beside, lengths)
        np.minimum.at(nearest, beside, np.where(lengths > 0.0, lengths, np.inf))
    if not lengths.any():
        # Without bones, ends and balls are as large as the largest ends.
        longest[:], free[len(children) :, 3] = size * _END_LIMITS[1] / _END, size * _END_LIMITS[1]
    shown = np.clip(_AXIS * nearest, _AXIS_LIMITS[0] * size, _AXIS_LIMITS[1] * size)
    return BoneLinks(drawn, ids.astype(np.int32), free, longest, shown, size)


def _size(points: Floats, lengths: Floats) -> float:
    """Return the size of a skeleton, excluding a root that is far from everything else."""
    whole = box_size(bounding_box(points))
    long = float(np.quantile(lengths, 0.9)) if len(lengths) else 0.0
    return min(whole, _REACH * long) if long > 0.0 else whole


def _end_joints(skeleton: Skeleton, above: Ints) -> Ints:
    """Return the joints that can rotate and are not among the parents of others."""
    is_end = np.ones(skeleton.n_joints, dtype=bool)
    is_end[above] = False
    turns = np.zeros(skeleton.n_joints, dtype=bool)
    turns[skeleton.dof_joints[(skeleton.dof_kinds >= 3) & ~skeleton.locked]] = True
    return np.flatnonzero(is_end & turns).astype(np.int32)


def _ends(
    points: Floats, parents: Ints, joints: Ints, axes: Floats, size: float
) -> tuple[Floats, Floats]:
    """Return direction and length of each end: (N, 3) and (N,), figure space."""
    ways, lengths = np.zeros((len(joints), 3)), np.zeros(len(joints))
    for row, joint in enumerate(joints.tolist()):
        above, ways[row] = int(parents[joint]), axes[joint, 1]
        while above >= 0:
            span = points[joint] - points[above]
            lengths[row] = float(np.linalg.norm(span))
            if lengths[row] > _SAME * size:
                ways[row] = span / lengths[row]
                break
            above = int(parents[above])
    low, high = _END_LIMITS
    return ways, np.clip(_END * lengths, low * size, high * size)
