"""Mirror plane of a figure without a symmetry map: counterparts of vertices and of joints."""

from __future__ import annotations

import numpy as np

from viewer.data_classes import dataclass
from viewer.linting._surface import surface_of
from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.topology import Indices
from viewer.rigs.geometry.vectors import reflected
from viewer.rigs.memo import Memo
from viewer.rigs.mesh import bounding_box, box_size
from viewer.rigs.retargeting.joint_names import sided_words
from viewer.rigs.retargeting.mirror import word_partners
from viewer.rigs.skeleton import Skeleton
from viewer.rigs.skin import bind_positions

_EXACT = 1e-4  # maximum distance of a vertex from the image of its counterpart, of the size
_PLACE = 1e-3  # the same of a joint
_SYMMETRIC = 0.5  # minimum fraction of vertices with a counterpart in a symmetric mesh
_mirrors: Memo[Figure, Mirror | None] = Memo()


@dataclass(frozen=True, slots=True, eq=False)
class Mirror:
    """Counterparts across a plane perpendicular to an axis."""

    axis: int
    """Axis, 0 to 2, that the reflection reverses."""
    centre: float
    """Position of the plane along it."""
    vertices: Indices
    """(V,): counterpart of each vertex; itself if it has none."""
    known: Bools
    """(V,): vertices that have one and are the first at their position."""
    joints: Ints
    """(J,): counterpart of each joint by name; -1 if it has a side, but no counterpart. By place if
    no name has a side."""


def mirror_of(figure: Figure) -> Mirror | None:
    """Return the mirror of an attached figure whose mesh is mostly symmetric, or None."""
    return _mirrors.get(figure, (), lambda: _mirror(figure))


def name_partners(skeleton: Skeleton) -> Ints:
    """Return ``word_partners`` of the joints' names: (J,)."""
    return word_partners(sided_words(skeleton.names))


def _mirror(figure: Figure) -> Mirror | None:
    mesh, place = figure.require_mesh(), surface_of(figure).place
    firsts = np.flatnonzero(place == np.arange(mesh.n_vertices))
    points = mesh.positions[firsts]
    box = bounding_box(points)
    size = box_size(box)
    if not 0.0 < size < np.inf:
        return None
    best: tuple[float, int, float, Indices] | None = None
    for axis in (0, 2) if figure.up == "y" else (0, 1):
        for centre in (0.0, float(box[:, axis].mean())):
            found = _counterparts(points, axis, centre, _EXACT * size)
            score = float((found >= 0).mean())
            if best is None or score > best[0]:
                best = score, axis, centre, found
        if best is not None and best[0] > _SYMMETRIC:
            break
    if best is None or best[0] < _SYMMETRIC:
        return None
    _, axis, centre, found = best
    vertices, known = np.arange(mesh.n_vertices), np.zeros(mesh.n_vertices, dtype=np.bool_)
    paired = np.flatnonzero(found >= 0)
    vertices[firsts[paired]] = firsts[found[paired]]
    known[firsts[paired]] = True
    joints = name_partners(figure.require_skeleton())
    if (joints == np.arange(len(joints))).all():
        joints = _partners_by_place(figure, axis, centre, _PLACE * size)
    return Mirror(axis, centre, vertices, known, joints)


def _partners_by_place(figure: Figure, axis: int, centre: float, tolerance: float) -> Ints:
    """Return the joint at the image of each joint, below the counterpart of its parent (J,)."""
    places, parents = bind_positions(figure.require_skin()), figure.require_skeleton().parents
    found = _counterparts(places, axis, centre, tolerance)
    # Of several joints at one place, it is unknown which is whose counterpart.
    partners = np.where(found >= 0, found, np.arange(len(found)))
    for joint, parent in enumerate(parents.tolist()):
        is_shared = (np.linalg.norm(places - places[joint], axis=1) < tolerance).sum() > 1
        is_elsewhere = parent >= 0 and partners[parent] != parents[partners[joint]]
        if is_shared or is_elsewhere:
            partners[joint] = joint
    mutual = partners[partners] == np.arange(len(partners))
    return np.where(mutual, partners, np.arange(len(partners))).astype(np.int32)


def _counterparts(points: Floats, axis: int, centre: float, tolerance: float) -> Indices:
    """Return for each point the one at its image that has it at its own (N,); -1 if none."""
    images = reflected(points, axis, centre)
    # Points are found by their cell. An image is near at most one wall of its cell along each axis,
    # so eight cells contain all points within half a cell.
    cell = 4.0 * tolerance
    low = np.floor(np.minimum(points.min(axis=0), images.min(axis=0)) / cell) - 1.0
    high = np.floor(np.maximum(points.max(axis=0), images.max(axis=0)) / cell) + 2.0
    span = (high - low + 1.0).astype(np.int64)

    def keys(cells: Floats) -> Indices:
        x, y, z = (cells - low).astype(np.int64).T
        found: Indices = (x * span[1] + y) * span[2] + z
        return found

    own = keys(np.floor(points / cell))
    order = np.argsort(own, kind="stable")
    ordered = own[order]
    base = np.floor(images / cell - 0.5)
    nearest = np.full(len(points), np.inf)
    result = np.full(len(points), -1)
    for corner in np.ndindex(2, 2, 2):
        wanted = keys(base + np.array(corner))
        at = np.minimum(np.searchsorted(ordered, wanted), len(ordered) - 1)
        candidates = order[at]
        distances = np.linalg.norm(points[candidates] - images, axis=1)
        distances[ordered[at] != wanted] = np.inf
        closer = distances < nearest
        nearest[closer], result[closer] = distances[closer], candidates[closer]
    result[nearest > 2.0 * tolerance] = -1
    mutual = (result >= 0) & (result[result] == np.arange(len(points)))
    return np.where(mutual, result, -1)
