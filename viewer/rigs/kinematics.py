"""Forward kinematics: from local matrices to world matrices to skinning matrices."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.geometry.transform import affine_matrices
from viewer.rigs.hierarchy import depth_first
from viewer.rigs.memo import Memo
from viewer.rigs.pose import Pose, PosedSkeleton, joint_rotations, local_transforms, zero_pose
from viewer.rigs.skeleton import Skeleton

if TYPE_CHECKING:
    from viewer.rigs.skin import Skin

# Relative tolerance of A^T A = s^2 I. Treating a matrix within this tolerance as rigid rotates
# normals by at most half of it, in radians.
_RIGID = 1e-5
_MOST_JOINTS = 4096  # maximum number of joints of hierarchies whose passes are cached

Indices = NDArray[np.intp]
_bind_sizes: Memo[Skin, Floats] = Memo()


def forward_kinematics(parents: Ints, local: Floats) -> Floats:
    """Concatenate local matrices (J, n, n) down the hierarchy: W[j] = W[parent[j]] @ L[j].

    >>> local = np.stack([np.eye(4)] * 2)
    >>> local[:, 0, 3] = 2.0, 1.0
    >>> float(forward_kinematics(np.array([-1, 0]), local)[1, 0, 3])
    3.0
    """
    world = local.copy()
    parents = np.asarray(parents, dtype=np.int32)
    # Pointer doubling: every pass multiplies each joint's matrix by the matrix of the ancestor to
    # which it points, and adopts that ancestor's pointer, so a chain of n joints takes log2(n)
    # passes (Hillis and Steele 1986).
    is_kept = len(parents) <= _MOST_JOINTS
    for above, below in _kept_passes(parents.tobytes()) if is_kept else _passes(parents):
        world[below] = world[above] @ world[below]
    return world


def joint_worlds(parents: Ints, linear: Floats, offsets: Floats) -> Floats:
    """Return joint-to-figure matrices (J, 4, 4) or (F, J, 4, 4) of local 3 x 3 maps and offsets."""
    shape = np.broadcast_shapes(linear.shape[:-2], offsets.shape[:-1])
    if len(shape) == 1:
        return forward_kinematics(parents, affine_matrices(linear, offsets))
    # Columns and rows of each joint, (J, 4, 4, F): the numbers of all poses lie together.
    linear = np.broadcast_to(linear, (*shape, 3, 3)).transpose(1, 3, 2, 0)
    offsets = np.broadcast_to(offsets, (*shape, 3)).transpose(1, 2, 0)
    world = np.empty((shape[1], 4, 4, shape[0]))
    local = np.empty(world.shape[1:])  # of one joint: the processor's cache keeps it
    world[:, :, 3] = local[:, 3] = [[0.0], [0.0], [0.0], [1.0]]
    # Nodes of files may be listed before their parents.
    is_sorted = (parents < np.arange(len(parents))).all()
    for joint in range(len(parents)) if is_sorted else depth_first(parents).tolist():
        parent = parents[joint]
        local[:3, :3], local[3, :3] = linear[joint], offsets[joint]
        if parent < 0:
            world[joint] = local
        else:
            rows = world[joint, :, :3]
            np.einsum("kif,ckf->cif", world[parent, :, :3], local, out=rows)
    return world.transpose(3, 0, 2, 1)


def world_rotations(parents: Ints, local: Floats) -> Floats:
    """Concatenate rotations (J, 3, 3) of one pose down the hierarchy."""
    return forward_kinematics(parents, local)


def rest_world_rotations(skeleton: Skeleton) -> Floats:
    """Return the world rotations of all joints with DOFs at 0: (J, 3, 3)."""
    return world_rotations(skeleton.parents, joint_rotations(skeleton, zero_pose(skeleton)))


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
    """Return the joint-to-figure matrices (J, 4, 4) of a pose."""
    pose.check_fits(skeleton)
    turns = joint_rotations(skeleton, pose)
    parts = local_transforms(skeleton, turns, pose.dofs, pose.translations, pose.scales)
    return joint_worlds(skeleton.parents, *parts)


def posed_skeleton(skeleton: Skeleton, pose: Pose) -> PosedSkeleton:
    """Return the read-only world and skinning matrices of a pose, cached until it changes."""
    known, key = pose.posed, pose.skinning_key
    if known is None or known.skeleton is not skeleton or known.key is not key:
        known = pose.posed = PosedSkeleton(skeleton, key, world_matrices(skeleton, pose))
    return known


def is_posed(skeleton: Skeleton, pose: Pose) -> bool:
    """Return whether the ``posed_skeleton`` that a pose has stored is up to date."""
    known = pose.posed
    return known is not None and known.skeleton is skeleton and known.key is pose.skinning_key


def skinning_matrices(world: Floats, inverse_bind: Floats) -> Floats:
    """Return skinning matrices, ([F,] J, 4, 4), bind to posed: M[j] = W[j] inverse(B[j])."""
    if world.ndim == 3:
        return world @ inverse_bind
    # The columns of a joint in all poses are the rows of one product: M^T = inverse(B)^T W^T.
    columns = world.transpose(1, 3, 2, 0)
    found = np.swapaxes(inverse_bind, 1, 2) @ columns.reshape(*columns.shape[:2], -1)
    return found.reshape(columns.shape).transpose(3, 0, 2, 1)


def rigid_sizes(palette: Floats) -> Floats:
    """Return s^2 (..., J) of joints with A^T A = s^2 I and det A > 0, and 0 for all others."""
    # Products of contiguous matrices take a fifth of the time of products of views.
    linear = np.ascontiguousarray(palette[..., :3, :3])
    gram = np.ascontiguousarray(np.swapaxes(linear, -1, -2)) @ linear
    squares = gram[..., 0, 0].copy()
    entries = gram.reshape(*squares.shape, 9)
    entries[..., ::4] -= squares[..., None]
    errors = np.abs(entries, out=entries).max(axis=-1)
    is_uniform = (errors <= _RIGID * squares) & (squares > 0.0)
    # A reflection also has orthogonal columns, but a negative determinant. Divided by s, so that
    # the product does not overflow, the matrix has a determinant near 1 or -1.
    linear /= np.sqrt(np.where(is_uniform, squares, 1.0))[..., None, None]
    (a, b, c), (d, e, f), (g, h, i) = np.moveaxis(linear, (-2, -1), (0, 1))
    with np.errstate(over="ignore", invalid="ignore"):  # of matrices that are not uniform
        is_uniform &= a * (e * i - f * h) + b * (f * g - d * i) + c * (d * h - e * g) > 0.0
    return np.where(is_uniform, squares, 0.0)


def palette_sizes(skin: Skin, scales: Floats, palette: Floats) -> Floats:
    """Return ``rigid_sizes`` of skinning matrices (..., J, 4, 4) of poses with local scales."""
    if not (scales == 1.0).all():
        return rigid_sizes(palette)
    # Products of rotations and the bind matrices are as large as these.
    return _bind_sizes.get(skin, None, lambda: rigid_sizes(skin.inverse_bind))


def are_alike(lowest: Floats, highest: Floats) -> Bools:
    """Return whether joints with a range of ``rigid_sizes`` only rotate, with one common scale."""
    alike: Bools = (lowest > 0.0) & (highest - lowest <= _RIGID * highest)
    return alike


def are_rigid(sizes: Floats) -> Bools:
    """Return whether all joints of ``rigid_sizes`` (..., J) only rotate, with one common scale."""
    return are_alike(sizes.min(axis=-1, initial=np.inf), sizes.max(axis=-1, initial=0.0))
