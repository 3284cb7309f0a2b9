"""Laplace operators of triangle meshes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from viewer.autorig.surface.welding import Welded, edges
from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.geometry.topology import edges_of

if TYPE_CHECKING:
    from scipy.sparse import csr_array

# Cotangent of 0.6 degrees; triangles with smaller angles are treated as equilateral.
_STEEPEST = 100.0
_FLAT = 1e-12  # minimum of twice a triangle's area over its squared longest edge
_EVEN = 1.0 / np.sqrt(3.0)  # cotangent of 60 degrees
_LIGHTEST = 1e-9  # minimum area of a vertex relative to the mean, as areas are divisors


def laplacian(mesh: Welded) -> tuple[csr_array, Floats]:
    """Return the Laplace operator of any mesh, sparse (W, W), and the area of each vertex (W,).

    The operator is symmetric and positive semidefinite and has no unit: scale the mesh to size 1 if
    areas are to be compared with it. Areas are at least 1e-9 of their mean; all 1 without area.
    """
    # Islands with non-manifold edges have no cotangent operator: they get the graph Laplacian of
    # their edges, and their vertices all have the mesh's mean area.
    crowded = mesh.triangles.ravel()[edges_of(mesh.triangles).counts > 2]
    broken = np.unique(mesh.islands[crowded])
    is_broken: Bools = np.isin(mesh.islands, broken)
    graph_like = is_broken[mesh.triangles[:, 0]]
    sound = mesh.triangles[~graph_like]
    operator = cotangent_laplacian(mesh.positions, sound)
    operator += graph_laplacian(len(mesh.positions), mesh.triangles[graph_like])
    areas = voronoi_areas(mesh.positions, mesh.triangles)
    positive = areas[areas > 0.0]
    mean = float(positive.mean()) if len(positive) else 1.0
    areas[is_broken] = mean
    return operator, np.maximum(areas, _LIGHTEST * mean if len(positive) else 1.0)


def cotangent_laplacian(positions: Floats, triangles: Ints) -> csr_array:
    """Return the cotangent Laplacian: L_ij = -(cot a + cot b) / 2 on edges, L_ii = -sum_j L_ij.

    a and b are the angles opposite to the edge (Pinkall and Polthier 1993); the sign is the
    opposite of the Laplacian in calculus. Sparse (V, V), dimensionless.
    """
    halves = 0.5 * _steady(_cotangents(positions, triangles))
    # The angle at corner k is opposite the edge between the other two corners.
    links = triangles[:, [1, 2, 2, 0, 0, 1]].reshape(-1, 2)
    return _from_edges(len(positions), links, halves.ravel())


def graph_laplacian(n_vertices: int, triangles: Ints) -> csr_array:
    """Return the Laplacian of the graph of edges: L_ij = -1, L_ii = number of neighbours."""
    links = edges(triangles)
    return _from_edges(n_vertices, links, np.ones(len(links)))


def voronoi_areas(positions: Floats, triangles: Ints) -> Floats:
    """Return the area of the surface nearest to each vertex (V,), "mixed" at obtuse angles."""
    # In a triangle without an obtuse angle, vertex a owns (|ab|^2 cot c + |ac|^2 cot b) / 8; in an
    # obtuse triangle, the obtuse corner owns half of the area and the others a quarter (Meyer et
    # al. 2003, fig. 4).
    cotangents = _cotangents(positions, triangles)
    corners = positions[triangles]
    # The edge opposite each corner.
    offsets = np.roll(corners, -1, axis=1) - np.roll(corners, 1, axis=1)
    squares = np.einsum("tka,tka->tk", offsets, offsets)
    fractions = squares * cotangents / 8.0
    parts = np.roll(fractions, 1, axis=1) + np.roll(fractions, -1, axis=1)
    area = 0.5 * np.linalg.norm(np.cross(offsets[:, 1], offsets[:, 2]), axis=1)
    obtuse: Bools = cotangents < 0.0
    is_obtuse: Bools = np.logical_or.reduce(obtuse, axis=1)
    parts = np.where(is_obtuse[:, None], np.where(obtuse, 0.5, 0.25) * area[:, None], parts)
    return np.bincount(triangles.ravel(), parts.ravel(), minlength=len(positions)).astype(float)


def _cotangents(positions: Floats, triangles: Ints) -> Floats:
    """Return the cotangent of the angle at each corner, (T, 3): u . v / |u x v|."""
    corners = positions[triangles]
    u = np.roll(corners, -1, axis=1) - corners
    v = np.roll(corners, 1, axis=1) - corners
    double = np.linalg.norm(np.cross(u[:, 0], v[:, 0]), axis=1)
    # Without area, the cotangents become very large, but stay finite.
    longest = np.einsum("tka,tka->tk", u, u).max(axis=1, initial=np.finfo(float).tiny)
    return np.einsum("tka,tka->tk", u, v) / np.maximum(double, _FLAT * longest)[:, None]


def _steady(cotangents: Floats) -> Floats:
    # A triangle with an angle below 0.6 degrees, or without area, is treated as equilateral: it
    # still connects its vertices, and the contribution of each triangle stays positive
    # semidefinite, which clamping large cotangents would not ensure.
    thin: Bools = np.abs(cotangents).max(axis=1, initial=0.0) > _STEEPEST
    return np.where(thin[:, None], _EVEN, cotangents)


def _from_edges(n_vertices: int, links: Ints, weights: Floats) -> csr_array:
    """Return the Laplacian of weighted edges (E, 2); weights of the same edge are summed."""
    from scipy import sparse

    a, b = links[:, 0], links[:, 1]
    shape = (n_vertices, n_vertices)
    matrix = sparse.csr_array(
        (np.concatenate([-weights, -weights]), (np.concatenate([a, b]), np.concatenate([b, a]))),
        shape=shape,
    )
    diagonal = np.asarray(-matrix.sum(axis=1)).ravel()
    return sparse.csr_array(matrix + sparse.diags_array(diagonal, shape=shape))


def neighbour_means(links: Ints, count: int) -> csr_array:
    """Return the matrix (V, V) that takes the mean of each vertex's neighbours, by edges (E, 2).

    Rows of vertices without neighbours are empty.
    """
    from scipy import sparse

    rows, columns = np.concatenate([links, links[:, ::-1]]).T
    degrees = np.bincount(rows, minlength=count)
    return sparse.csr_array((1.0 / degrees[rows], (rows, columns)), shape=(count, count))
