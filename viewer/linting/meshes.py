"""Checks of meshes: degenerate or flipped triangles, borders, edges, normals, stray vertices."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from viewer.diagnostics.codes import Severity
from viewer.linting._finding import Finding
from viewer.linting._subject import Indices, Subject
from viewer.linting._surface import surface_of
from viewer.phrases import agree, counted, rounded
from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.geometry.topology import (
    CLOSED,
    HOLLOW,
    Edges,
    components,
    edges_of,
    orientations,
    part_volumes,
)
from viewer.rigs.geometry.vectors import unit
from viewer.rigs.inspection.faults import stray_vertices
from viewer.rigs.mesh import Mesh, area_vectors, flat_triangles

_UNIT = 0.01  # deviation of a normal's length from 1
_ZERO = 1e-12  # maximum length of a zero normal
_AGAINST = -0.1  # cosine to the triangle's normal: perpendicular normals are smoothed over an edge
_FEW = 0.01  # fraction of triangles or normals up to which faults are too few to be seen


def check(subject: Subject) -> Iterator[Finding]:
    """Check the mesh of a figure."""
    mesh = subject.actor.figure.mesh
    if mesh is None:
        return
    yield from _normals(subject, mesh)
    yield from _vertices(subject, mesh)
    whole = subject.valid("triangles", mesh.n_triangles)
    if not whole.any():
        return
    known = subject.valid("positions", mesh.n_vertices)[mesh.triangles].all(axis=1) & whole
    flat = flat_triangles(mesh) & known
    valid = np.flatnonzero(~flat & whole)
    # Degenerate triangles have neither neighbours nor an orientation.
    place = surface_of(subject.actor.figure).place
    corners = place[mesh.triangles[valid]]
    yield from _against(subject, mesh, np.flatnonzero(~flat & known), place)
    yield from _flat(subject, flat)
    yield from _duplicate_triangles(subject, mesh, np.flatnonzero(whole))
    yield from _crowded_edges(subject, mesh, np.flatnonzero(whole))
    yield from _sides(subject, mesh, valid, corners, known)


def _flat(subject: Subject, flat: Bools) -> Iterator[Finding]:
    triangles = np.flatnonzero(flat)
    if len(triangles) == 0:
        return
    yield subject.found(
        "M001.triangles: {n} zero area (first: triangle {triangle})",
        n=counted(len(triangles), "triangle", "has", "have", of=len(flat)),
        all=len(flat),
        triangle=int(triangles[0]),
        severity=_severity(len(triangles), len(flat)),
        triangles=triangles,
        at=("triangles", int(triangles[0])),
    )


def _severity(count: int, total: int) -> Severity:
    """Return the severity of small faults: a warning if they are more than very few."""
    return "warning" if count > _FEW * total else "note"


def _duplicate_triangles(subject: Subject, mesh: Mesh, whole: Indices) -> Iterator[Finding]:
    rows = np.sort(mesh.triangles[whole], axis=1).astype(np.int64)
    keys = (rows[:, 0] * mesh.n_vertices + rows[:, 1]) * mesh.n_vertices + rows[:, 2]
    if mesh.n_vertices > 2_000_000:  # the product of three indices would overflow
        keys = np.unique(rows, axis=0, return_inverse=True)[1].ravel()
    order = np.argsort(keys, kind="stable")
    copies = whole[np.sort(order[1:][np.diff(keys[order]) == 0])]
    if len(copies) == 0:
        return
    yield subject.found(
        "M011.triangles: {n} (first: triangle {triangle})",
        n=counted(len(copies), "duplicate triangle"),
        triangle=int(copies[0]),
        severity=_severity(len(copies), mesh.n_triangles),
        triangles=copies,
        at=("triangles", int(copies[0])),
    )


def _crowded_edges(subject: Subject, mesh: Mesh, whole: Indices) -> Iterator[Finding]:
    """Report non-manifold edges; vertices are not merged, because parts may touch."""
    edges = edges_of(mesh.triangles[whole].astype(np.int64))
    places = np.flatnonzero(edges.counts > 2)
    if len(places) == 0:
        return
    triangles = whole[np.unique(places // 3)]
    ends = np.unique(_edge_ends(mesh.triangles[whole], places), axis=0)
    vertices = np.unique(ends)
    yield subject.found(
        "M006.edges: {n} with up to {most} triangles (first: between vertices {vertex} and "
        "{other})",
        n=counted(len(ends), "non-manifold edge"),
        most=int(edges.counts.max()),
        vertex=int(ends[0, 0]),
        other=int(ends[0, 1]),
        severity=_severity(len(ends), mesh.n_triangles),
        triangles=triangles,
        vertices=vertices,
        at=("positions", int(ends[0, 0])),
    )


def _edge_ends(triangles: Ints, places: Indices) -> Indices:
    """Return the two vertices of edges, the smaller first: (N, 2); corner k starts edge 3 t + k."""
    rows, corners = np.divmod(places, 3)
    ends = np.stack([triangles[rows, corners], triangles[rows, (corners + 1) % 3]], axis=1)
    return np.sort(ends, axis=1).astype(np.int64)


def _sides(
    subject: Subject, mesh: Mesh, valid: Indices, corners: Indices, known: Bools
) -> Iterator[Finding]:
    """Report flipped triangles, inside-out or non-orientable components, and open borders."""
    edges = edges_of(corners)
    component, flipped, one_sided = orientations(len(corners), edges)
    flipped &= _are_joined(flipped, edges)
    if flipped.any():
        triangles = valid[flipped]
        yield subject.found(
            "M002.triangles: {n} neighbours (first: triangle {triangle})",
            n=counted(
                len(triangles),
                "triangle",
                "is wound opposite to its",
                "are wound opposite to their",
                of=mesh.n_triangles,
            ),
            all=mesh.n_triangles,
            triangle=int(triangles[0]),
            triangles=triangles,
            at=("triangles", int(triangles[0])),
        )
    if one_sided.any():
        triangles = valid[one_sided]
        yield subject.found(
            "M012.surface: non-orientable surface of {n} (at triangle {triangle})",
            n=counted(len(triangles), "triangle"),
            triangle=int(triangles[0]),
            triangles=triangles,
            at=("triangles", int(triangles[0])),
        )
    unsure = _beside_lost(subject, mesh)[mesh.triangles[valid]]
    border = (edges.counts == 1) & ~(unsure | np.roll(unsure, -1, axis=1)).ravel()
    # Flipped triangles are reported already; components with missing data have no volume.
    signs = np.where(flipped, -1.0, 1.0) * known[valid]
    yield from _inside_out(subject, mesh, valid, component, signs, edges)
    yield from _borders(subject, mesh, valid, border)


def _are_joined(flipped: Bools, edges: Edges) -> Bools:
    """Return which triangles (T,) are of a flipped patch that the surface goes on around.

    Of a sheet that lies on another one, such as a badge on a shield, edges coincide with those of
    two other triangles, but for a few by chance.
    """
    both = edges.pairs[flipped[edges.pairs].all(axis=1) & edges.agree]
    patch = components(len(flipped), both)
    against = edges.pairs[(flipped[edges.pairs].sum(axis=1) == 1) & ~edges.agree]
    n_against = np.bincount(patch[against[flipped[against]]], minlength=len(flipped))
    crowded = np.flatnonzero(edges.counts > 2) // 3
    n_crowded = np.bincount(patch[crowded], minlength=len(flipped))
    joined: Bools = (n_against >= n_crowded)[patch]
    return joined


def _borders(subject: Subject, mesh: Mesh, valid: Indices, border: Bools) -> Iterator[Finding]:
    if not border.any():
        return
    ends = _edge_ends(mesh.triangles[valid], np.flatnonzero(border))
    vertices = np.unique(ends)
    first = ends[np.lexsort(ends.T[::-1])[0]]
    yield subject.found(
        "M005.edges: {n} (first: between vertices {vertex} and {other})",
        n=counted(len(ends), "boundary edge"),
        vertex=int(first[0]),
        other=int(first[1]),
        vertices=vertices,
        triangles=valid[np.unique(np.flatnonzero(border) // 3)],
        at=("positions", int(first[0])),
    )


def _beside_lost(subject: Subject, mesh: Mesh) -> Bools:
    """Return vertices with missing triangles, or whose coincident copies are unknown: (V,)."""
    lost = ~subject.valid("positions", mesh.n_vertices)
    lost[mesh.triangles[~subject.valid("triangles", mesh.n_triangles)]] = True
    return lost


def _inside_out(
    subject: Subject,
    mesh: Mesh,
    valid: Indices,
    component: Indices,
    signs: Floats,
    edges: Edges,
) -> Iterator[Finding]:
    """Report closed components with negative volume, sum a . (b x c) / 6.

    With them, open ones are reported whose normals oppose their winding.
    """
    corners = mesh.positions[mesh.triangles[valid]]
    volumes, areas, members = part_volumes(corners, component, len(valid), signs)
    # Missing triangles do not close a surface, because it may have had a border there.
    is_known = signs != 0.0
    alone = np.flatnonzero(np.repeat(is_known, 3) & (edges.counts == 1)) // 3
    beside = edges.pairs[is_known[edges.pairs].sum(axis=1) == 1, 0]
    owners = component[np.concatenate([alone, beside])]
    is_closed = np.bincount(owners, minlength=len(valid)) ** 2 <= CLOSED * members
    wrong = np.flatnonzero((volumes < -HOLLOW * areas**1.5) & is_closed & (members >= 4))
    if len(wrong) == 0:
        return
    facing = signs[:, None] * area_vectors(mesh.positions, mesh.triangles[valid])
    agreement = np.einsum("ta,tka->t", facing, mesh.normals[mesh.triangles[valid]])
    opposed = np.bincount(component, agreement, minlength=len(valid)) < 0.0
    n_closed, wrong = len(wrong), np.union1d(wrong, np.flatnonzero(opposed & ~is_closed))
    triangles = valid[np.isin(component, wrong)]
    yield subject.found(
        "M003.parts: {n} with {n_triangles} {are} inside out (first: triangle {triangle})",
        n=counted(len(wrong), "closed part" if len(wrong) == n_closed else "part"),
        n_triangles=counted(len(triangles), "triangle"),
        triangle=int(triangles[0]),
        triangles=triangles,
        at=("triangles", int(triangles[0])),
        are=agree(len(wrong), "is", "are"),
    )


def _normals(subject: Subject, mesh: Mesh) -> Iterator[Finding]:
    lengths = np.linalg.norm(mesh.normals, axis=1)
    zero = np.flatnonzero(lengths < _ZERO)
    if len(zero):
        yield subject.found(
            "M007.normals: {n} zero length (first: vertex {vertex})",
            n=counted(len(zero), "normal", "has", "have"),
            vertex=int(zero[0]),
            vertices=zero,
            at=("normals", int(zero[0])),
        )
    odd = np.flatnonzero((np.abs(lengths - 1.0) > _UNIT) & (lengths >= _ZERO))
    if len(odd):
        odd = odd[np.argsort(-np.abs(lengths[odd] - 1.0), kind="stable")]
        yield subject.found(
            "M008.normals: {n} not unit length (worst: {length} at vertex {vertex})",
            n=counted(len(odd), "normal", "is", "are"),
            vertex=int(odd[0]),
            length=rounded(float(lengths[odd[0]]), 4),
            vertices=odd,
            at=("normals", int(odd[0])),
        )


def _against(subject: Subject, mesh: Mesh, valid: Indices, place: Indices) -> Iterator[Finding]:
    """Report normals that point to the opposite side of all triangles at their vertex."""
    corners = mesh.triangles[valid]
    facing = unit(area_vectors(mesh.positions, corners))
    cosines = np.einsum("tka,ta->tk", unit(mesh.normals)[corners], facing)
    places, count = corners.ravel(), mesh.n_vertices
    numbers = np.bincount(places, minlength=count)
    opposed = np.bincount(places, cosines.ravel() < _AGAINST, minlength=count)
    # If triangles are missing, one of them may have agreed.
    against = np.flatnonzero((numbers > 0) & (opposed == numbers) & ~_beside_lost(subject, mesh))
    if len(against):
        # Along a hard edge or a seam, vertices at one place have separate normals, and artists give
        # one side the mean of all: such a normal agrees with the surface as a whole.
        around = _mean_normals(mesh, valid, place)
        agrees = np.einsum("va,va->v", mesh.normals[against], around[against]) > -_AGAINST
        against = against[~agrees]
    if len(against) == 0:
        return
    yield subject.found(
        "M009.normals: {n} the winding of all adjacent triangles (first: vertex {vertex})",
        n=counted(len(against), "normal", "opposes", "oppose", of=int((numbers > 0).sum())),
        all=int((numbers > 0).sum()),
        vertex=int(against[0]),
        severity=_severity(len(against), int((numbers > 0).sum())),
        vertices=against,
        at=("normals", int(against[0])),
    )


def _mean_normals(mesh: Mesh, valid: Indices, place: Indices) -> Floats:
    """Return the area-weighted normal of all triangles at each vertex's position: (V, 3)."""
    corners = mesh.triangles[valid]
    areas, where = area_vectors(mesh.positions, corners), place[corners].ravel()
    sums = [np.bincount(where, np.repeat(areas[:, axis], 3), mesh.n_vertices) for axis in range(3)]
    return unit(np.stack(sums, axis=1))[place]


def _vertices(subject: Subject, mesh: Mesh) -> Iterator[Finding]:
    is_used = np.zeros(mesh.n_vertices, dtype=np.bool_)
    is_used[mesh.triangles] = True
    unused = np.flatnonzero(~is_used)
    if len(unused):
        yield subject.found(
            "M004.vertices: {n} not used by any triangle (first: vertex {vertex})",
            n=counted(len(unused), "vertex", "is", "are", of=mesh.n_vertices),
            all=mesh.n_vertices,
            vertex=int(unused[0]),
            vertices=unused,
            at=("positions", int(unused[0])),
        )
    yield from subject.faults(stray_vertices(subject.actor.figure))
