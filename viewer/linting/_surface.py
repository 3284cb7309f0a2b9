"""Surface of a mesh without seams, and the skin on it, for checks of weights."""

from __future__ import annotations

import numpy as np

from viewer.data_classes import dataclass
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.topology import Indices, sides_of, welded
from viewer.rigs.geometry.vectors import lengths_of
from viewer.rigs.memo import Memo
from viewer.rigs.mesh import Mesh
from viewer.rigs.skin import Skin, merged, normalized, owners, stated_weights

LEAST = 0.01
"""Smallest weight that is seen."""
FEWEST = 100
"""Minimum number of vertices with weights: fewer are too coarse to show what is usual."""

_surfaces: Memo[Figure, Surface] = Memo()
_supports: Memo[Figure, Support] = Memo()


@dataclass(frozen=True, slots=True, eq=False)
class Surface:
    """Edges between places: vertices at one position are one place, named by the first of them."""

    place: Indices
    """(V,): place of each vertex."""
    edges: Indices
    """(E, 2): both directions of each edge between places, sorted by the first."""


def surface_of(figure: Figure) -> Surface:
    """Return the surface of a figure's mesh, which is kept as long as the figure."""
    return _surfaces.get(figure, (), lambda: _surface(figure.require_mesh()))


def _surface(mesh: Mesh) -> Surface:
    place = welded(mesh.positions, np.arange(mesh.n_vertices, dtype=np.int32))
    corners = place[mesh.triangles]
    start, end = sides_of(corners).reshape(-1, 2).T
    count = np.int64(max(mesh.n_vertices, 1))
    # Of millions of integers, numpy.unique takes several times as long as sorting.
    keys = np.sort(np.concatenate([start * count + end, end * count + start]))
    keys = keys[np.diff(keys, prepend=-1) > 0]
    edges = np.stack(np.divmod(keys, count), axis=1)
    return Surface(place, edges[edges[:, 0] != edges[:, 1]])


@dataclass(frozen=True, slots=True, eq=False)
class Support:
    """Where the joints of a skin have weights that count, on the surface of its mesh."""

    vertices: Indices
    joints: Indices
    weights: Floats
    """(N,) each. Influences, merged and normalised, sorted by vertex, then by joint."""
    node: Indices
    """(N,): row of the influence of the vertex's place in the following arrays."""
    places: Indices
    place_joints: Indices
    place_weights: Floats
    """(M,) each. Influences of places, sorted by place, then by joint."""
    links: Indices
    """(L, 2): rows of the two ends of edges at which one joint has weights."""


def support_of(figure: Figure) -> Support:
    """Return the influences of a figure's skin on its surface, kept as long as the figure."""
    return _supports.get(figure, (), lambda: _support(figure.require_skin(), surface_of(figure)))


def _support(skin: Skin, surface: Surface) -> Support:
    whole = normalized(merged(stated_weights(skin)))
    used = np.flatnonzero(whole.weights >= LEAST)
    vertices, joints = owners(whole)[used].astype(np.int64), whole.joints[used].astype(np.int64)
    order = np.argsort(vertices * skin.n_joints + joints, kind="stable")
    vertices, joints, weights = vertices[order], joints[order], whole.weights[used][order]
    keys = surface.place[vertices] * skin.n_joints + joints
    distinct, node = np.unique(keys, return_inverse=True)
    place, joint = np.divmod(distinct, skin.n_joints)
    heights = np.zeros(len(distinct))
    np.maximum.at(heights, node, weights)
    # Each influence at the start of an edge is looked up at its end.
    first = np.searchsorted(surface.edges[:, 0], place, side="left")
    counts = np.searchsorted(surface.edges[:, 0], place, side="right") - first
    starts = np.repeat(np.arange(len(distinct)), counts)
    within = np.arange(len(starts)) - np.repeat(np.cumsum(counts) - counts, counts)
    ends = surface.edges[np.repeat(first, counts) + within, 1]
    wanted = ends * skin.n_joints + joint[starts]
    at = np.minimum(np.searchsorted(distinct, wanted), max(len(distinct) - 1, 0))
    shared = distinct[at] == wanted
    links = np.stack([starts[shared], at[shared]], axis=1)
    return Support(vertices, joints, weights, node, place, joint, heights, links)


def bone_distances(places: Floats, parents: Ints, points: Floats, joints: Indices) -> Floats:
    """Return the distance of each point (N, 3) from the bones of its joint: (N,).

    ``places``: (J, 3), positions of the joints. The bones of a joint run to its children; a joint
    without children is a point.
    """
    result = lengths_of(points - places[joints])
    children = np.argsort(parents, kind="stable")
    children = children[parents[children] >= 0]
    counts = np.bincount(parents[children], minlength=len(parents))
    first = np.concatenate([[0], np.cumsum(counts)])
    for number in range(int(counts.max(initial=0))):
        rows = np.flatnonzero(counts[joints] > number)
        ends = children[first[joints[rows]] + number]
        start, along = places[joints[rows]], places[ends] - places[joints[rows]]
        lengths = np.maximum(np.einsum("na,na->n", along, along), 1e-30)
        part = np.einsum("na,na->n", points[rows] - start, along) / lengths
        nearest = start + np.clip(part, 0.0, 1.0)[:, None] * along
        result[rows] = np.minimum(result[rows], lengths_of(points[rows] - nearest))
    return result
