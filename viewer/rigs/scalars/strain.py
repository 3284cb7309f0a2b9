"""Quantities of strain: relative change of edge lengths and triangle areas in a pose.

The posed mesh, without the figure's own scale, is compared with the shaped mesh in its
bind pose.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.figure import Figure
from viewer.rigs.memo import Memo
from viewer.rigs.mesh import bounding_box, box_size, triangle_areas
from viewer.rigs.scalars._inputs import Asked
from viewer.rigs.shape import shaped
from viewer.rigs.skinning import deform

# Minimum length of edges with a meaningful ratio, as a fraction of the figure's size.
_NO_LENGTH = 1e-9
_PERCENT = 100.0

_edges: Memo[Figure, Ints] = Memo()


def stretch(asked: Asked) -> Floats:
    """Return each vertex's largest change of edge length, 100 (posed / rest - 1) %: (V,)."""
    figure = asked.figure
    edges, changes = _edge_changes(asked)
    longest, shortest = np.zeros((2, figure.require_mesh().n_vertices))
    for end in edges.T:
        np.maximum.at(longest, end, changes)
        np.minimum.at(shortest, end, changes)
    return np.where(longest >= -shortest, longest, shortest)


def stretch_mean(asked: Asked) -> Floats:
    """Return the mean relative change of length of each vertex's edges: (V,), percent."""
    figure = asked.figure
    edges, changes = _edge_changes(asked)
    mesh = figure.require_mesh()
    ends = edges.ravel()
    counts = np.bincount(ends, minlength=mesh.n_vertices)
    totals = np.bincount(ends, np.repeat(changes, 2), mesh.n_vertices)
    return totals / np.maximum(counts, 1)


def area(asked: Asked) -> Floats:
    """Return the change of the area around each vertex, 100 (posed / rest - 1) %: (V,)."""
    figure = asked.figure
    mesh = figure.require_mesh()
    corners = mesh.triangles
    rest, posed = (
        np.bincount(
            corners.ravel(), np.repeat(triangle_areas(places, corners), 3), len(places)
        ).astype(np.float64, copy=False)
        for places in _rest_and_posed(asked)
    )
    has_area = rest > (_NO_LENGTH * box_size(bounding_box(mesh.positions))) ** 2
    ratio = np.divide(posed, rest, out=np.ones_like(rest), where=has_area)
    return _PERCENT * (ratio - 1.0)


def _edge_changes(asked: Asked) -> tuple[Ints, Floats]:
    """Return the edges of non-zero length, (E, 2), and their relative changes, percent."""
    edges = _edges.get(asked.figure, (), lambda: _edges_of(asked.figure))
    rest, posed = _rest_and_posed(asked)
    before, after = (
        np.linalg.norm(places[edges[:, 1]] - places[edges[:, 0]], axis=1)
        for places in (rest, posed)
    )
    has_length = before > _NO_LENGTH * box_size(bounding_box(rest))
    edges, before, after = edges[has_length], before[has_length], after[has_length]
    return edges, _PERCENT * (after / before - 1.0)


def _rest_and_posed(asked: Asked) -> tuple[Floats, Floats]:
    """Return the vertices in the bind pose, and as posed in a figure of scale 1."""
    assert asked.pose is not None  # required by the quantity
    rest = shaped(asked.figure, asked.pose.shape_weights).require_mesh()
    pose = replace(asked.pose, figure_scale=1.0)
    return rest.positions, deform(asked.figure, pose, asked.skinning)[0]


def _edges_of(figure: Figure) -> Ints:
    """Return the unique edges of the triangles: (E, 2) int32, the lower index first."""
    mesh = figure.require_mesh()
    corners = mesh.triangles
    pairs = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]])
    pairs.sort(axis=1)
    pairs = pairs[pairs[:, 0] != pairs[:, 1]].astype(np.int64)
    keys = np.unique(pairs[:, 0] * mesh.n_vertices + pairs[:, 1])
    return np.stack(np.divmod(keys, mesh.n_vertices), axis=1).astype(np.int32)
