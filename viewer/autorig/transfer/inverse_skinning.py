"""Inverse skinning: transformation of a posed mesh to rest by inverse blended matrices."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from viewer.autorig.surface.laplacian import neighbour_means
from viewer.autorig.surface.welding import edges, weld
from viewer.data_classes import dataclass
from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.geometry.rotation import nearest_rotations
from viewer.rigs.skin import Skin
from viewer.rigs.skinning.lbs import blended_matrices

if TYPE_CHECKING:
    from scipy.sparse import bsr_array, csr_array

SMALLEST_STRETCH = 0.2
"""Singular value below which a blended matrix is treated as singular: with equal weights, two
joints rotated apart by an angle a have the value cos(a / 2), and here a = 157 degrees."""

_RINGS = 2  # number of rings of vertices around guarded ones that may move to repair a tear
_SMOOTH = 0.01  # weight of smoothness relative to reproducing the pose when a tear is repaired


@dataclass(frozen=True, slots=True, eq=False)
class InvertedSkinning:
    """A mesh at rest, with the matrices that pose it."""

    positions: Floats
    """(V, 3). Positions in the bind pose; pose correctives are still included."""
    matrices: Floats
    """(V, 3, 4). The matrix that poses each vertex."""
    guarded: Bools
    """(V,) bool. Vertices whose matrix is nearly singular: the inverse of the nearest rotation is
    used instead, so posing does not reproduce them exactly."""


def invert_skinning(positions: Floats, skin: Skin, palette: Floats) -> InvertedSkinning:
    """Undo linear blend skinning: rest = B^-1 (t - d), with sum_j w_j A_j = [B | d]."""
    matrices = blended_matrices(skin, palette)
    linear = matrices[:, :, :3]
    guarded = _is_singular(linear)
    # Dividing by a tiny singular value would tear the mesh; the nearest rotation (polar factor)
    # replaces such a matrix. A vertex without influences has the identity.
    inverted = linear.copy()
    if guarded.any():
        inverted[guarded] = nearest_rotations(linear[guarded])[0]
    steps = positions - matrices[:, :, 3]
    rest = np.asarray(np.linalg.solve(inverted, steps[..., None])[..., 0], dtype=np.float64)
    return InvertedSkinning(rest, matrices, guarded)


def _is_singular(linear: Floats) -> Bools:
    """Return the matrices whose smallest singular value is too small: (V,) bool."""
    squares = np.einsum("vab,vab->v", linear, linear)
    # As |det| = s1 s2 s3 and s1 s2 <= (s1^2 + s2^2) / 2 <= |B|^2 / 2, s3 >= 2 |det| / |B|^2;
    # singular values are computed only if that bound is inconclusive.
    bound = 2.0 * np.abs(np.linalg.det(linear)) / np.where(squares > 0.0, squares, 1.0)
    doubtful = np.flatnonzero(bound < SMALLEST_STRETCH)
    singular = np.zeros(len(linear), dtype=np.bool_)
    if len(doubtful):
        values = np.linalg.svd(linear[doubtful], compute_uv=False)
        singular[doubtful] = values[:, 2] < SMALLEST_STRETCH
    return singular


def repair_tears(inverted: InvertedSkinning, posed: Floats, triangles: Ints) -> Floats:
    """Smooth guarded vertices by least squares; others keep their rest positions (V, 3)."""
    if not inverted.guarded.any():
        return inverted.positions
    from scipy import sparse

    welded = weld(inverted.positions, triangles)
    count = len(welded.positions)
    links = edges(welded.triangles)
    free = np.zeros(count, dtype=np.bool_)
    free[welded.vertices[inverted.guarded]] = True
    for _ in range(_RINGS):
        touched = links[free[links].any(axis=1)]
        free[touched.ravel()] = True
    own = np.flatnonzero(free)
    # Minimise sum_v |B_v x_v + d_v - t_v|^2 + lambda |L x|^2 over the guarded vertices and their
    # two-ring, with all others fixed, the graph Laplacian L and lambda = 0.01. The problem is
    # linear in x: (B^T B + lambda L^T L) x = B^T (t - d).
    laplacian = _laplacian(count, links)
    normal, right = _normal_equations(inverted, posed, welded.vertices, free)
    # The Laplacian acts on each coordinate separately, hence the Kronecker product.
    smooth = sparse.kron(laplacian.T @ laplacian, sparse.diags_array(np.ones(3)))
    dof = (3 * own[:, None] + np.arange(3)).ravel()
    fixed = np.setdiff1d(np.arange(3 * count), dof)
    smooth = sparse.csr_array(smooth)[dof]
    places = welded.positions.ravel()
    system = sparse.csc_array(normal + _SMOOTH * smooth[:, dof])
    from scipy.sparse import linalg

    solved = linalg.spsolve(
        # Fixed vertices are known and move to the right-hand side.
        system,
        right - _SMOOTH * (smooth[:, fixed] @ places[fixed]),
    )
    moved = inverted.positions.copy()
    result = welded.positions.copy()
    result[own] = solved.reshape(-1, 3)
    inside = free[welded.vertices]
    moved[inside] = result[welded.vertices[inside]]
    return moved


def _laplacian(count: int, links: Ints) -> csr_array:
    """Return the graph Laplacian: each vertex minus the mean of its neighbours."""
    from scipy import sparse

    means = neighbour_means(links, count)
    return sparse.csr_array(sparse.diags_array(1.0 * (np.diff(means.indptr) > 0)) - means)


def _normal_equations(
    inverted: InvertedSkinning, posed: Floats, welded: Ints, free: Bools
) -> tuple[bsr_array, Floats]:
    """Return the blocks B^T B, and B^T (t - d), summed over coincident vertices."""
    number = np.cumsum(free) - 1
    inside = np.flatnonzero(free[welded])
    rows = number[welded[inside]]
    linear = inverted.matrices[inside, :, :3]
    steps = posed[inside] - inverted.matrices[inside, :, 3]
    blocks = np.zeros((int(free.sum()), 3, 3))
    right = np.zeros((len(blocks), 3))
    np.add.at(blocks, rows, np.swapaxes(linear, 1, 2) @ linear)
    np.add.at(right, rows, np.einsum("vab,va->vb", linear, steps))
    starts = np.arange(len(blocks) + 1)
    from scipy import sparse

    matrix = sparse.bsr_array((blocks, starts[:-1], starts))
    return matrix, right.ravel()
