"""Isotropic remeshing: split long edges, collapse short ones, flip for valence 6, relax.

Botsch and Kobbelt 2004, "A Remeshing Approach to Multiresolution Modeling", with each pass applied
to a whole set of independent edges. The mesh is one half, open along the plane x = 0.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix

from .shapes import Floats

Ints = np.ndarray
Sizing = Callable[[Floats], Floats]


@dataclass(slots=True)
class Edges:
    """Edges of a triangle mesh: end points (E, 2), their faces and opposite vertices (E, 2).

    A boundary edge has -1 as its second face and opposite vertex.
    """

    ends: Ints
    faces: Ints
    opposite: Ints

    @property
    def is_boundary(self) -> np.ndarray:
        """Return a mask of the edges with a single face."""
        return self.faces[:, 1] < 0


def find_edges(triangles: Ints) -> Edges:
    """Return the edges of an edge-manifold mesh."""
    directed = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    apex = np.concatenate([triangles[:, 2], triangles[:, 0], triangles[:, 1]])
    face = np.tile(np.arange(len(triangles)), 3)
    ends, inverse, counts = np.unique(
        np.sort(directed, axis=1), axis=0, return_inverse=True, return_counts=True
    )
    if counts.max() > 2:
        raise ValueError("an edge has more than two faces")
    order = np.argsort(inverse.ravel(), kind="stable")
    first = np.concatenate([[0], np.cumsum(counts)[:-1]])
    faces = np.full((len(ends), 2), -1)
    opposite = np.full((len(ends), 2), -1)
    faces[:, 0], opposite[:, 0] = face[order[first]], apex[order[first]]
    two = counts == 2
    faces[two, 1], opposite[two, 1] = face[order[first[two] + 1]], apex[order[first[two] + 1]]
    return Edges(ends, faces, opposite)


def face_normals(vertices: Floats, triangles: Ints) -> Floats:
    """Return normals (T, 3) whose length is twice the area."""
    a, b, c = (vertices[triangles[:, i]] for i in range(3))
    return np.cross(b - a, c - a)


def _relative_lengths(vertices: Floats, ends: Ints, size: Sizing) -> Floats:
    """Return edge lengths relative to the target length at their midpoints."""
    a, b = vertices[ends[:, 0]], vertices[ends[:, 1]]
    return np.linalg.norm(a - b, axis=1) / size(0.5 * (a + b))


def _adjacency(edges: Edges, n: int) -> csr_matrix:
    i, j = edges.ends.T
    ones = np.ones(2 * len(i))
    return coo_matrix((ones, (np.r_[i, j], np.r_[j, i])), shape=(n, n)).tocsr()


def split_long(vertices: Floats, triangles: Ints, size: Sizing) -> tuple[Floats, Ints]:
    """Halve edges that are the longest of their faces and exceed 4/3 of the target length."""
    edges = find_edges(triangles)
    ratio = _relative_lengths(vertices, edges.ends, size)
    longest = np.zeros(len(triangles) + 1)
    np.maximum.at(longest, edges.faces.ravel(), np.repeat(ratio, 2))
    longest[-1] = 0
    chosen = np.nonzero((ratio > 4 / 3) & (ratio >= longest[edges.faces].max(axis=1)))[0]
    new = len(vertices) + np.arange(len(chosen))
    vertices = np.concatenate([vertices, vertices[edges.ends[chosen]].mean(axis=1)])
    triangles, added = triangles.copy(), []
    for side in range(2):
        face = edges.faces[chosen, side]
        real = face >= 0
        face, middle, (a, b) = face[real], new[real], edges.ends[chosen][real].T
        other = triangles[face].copy()
        kept = triangles[face]
        kept[kept == b[:, None]] = middle[np.nonzero(kept == b[:, None])[0]]
        other[other == a[:, None]] = middle[np.nonzero(other == a[:, None])[0]]
        triangles[face] = kept
        added.append(other)
    return vertices, np.concatenate([triangles, *added])


def _independent(edges: Edges, candidates: Ints, ratio: Floats, n: int) -> Ints:
    """Choose candidates, shortest first, of which no two are adjacent to the same triangle."""
    rank = np.full(len(edges.ends), np.inf)
    # Ranks are spread by hashing, as sorted lengths alone would choose few edges per pass.
    scatter = (candidates * 2654435761 % 4294967296) / 4294967296
    rank[candidates] = np.round(ratio[candidates] * 4) + scatter
    near = np.full(n, np.inf)
    for column in range(2):
        np.minimum.at(near, edges.ends[:, column], rank)
    wide = near.copy()
    np.minimum.at(wide, edges.ends[:, 0], near[edges.ends[:, 1]])
    np.minimum.at(wide, edges.ends[:, 1], near[edges.ends[:, 0]])
    return candidates[rank[candidates] <= wide[edges.ends[candidates]].min(axis=1)]


def collapse_short(vertices: Floats, triangles: Ints, size: Sizing) -> tuple[Floats, Ints]:
    """Collapse edges shorter than 4/5 of the target length where the topology allows it."""
    n = len(vertices)
    edges = find_edges(triangles)
    ratio = _relative_lengths(vertices, edges.ends, size)
    on_rim = np.zeros(n, dtype=bool)
    on_rim[edges.ends[edges.is_boundary]] = True
    rims = on_rim[edges.ends].sum(axis=1)
    short = np.nonzero((ratio < 0.8) & ((rims < 2) | edges.is_boundary))[0]
    near = _adjacency(edges, n)
    a, b = edges.ends[short].T
    shared = np.asarray(near[a].multiply(near[b]).sum(axis=1)).ravel()
    short = short[shared == np.where(edges.is_boundary[short], 1, 2)]
    chosen = _independent(edges, short, ratio, n)
    before = face_normals(vertices, triangles)
    rim_edges = edges.ends[edges.is_boundary]
    flatness = np.linalg.norm(_vertex_normals(vertices, triangles), axis=1)
    for _ in range(8):
        target, moved = _merged(vertices, edges.ends[chosen], on_rim, flatness)
        after = face_normals(moved, target[triangles])
        kept = np.all(np.diff(np.sort(target[triangles], axis=1), axis=1) > 0, axis=1)
        lengths = np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)
        bad = kept & (np.einsum("ti,ti->t", before, after) < 0.3 * lengths)
        bad |= kept & _has_chord(target[triangles], on_rim, target[rim_edges])
        if not bad.any():
            break
        spoiled = np.zeros(n, dtype=bool)
        spoiled[triangles[bad]] = True
        chosen = chosen[~spoiled[edges.ends[chosen]].any(axis=1)]
    else:
        return vertices, triangles
    return drop_unused(moved, target[triangles][kept])


def _has_chord(triangles: Ints, on_rim: np.ndarray, rim_edges: Ints) -> np.ndarray:
    """Return triangles with an inner edge between rim vertices; mirroring gives it four faces."""
    n = len(on_rim)
    rim_edges = np.sort(rim_edges, axis=1)
    sides = np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2), axis=2)
    known = np.isin(sides[..., 0] * n + sides[..., 1], rim_edges[:, 0] * n + rim_edges[:, 1])
    return (on_rim[sides].all(axis=2) & ~known).any(axis=1)


def _vertex_normals(vertices: Floats, triangles: Ints) -> Floats:
    """Return area-weighted means of face normals (V, 3), shorter than 1 at pointed vertices."""
    faces = face_normals(vertices, triangles)
    areas = np.linalg.norm(faces, axis=1)
    total, area = np.zeros_like(vertices), np.full(len(vertices), 1e-15)
    for corner in range(3):
        np.add.at(total, triangles[:, corner], faces)
        np.add.at(area, triangles[:, corner], areas)
    return total / area[:, None]


def _merged(
    vertices: Floats, ends: Ints, on_rim: np.ndarray, flatness: Floats
) -> tuple[Ints, Floats]:
    """Return the vertex that each vertex is merged with, and the new positions.

    Rim vertices and pointed vertices are not moved: midpoints would wear down the tips.
    """
    target, moved = np.arange(len(vertices)), vertices.copy()
    keep, gone = ends.T
    pointed = flatness[keep] - flatness[gone] > 0.03
    swap = np.where(on_rim[gone] == on_rim[keep], pointed, on_rim[gone])
    keep, gone = np.where(swap, gone, keep), np.where(swap, keep, gone)
    target[gone] = keep
    middle = 0.5 * (vertices[keep] + vertices[gone])
    stays = (on_rim[keep] & ~on_rim[gone]) | (flatness[gone] - flatness[keep] > 0.03)
    moved[keep] = np.where(stays[:, None], vertices[keep], middle)
    return target, moved


def drop_unused(vertices: Floats, triangles: Ints) -> tuple[Floats, Ints]:
    """Remove vertices that no triangle uses."""
    used, inverse = np.unique(triangles, return_inverse=True)
    return vertices[used], inverse.reshape(-1, 3)


def flip_for_valence(vertices: Floats, triangles: Ints) -> Ints:
    """Flip edges if that brings the four valences closer to 6 (4 on the rim)."""
    edges = find_edges(triangles)
    n = len(vertices)
    valence = np.bincount(edges.ends.ravel(), minlength=n)
    on_rim = np.zeros(n, dtype=bool)
    on_rim[edges.ends[edges.is_boundary]] = True
    excess = valence - np.where(on_rim, 4, 6)
    inner = np.nonzero(~edges.is_boundary)[0]
    (a, b), (c, d) = edges.ends[inner].T, edges.opposite[inner].T
    gain = 2 * (excess[a] + excess[b] - excess[c] - excess[d]) - 4
    near = _adjacency(edges, n)
    linked = np.asarray(near[c, d]).ravel() > 0
    possible = (gain > 0) & ~linked & ~(on_rim[c] & on_rim[d])
    possible &= _flip_is_safe(vertices, triangles, edges, inner)
    quad = np.stack([a, b, c, d], axis=1)[possible]
    rank = -gain[possible] + np.arange(possible.sum()) / max(possible.sum(), 1)
    best = np.full(n, np.inf)
    for column in range(4):
        np.minimum.at(best, quad[:, column], rank)
    chosen = inner[possible][rank <= best[quad].min(axis=1)]
    triangles = triangles.copy()
    new = _flipped(triangles, edges, chosen)
    triangles[edges.faces[chosen, 0]], triangles[edges.faces[chosen, 1]] = new
    return triangles


def _flipped(triangles: Ints, edges: Edges, chosen: Ints) -> tuple[Ints, Ints]:
    """Return the two triangles on the other diagonal, with the same winding."""
    first = triangles[edges.faces[chosen, 0]]
    c, d = edges.opposite[chosen].T
    start = np.argmax(first == c[:, None], axis=1)
    rows = np.arange(len(chosen))
    a, b = first[rows, (start + 1) % 3], first[rows, (start + 2) % 3]
    return np.stack([c, a, d], axis=1), np.stack([c, d, b], axis=1)


def _flip_is_safe(vertices: Floats, triangles: Ints, edges: Edges, inner: Ints) -> np.ndarray:
    """Return a mask of the flips after which both triangles still face the same way."""
    old = [face_normals(vertices, triangles[edges.faces[inner, i]]) for i in range(2)]
    new = [face_normals(vertices, t) for t in _flipped(triangles, edges, inner)]
    unit = [v / np.maximum(np.linalg.norm(v, axis=1, keepdims=True), 1e-15) for v in (*old, *new)]
    safe = np.ones(len(inner), dtype=bool)
    for i in range(2):
        for j in (2, 3):
            safe &= np.einsum("ni,ni->n", unit[i], unit[j]) > 0.8
    return safe


def relax(vertices: Floats, triangles: Ints, size: Sizing, project: Callable) -> Floats:
    """Move each vertex towards the weighted mean of its neighbours, then onto the surface."""
    edges = find_edges(triangles)
    rim_edges = edges.ends[edges.is_boundary]
    on_rim = np.zeros(len(vertices), dtype=bool)
    on_rim[rim_edges] = True
    used = edges.ends[~on_rim[edges.ends].any(axis=1) | ~edges.is_boundary]
    total, weight = np.zeros_like(vertices), np.zeros(len(vertices))
    for pairs, rim in ((used, False), (rim_edges, True)):
        for i, j in (pairs.T, pairs.T[::-1]):
            chosen = on_rim[i] == rim
            w = 1 / size(0.5 * (vertices[i] + vertices[j]))[chosen]
            np.add.at(total, i[chosen], w[:, None] * vertices[j[chosen]])
            np.add.at(weight, i[chosen], w)
    pull = total / np.maximum(weight, 1e-12)[:, None] - vertices
    pull[weight == 0] = 0
    normals = _vertex_normals(vertices, triangles)
    normals[on_rim, 0] = 0
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    pull -= np.einsum("vi,vi->v", pull, normals)[:, None] * normals
    moved = vertices + 0.6 * pull
    moved[on_rim, 0] = 0
    moved = project(moved)
    moved[on_rim, 0] = 0
    return moved


def remesh(
    vertices: Floats, triangles: Ints, size: Sizing, project: Callable
) -> tuple[Floats, Ints]:
    """Coarsen a fine mesh to the target edge lengths, then make it uniform."""
    for _ in range(80):
        before = len(vertices)
        vertices, triangles = collapse_short(vertices, triangles, size)
        if len(vertices) % 3 == 0:
            triangles = flip_for_valence(vertices, triangles)
        if len(vertices) > 0.995 * before:
            break
    for _ in range(14):
        for _ in range(3):
            vertices, triangles = split_long(vertices, triangles, size)
        for _ in range(6):
            vertices, triangles = collapse_short(vertices, triangles, size)
        for _ in range(4):
            triangles = flip_for_valence(vertices, triangles)
        for _ in range(2):
            vertices = relax(vertices, triangles, size, project)
    for _ in range(6):
        triangles = flip_for_valence(vertices, triangles)
        vertices = relax(vertices, triangles, size, project)
    return vertices, triangles
