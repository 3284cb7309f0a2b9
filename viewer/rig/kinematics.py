"""Forward kinematics: from local matrices to world matrices to skinning matrices."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from viewer.rig.arrays import Bools, Floats, Ints
from viewer.rig.geometry.transform import affine_matrices
from viewer.rig.pose import Pose, PosedSkeleton, joint_rotations, local_transforms
from viewer.rig.skeleton import Skeleton

# Relative tolerance of A^T A = s^2 I. Treating a matrix within this tolerance as rigid rotates
# normals by at most half of it, in radians.
_RIGID = 1e-5
_MOST_JOINTS = 4096  # maximum number of joints of hierarchies whose passes are cached

Indices = NDArray[np.intp]


def forward_kinematics(parents: Ints, local: Floats, root: Floats | None = None) -> Floats:
    """Concatenate local matrices down the hierarchy: W[j] = W[parent[j]] @ L[j].

    Pointer doubling for one pose: every pass multiplies each joint's matrix by the matrix of the
    ancestor to which it points, and adopts that ancestor's pointer, so a chain of n joints takes
    log2(n) passes (Hillis and Steele 1986). The matrices of many poses are multiplied joint by
    joint, which takes a single product for each.

    ``parents``: (J,), index of each joint's parent, smaller than its own; -1 for a root. ``local``:
    (J, 4, 4) or (J, F, n, n), joint-to-parent matrices; of many poses, these can also be rotations
    alone. ``root``: (4, 4), placement of the whole figure in the world; identity if omitted.
    Returns (J, 4, 4) or (J, F, n, n), joint-to-world matrices, lengths in the unit of ``local``.

    >>> local = np.stack([np.eye(4)] * 2)
    >>> local[:, 0, 3] = 2.0, 1.0
    >>> float(forward_kinematics(np.array([-1, 0]), local)[1, 0, 3])
    3.0
    """
    world = local.copy()
    if local.ndim > 3:
        # The matrices of one joint in many poses fill the caches, so one pass without copies is
        # fastest.
        for joint, parent in enumerate(parents.tolist()):
            if parent >= 0:
                np.matmul(world[parent], local[joint], out=world[joint])
        return world if root is None else root @ world
    parents = np.asarray(parents, dtype=np.int32)
    is_kept = len(parents) <= _MOST_JOINTS
    for above, below in _kept_passes(parents.tobytes()) if is_kept else _passes(parents):
        world[below] = world[above] @ world[below]
    return world if root is None else root @ world


def joint_worlds(parents: Ints, linear: Floats, offsets: Floats) -> Floats:
    """Return the joint-to-figure matrices of one or many poses: (J, 4, 4) or (F, J, 4, 4).

    ``linear`` (..., J, 3, 3): rotation and scale relative to the parent. ``offsets`` (..., J, 3):
    place relative to the parent. Both are broadcast.
    """
    shape = np.broadcast_shapes(linear.shape[:-2], offsets.shape[:-1])
    if len(shape) == 1:
        return forward_kinematics(parents, affine_matrices(linear, offsets))
    # With the joint axis first, a joint's matrices of all poses lie together.
    linear = np.swapaxes(np.broadcast_to(linear, (*shape, 3, 3)), 0, 1)
    offsets = np.swapaxes(np.broadcast_to(offsets, (*shape, 3)), 0, 1)
    return np.swapaxes(forward_kinematics(parents, affine_matrices(linear, offsets)), 0, 1)


def _passes(parents: Ints) -> Iterator[tuple[Indices, Indices]]:
    """Yield the ancestors and joints whose matrices are multiplied in each pass."""
    ancestors = parents.astype(np.intp)
    below = np.flatnonzero(ancestors >= 0)
    while len(below):
        above = ancestors[below]
        yield above, below
        ancestors[below] = ancestors[above]
        below = below[ancestors[below] >= 0]


@lru_cache(64)
def _kept_passes(parents: bytes) -> tuple[tuple[Indices, Indices], ...]:
    return tuple(_passes(np.frombuffer(parents, dtype=np.int32)))


def world_matrices(skeleton: Skeleton, pose: Pose) -> Floats:
    """Return the world matrices of all joints in a pose.

    ``pose``: DOFs in lengths and radians. Returns (J, 4, 4), joint-to-figure matrices.
    """
    turns = joint_rotations(skeleton, pose)
    parts = local_transforms(skeleton, turns, pose.dofs, pose.translations, pose.scales)
    return joint_worlds(skeleton.parents, *parts)


def posed_skeleton(skeleton: Skeleton, pose: Pose) -> PosedSkeleton:
    """Return the world and skinning matrices of a pose, cached until the pose changes.

    The pose stores the result, so forward kinematics runs once per frame for all passes and panels.

    ``pose``: DOFs in lengths and radians. The matrices are read-only.
    """
    known, key = pose.posed, pose.skinning_key
    if known is None or known.skeleton is not skeleton or known.key is not key:
        known = pose.posed = PosedSkeleton(skeleton, key, world_matrices(skeleton, pose))
    return known


def is_posed(skeleton: Skeleton, pose: Pose) -> bool:
    """Return whether the ``posed_skeleton`` that a pose has stored is up to date."""
    known = pose.posed
    return known is not None and known.skeleton is skeleton and known.key is pose.skinning_key


def skinning_matrices(world: Floats, inverse_bind: Floats) -> Floats:
    """Return the skinning matrices: M[j] = W[j] inverse(B[j]).

    ``world``: (J, 4, 4), joint-to-world matrices. ``inverse_bind``: (J, 4, 4), world-to-joint
    matrices at bind time. Returns (J, 4, 4), bind-to-posed matrices.
    """
    return world @ inverse_bind


def rigid_sizes(palette: Floats) -> Floats:
    """Return the square s^2 of each joint's scale if it is uniform, and 0 for all other joints.

    ``palette``: (..., J, 4, 4), skinning matrices. Returns (..., J), s^2 if the 3 x 3 part A
    satisfies A^T A = s^2 I, and det A > 0.
    """
    linear = palette[..., :3, :3]
    gram = np.swapaxes(linear, -1, -2) @ linear
    squares = gram[..., 0, 0]
    errors = np.abs(gram - squares[..., None, None] * np.eye(3)).max(axis=(-2, -1))
    # A reflection also has orthogonal columns, but a negative determinant.
    # Its sign is found without the product, which may overflow.
    is_uniform = (errors <= _RIGID * squares) & (np.linalg.slogdet(linear).sign > 0.0)
    return np.where(is_uniform, squares, 0.0)


def are_alike(lowest: Floats, highest: Floats) -> Bools:
    """Return whether joints with a range of ``rigid_sizes`` only rotate, with one common scale."""
    alike: Bools = (lowest > 0.0) & (highest - lowest <= _RIGID * highest)
    return alike


def is_rigid(palette: Floats) -> Bools:
    """Return whether all joints only rotate and translate, up to one common uniform scale.

    ``palette``: (..., J, 4, 4), skinning matrices. The result is true if every 3 x 3 part A
    satisfies A^T A = s^2 I with one common s, and det A > 0.

    >>> palette = np.stack([np.eye(4)] * 2)
    >>> bool(is_rigid(palette)), bool(is_rigid(palette * np.array([2.0, 1.0, 1.0, 1.0])))
    (True, False)
    """
    sizes = rigid_sizes(palette)
    return are_alike(sizes.min(axis=-1, initial=np.inf), sizes.max(axis=-1, initial=0.0))
