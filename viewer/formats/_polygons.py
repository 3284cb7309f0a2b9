"""What readers of polygon meshes share: triangles, invalid corners, normals, comments about units.

Convex polygons become fans; others are triangulated by ear clipping.
"""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from viewer.formats._source import Source
from viewer.phrases import Remedy, counted
from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.geometry.vectors import Up
from viewer.rigs.mesh import vertex_normals
from viewer.rigs.units import UNIT_NAMES

# Maximum for ear clipping, which would take seconds for larger polygons; they become fans.
_MOST_CORNERS = 400
_CHUNK = 4_000_000  # (corner, corner) pairs per batch
_PART = 1 << 15  # polygons per batch, which limits the memory of temporary arrays
_SHORTEST = 1e-15  # minimum length of a normal; the square of a shorter length is 0 in float32
_SIZES = {3: "triangle", 4: "quad"}
Picks = NDArray[np.integer]


def triangulate(positions: Floats, corners: Picks, counts: Picks) -> tuple[Picks, Picks]:
    """Triangulate polygons of ``counts`` (F,) corners (C,), keeping their order and winding.

    Returns indices into ``corners`` (T, 3), which also select other attributes, and the polygon of
    each triangle (T,), ascending.
    """
    owners = np.repeat(np.arange(len(counts), dtype=np.int32), counts - 2)
    if (counts == 3).all():
        return np.arange(3 * len(counts), dtype=np.int32).reshape(-1, 3), owners
    picks = np.empty((len(owners), 3), dtype=np.int32)
    starts = np.cumsum(counts) - counts
    for first in range(0, len(counts), _PART):
        part = counts[first : first + _PART]
        for size in np.unique(part).tolist():
            rows = first + np.flatnonzero(part == size)
            places = starts[rows, None] + np.arange(size)
            local = _fan(3)[None] if size == 3 else _cut(positions[corners[places]])
            # Each earlier polygon has two triangles fewer than corners.
            targets = (starts[rows] - 2 * rows)[:, None] + np.arange(size - 2)
            picks[targets] = np.take_along_axis(places[:, None], local, axis=2)
    return picks, owners


def _cut(points: Floats) -> Picks:
    """Triangulate polygons with the same number of corners: (F, n, 3) to (F, n - 2, 3)."""
    count, size = points.shape[:2]
    normals = _area_vectors(points)
    fan = _fan(size)
    result = np.tile(fan, (count, 1, 1))
    hidden = ~_is_covered(points, fan, normals)
    # A fan is right if all corners are visible from the first. Otherwise a quad is split along its
    # other diagonal, and the ears of a larger polygon are clipped one by one (Meisters 1975).
    if size == 4:
        turned = (fan + 1) % 4
        better = hidden & _is_covered(points, turned, normals)
        result[better] = turned
    elif size <= _MOST_CORNERS:
        odd = np.flatnonzero(hidden & normals.any(axis=1))
        step = max(1, _CHUNK // (size * size))
        for first in range(0, len(odd), step):
            some = odd[first : first + step]
            result[some] = _ears(_flattened(points[some], normals[some]))
    return result


def _fan(size: int) -> Picks:
    inner = np.arange(1, size - 1)
    return np.stack([np.zeros_like(inner), inner, inner + 1], axis=1)


def _area_vectors(points: Floats) -> Floats:
    """Return twice each polygon's area along its normal (Newell): (F, 3)."""
    # The area vectors p_i x p_(i+1) of the triangles at the origin add up to that of the polygon;
    # with the first corner as origin, large coordinates do not cancel each other.
    relative = points - points[:, :1]
    return np.cross(relative, np.roll(relative, -1, axis=1)).sum(axis=1)


def _is_covered(points: Floats, triangles: Picks, normals: Floats) -> Bools:
    """Return a mask of polygons whose triangles all face the same way as the polygon: (F,)."""
    a, b, c = (points[:, triangles[:, corner]] for corner in range(3))
    # Triangles of one orientation whose area vectors add up to that of the polygon do not overlap.
    facing = np.einsum("fta,fa->ft", np.cross(b - a, c - a), normals)
    return (facing > 0.0).all(axis=1)


def _flattened(points: Floats, normals: Floats) -> Floats:
    """Project polygons into their own planes, counter-clockwise: (F, n, 2)."""
    normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    # The axis with the smallest component of the normal gives a well-conditioned cross product.
    axes = np.eye(3)[np.abs(normals).argmin(axis=1)]
    first = np.cross(axes, normals)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(normals, first)
    plane = np.stack([first, second], axis=1)
    return np.einsum("fka,fna->fnk", plane, points - points[:, :1])


def _ears(points: Floats) -> Picks:
    """Clip one ear of every polygon in each round: (F, n, 2) to (F, n - 2, 3)."""
    count, size = points.shape[:2]
    left = np.tile(np.arange(size), (count, 1))
    rows = np.arange(count)
    found = []
    while left.shape[1] > 3:
        before, after = np.roll(left, 1, axis=1), np.roll(left, -1, axis=1)
        corners = [points[rows[:, None], index] for index in (before, left, after)]
        areas = _cross(corners[1] - corners[0], corners[2] - corners[0])
        # An ear is a convex corner whose triangle contains no other corner; every simple polygon of
        # four or more corners has two (Meisters 1975).
        is_ear = (areas > 0.0) & ~_has_inside(corners, corners[1])
        # A self-intersecting polygon may have no ear left; the largest corner is then clipped
        # instead.
        chosen = np.where(is_ear.any(axis=1), is_ear.argmax(axis=1), areas.argmax(axis=1))
        found.append(np.stack([part[rows, chosen] for part in (before, left, after)], axis=1))
        keeps = np.ones(left.shape, dtype=np.bool_)
        keeps[rows, chosen] = False
        left = left[keeps].reshape(count, -1)
    found.append(left)
    return np.stack(found, axis=1)


def _has_inside(corners: list[Floats], points: Floats) -> Bools:
    """Return a mask of triangles that contain a point other than their corners: (F, k)."""
    inside = np.ones((*points.shape[:2], points.shape[1]), dtype=np.bool_)
    spots = points[:, None]
    # A point is inside if it is left of all three edges. Corners at the same place as one of the
    # triangle's are not: the edge to a hole is followed twice, so its ends occur twice.
    for start, end in ((0, 1), (1, 2), (2, 0)):
        a, b = corners[start][:, :, None], corners[end][:, :, None]
        inside &= _cross(b - a, spots - a) >= 0.0
        inside &= (spots != a).any(axis=-1)
    result: Bools = np.any(inside, axis=2)
    return result


def _cross(a: Floats, b: Floats) -> Floats:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def picked(corners: Picks, picks: Picks) -> Picks:
    """Return the values of polygon corners at the corners of triangles: (C,) to (T, 3)."""
    # If there are as many corners of triangles as of polygons, all polygons are triangles.
    return corners.reshape(-1, 3) if len(corners) == picks.size else corners[picks]


def triangles_of(counts: Picks, faces: Picks) -> Picks:
    """Return the triangles (T,), ascending, that ``triangulate`` makes of some polygons (N,)."""
    sizes = np.maximum(counts - 2, 0)
    faces = np.unique(faces)
    each = sizes[faces]
    starts = (np.cumsum(sizes) - sizes)[faces]
    return np.repeat(starts - (np.cumsum(each) - each), each) + np.arange(each.sum())


def first_known(corners: Picks, counts: Picks, owners: Picks) -> Picks:
    """Return corners (C,), negative ones replaced by their polygon's first valid one, or by 0."""
    known = np.flatnonzero(corners >= 0)
    first = np.zeros(len(counts), dtype=np.int64)
    # Values are assigned in reverse order, so that the first valid corner remains.
    first[owners[known[::-1]]] = corners[known[::-1]]
    return np.where(corners < 0, first[owners], corners)


def filled_normals(
    source: Source, normals: Floats | None, positions: Floats, triangles: Ints
) -> Floats:
    """Return a normal per vertex (V, 3): that of the file, or computed where there is none."""
    if normals is None:
        return vertex_normals(positions, triangles)
    # Columns are reduced one by one, because numpy is slow at reducing rows of three.
    x, y, z = (np.abs(column) for column in normals.T)
    longest = np.maximum(np.maximum(x, y), z)
    zero = longest < _SHORTEST
    if zero.any():
        places = np.flatnonzero(zero)
        first = int(places[0])
        offset = source.offset_of("normals", first) if source.knows("normals") else None
        source.warn(
            "M007.computed: {n} (first: vertex {vertex}): recomputed from the triangles",
            offset,
            1,
            "positions",
            places,
            n=counted(len(places), "zero-length normal"),
            vertex=first,
        )
    missing = zero | np.isnan(longest)
    if not missing.any():
        return normals
    return np.where(missing[:, None], vertex_normals(positions, triangles), normals)


def polygon_text(counts: NDArray[np.integer], n_triangles: int) -> str:
    """Return polygon counts by size: ``"2 quads, 1 with 5 or more corners"``."""
    sizes = [counted(int((counts == size).sum()), name) for size, name in _SIZES.items()]
    large = int((counts > 4).sum())
    parts = [str(text) for text in sizes if not text.startswith("0 ")]
    parts += [f"{large} with 5 or more corners"] * (large > 0)
    return f"{', '.join(parts)}: {counted(n_triangles, 'triangle')} in all"


def axis_and_unit(source: Source, comment: str) -> tuple[Up, str]:
    """Return the up axis and unit of a file: as requested, else as this program's comment states.

    Without either, they are y and unknown (empty).
    """
    asked = source.option("up")
    if asked.startswith("-"):
        source.warn(
            "F007.up-sign: {option} {up} applies to motions only: {used} up",
            option=Remedy("Up axis", "--up"),
            up=asked,
            used=asked[1:],
        )
    is_z = asked.endswith("z") if asked else re.search(r"\bz up\b", comment) is not None
    stated = re.search(r"\b[yz] up, (\w+)", comment)
    names = {name: unit for unit, name in UNIT_NAMES.items()}
    unit = source.option("unit")
    return "z" if is_z else "y", unit or ("" if stated is None else names.get(stated[1], ""))
