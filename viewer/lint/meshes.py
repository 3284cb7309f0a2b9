"""Meshes: triangles that are flat or flipped, borders, edges, normals, vertices out of place."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from viewer.errors import counted
from viewer.lint._finding import Finding, Subject
from viewer.lint._topology import Edges, edges_of, orientations, welded
from viewer.rig.arrays import Bools, Floats, Ints
from viewer.rig.geometry.vectors import unit
from viewer.rig.mesh import Mesh, triangle_areas

__all__ = ["check"]

Indices = NDArray[np.int64]

_FLAT = 1e-7  # height of a triangle relative to the mesh: the rounding of float32
_UNIT = 0.01  # of a normal's length from 1
_ZERO = 1e-12  # of a normal's length
_AGAINST = -0.1  # cosine to a triangle's own normal: those across it are smoothed over an edge
_CLOSED = 0.25  # border edges squared, by triangles: holes up to this leave a volume its sign
# Times the median distance of vertices from their median: feet are 16 times as far in models
# with half of their vertices in the face.
_FAR = 40.0
_SAMPLE = 4096  # vertices that tell where the others are


def check(subject: Subject) -> list[Finding]:
    """Look at the mesh of a figure."""
    mesh = subject.actor.figure.mesh
    if mesh is None:
        return []
    findings = [*_normals(subject, mesh), *_vertices(subject, mesh)]
    whole = subject.sound("triangles", mesh.n_triangles)
    if not whole.any():
        return findings
    known = subject.sound("positions", mesh.n_vertices)[mesh.triangles].all(axis=1) & whole
    flat = (_heights(mesh) <= _FLAT * _typical(mesh)[1]) & known
    sound = np.flatnonzero(~flat & whole)
    # What has no area has no neighbours and no sides either.
    corners = welded(mesh.positions, mesh.triangles)[sound]
    return [
        *findings,
        *_against(subject, mesh, np.flatnonzero(~flat & known)),
        *_flat(subject, flat),
        *_doubled(subject, mesh, np.flatnonzero(whole)),
        *_crowded_edges(subject, mesh, np.flatnonzero(whole)),
        *_sides(subject, mesh, sound, corners, known),
    ]


def _heights(mesh: Mesh) -> Floats:
    """Return the height of each triangle over its longest edge; 0 for a point. (T,)."""
    corners = mesh.positions[mesh.triangles]
    edges = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2).max(axis=1)
    areas = triangle_areas(mesh.positions, mesh.triangles)
    return np.divide(2.0 * areas, edges, out=np.zeros_like(areas), where=edges > 0.0)


def _typical(mesh: Mesh) -> tuple[Floats, float]:
    """Return the middle of the mesh and the median distance from it, which no stray moves."""
    some = mesh.positions[:: max(1, mesh.n_vertices // _SAMPLE)]
    center: Floats = np.median(some, axis=0)
    return center, float(np.median(np.abs(some - center).max(axis=1)))


def _flat(subject: Subject, flat: Bools) -> list[Finding]:
    triangles = np.flatnonzero(flat)
    if len(triangles) == 0:
        return []
    return [
        subject.found(
            "M001.plain",
            message=f"{counted(len(triangles), 'triangle', 'has', 'have', of=len(flat))} no area, first "
            f"triangle {triangles[0]}",
            triangles=triangles,
            at=("triangles", int(triangles[0])),
        )
    ]


def _doubled(subject: Subject, mesh: Mesh, whole: Indices) -> list[Finding]:
    rows = np.sort(mesh.triangles[whole], axis=1).astype(np.int64)
    keys = (rows[:, 0] * mesh.n_vertices + rows[:, 1]) * mesh.n_vertices + rows[:, 2]
    if mesh.n_vertices > 2_000_000:  # the product of three would not fit
        keys = np.unique(rows, axis=0, return_inverse=True)[1].ravel()
    order = np.argsort(keys, kind="stable")
    copies = whole[np.sort(order[1:][np.diff(keys[order]) == 0])]
    if len(copies) == 0:
        return []
    return [
        subject.found(
            "M011.plain",
            message=f"{counted(len(copies), 'triangle', 'has', 'have')} the corners of another one, first "
            f"triangle {copies[0]}",
            triangles=copies,
            at=("triangles", int(copies[0])),
        )
    ]


def _crowded_edges(subject: Subject, mesh: Mesh, whole: Indices) -> list[Finding]:
    """Report edges of more than two triangles, of vertices as listed: parts may touch."""
    edges = edges_of(mesh.triangles[whole].astype(np.int64))
    places = np.flatnonzero(edges.counts > 2)
    if len(places) == 0:
        return []
    triangles = whole[np.unique(places // 3)]
    ends = np.unique(_edge_ends(mesh.triangles[whole], places), axis=0)
    vertices = np.unique(ends)
    return [
        subject.found(
            "M006.plain",
            message=f"{counted(len(ends), 'edge', 'belongs', 'belong')} to more than two triangles, at "
            f"most {int(edges.counts.max())}, first between vertices {ends[0, 0]} and {ends[0, 1]}",
            triangles=triangles,
            vertices=vertices,
            at=("positions", int(ends[0, 0])),
        )
    ]


def _edge_ends(triangles: Ints, places: Indices) -> Indices:
    """Return the two vertices of edges, the smaller first; corner k begins edge 3 t + k. (N, 2)."""
    rows, corners = np.divmod(places, 3)
    ends = np.stack([triangles[rows, corners], triangles[rows, (corners + 1) % 3]], axis=1)
    return np.sort(ends, axis=1).astype(np.int64)


def _sides(
    subject: Subject, mesh: Mesh, sound: Indices, corners: Indices, known: Bools
) -> list[Finding]:
    """Report flipped triangles, components inside out or of one side, and open borders."""
    edges = edges_of(corners)
    component, flipped, one_sided = orientations(len(corners), edges)
    findings = []
    if flipped.any():
        triangles = sound[flipped]
        wound = ("is wound against its", "are wound against their")
        findings.append(
            subject.found(
                "M002.plain",
                message=f"{counted(len(triangles), 'triangle', *wound, of=mesh.n_triangles)} neighbours, "
                f"first triangle {triangles[0]}",
                triangles=triangles,
                at=("triangles", int(triangles[0])),
            )
        )
    if one_sided.any():
        triangles = sound[one_sided]
        findings.append(
            subject.found(
                "M012.plain",
                message=f"a surface of {counted(len(triangles), 'triangle')} has no two sides, with "
                f"triangle {triangles[0]}",
                triangles=triangles,
                at=("triangles", int(triangles[0])),
            )
        )
    unsure = _beside_lost(subject, mesh)[mesh.triangles[sound]]
    border = (edges.counts == 1) & ~(unsure | np.roll(unsure, -1, axis=1)).ravel()
    # Flipped ones are reported already; what the file does not say has no volume.
    signs = np.where(flipped, -1.0, 1.0) * known[sound]
    findings += _inside_out(subject, mesh, sound, component, signs, edges)
    return findings + _borders(subject, mesh, sound, border)


def _borders(subject: Subject, mesh: Mesh, sound: Indices, border: Bools) -> list[Finding]:
    if not border.any():
        return []
    ends = _edge_ends(mesh.triangles[sound], np.flatnonzero(border))
    vertices = np.unique(ends)
    first = ends[np.lexsort(ends.T[::-1])[0]]
    return [
        subject.found(
            "M005.plain",
            message=f"{counted(len(ends), 'edge', 'belongs', 'belong')} to one triangle only, first "
            f"between vertices {first[0]} and {first[1]}",
            vertices=vertices,
            triangles=sound[np.unique(np.flatnonzero(border) // 3)],
            at=("positions", int(first[0])),
        )
    ]


def _beside_lost(subject: Subject, mesh: Mesh) -> Bools:
    """Return vertices whose triangles are not all there, or whose copies nobody can find: (V,)."""
    lost = ~subject.sound("positions", mesh.n_vertices)
    lost[mesh.triangles[~subject.sound("triangles", mesh.n_triangles)]] = True
    return lost


def _inside_out(
    subject: Subject,
    mesh: Mesh,
    sound: Indices,
    component: Indices,
    signs: Floats,
    edges: Edges,
) -> list[Finding]:
    """Report closed components whose volume is negative, sum a . (b x c) / 6."""
    count = len(sound)
    is_known = signs != 0.0
    members = np.bincount(component, is_known, minlength=count)
    open_edges = _open_edges(component, is_known, edges)
    centers = mesh.positions[mesh.triangles[sound]].mean(axis=1)
    sums = [
        np.bincount(component, centers[:, axis] * is_known, minlength=count) for axis in range(3)
    ]
    middle = np.stack(sums, axis=1) / np.maximum(members, 1)[:, None]
    a, b, c = (mesh.positions[mesh.triangles[sound, k]] - middle[component] for k in range(3))
    volumes = signs * np.einsum("ta,ta->t", a, np.cross(b, c))
    total = np.bincount(component, volumes, minlength=count)
    is_closed = open_edges**2 <= _CLOSED * members
    wrong = np.flatnonzero((total < 0.0) & is_closed & (members >= 4))
    if len(wrong) == 0:
        return []
    triangles = sound[np.isin(component, wrong)]
    return [
        subject.found(
            "M003.plain",
            message=f"{counted(len(wrong), 'closed part')} with {counted(len(triangles), 'triangle')} "
            f"{'is' if len(wrong) == 1 else 'are'} inside out, first triangle {triangles[0]}",
            triangles=triangles,
            at=("triangles", int(triangles[0])),
        )
    ]


def _open_edges(component: Indices, is_known: Bools, edges: Edges) -> Indices:
    """Return how many edges of known triangles in each component have no known one beyond: (T,).

    What the file lost closes nothing: the surface may well have ended there.
    """
    alone = np.flatnonzero(np.repeat(is_known, 3) & (edges.counts == 1)) // 3
    beside = edges.pairs[is_known[edges.pairs].sum(axis=1) == 1, 0]
    owners = component[np.concatenate([alone, beside])]
    return np.bincount(owners, minlength=len(component))


def _normals(subject: Subject, mesh: Mesh) -> list[Finding]:
    lengths = np.linalg.norm(mesh.normals, axis=1)
    findings = []
    zero = np.flatnonzero(lengths < _ZERO)
    if len(zero):
        findings.append(
            subject.found(
                "M007.plain",
                message=f"{counted(len(zero), 'normal', 'has', 'have')} length 0, first of vertex "
                f"{zero[0]}",
                vertices=zero,
                at=("normals", int(zero[0])),
            )
        )
    odd = np.flatnonzero((np.abs(lengths - 1.0) > _UNIT) & (lengths >= _ZERO))
    if len(odd):
        odd = odd[np.argsort(-np.abs(lengths[odd] - 1.0), kind="stable")]
        findings.append(
            subject.found(
                "M008.plain",
                message=f"{counted(len(odd), 'normal', 'is', 'are')} not of length 1, that of vertex "
                f"{odd[0]} is {lengths[odd[0]]:.4g} long",
                vertices=odd,
                at=("normals", int(odd[0])),
            )
        )
    return findings


def _against(subject: Subject, mesh: Mesh, sound: Indices) -> list[Finding]:
    """Report normals that point to the other side than every triangle of their vertex.

    Triangles without area face no side. The two sides of a thin sheet have vertices of their own,
    or share them, and then each normal is with one side.
    """
    corners = mesh.triangles[sound]
    a, b, c = (mesh.positions[corners[:, k]] for k in range(3))
    facing = unit(np.cross(b - a, c - a))
    cosines = np.einsum("tka,ta->tk", unit(mesh.normals)[corners], facing)
    places, count = corners.ravel(), mesh.n_vertices
    numbers = np.bincount(places, minlength=count)
    opposed = np.bincount(places, cosines.ravel() < _AGAINST, minlength=count)
    # Where triangles are lost, one of those may have agreed.
    against = np.flatnonzero((numbers > 0) & (opposed == numbers) & ~_beside_lost(subject, mesh))
    if len(against) == 0:
        return []
    used = int((numbers > 0).sum())
    point = "points against all of its" if len(against) == 1 else "point against all of their"
    return [
        subject.found(
            "M009.plain",
            message=f"{counted(len(against), 'normal', of=used)} {point} triangles, first of vertex "
            f"{against[0]}",
            vertices=against,
            at=("normals", int(against[0])),
        )
    ]


def _vertices(subject: Subject, mesh: Mesh) -> list[Finding]:
    findings = []
    is_used = np.zeros(mesh.n_vertices, dtype=np.bool_)
    is_used[mesh.triangles] = True
    unused = np.flatnonzero(~is_used)
    if len(unused):
        findings.append(
            subject.found(
                "M004.plain",
                message=f"{counted(len(unused), 'vertex', 'belongs', 'belong', of=mesh.n_vertices)} to no "
                f"triangle, first vertex {unused[0]}",
                vertices=unused,
                at=("positions", int(unused[0])),
            )
        )
    center, typical = _typical(mesh)
    distances = np.abs(mesh.positions - center).max(axis=1)
    far = np.flatnonzero(distances > _FAR * typical) if typical > 0.0 else np.zeros(0, np.int64)
    if len(far):
        far = far[np.argsort(-distances[far], kind="stable")]
        findings.append(
            subject.found(
                "M010.plain",
                message=f"{counted(len(far), 'vertex', 'is', 'are')} far from the others, vertex {far[0]} "
                f"by {distances[far[0]] / typical:.2g} times what is usual",
                vertices=far,
                at=("positions", int(far[0])),
            )
        )
    return findings
