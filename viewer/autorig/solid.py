"""Voxels of the solid that a mesh encloses, with their distances from the surface.

Characters are rarely one closed surface: they have holes, overlapping and separate parts, and
sheets. A voxel is inside if the mesh winds around it in most of six directions, so that a hole
spoils only the directions in which it lies (Nooruddin and Turk 2003 vote on parities in the same
way; windings also serve parts that overlap). Parts that are thinner than a voxel are added from the
surface, and separate components are joined across the gaps between them. The hollow of a mug or of
a lamp shade, whose walls have an inner side, is filled on request: its bones are in the middle.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from viewer.autorig.surface.welding import one_sided, weld
from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.progress import report_fraction
from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.geometry.samples import sample_surface
from viewer.rigs.geometry.topology import edges_of, orientations, part_volumes

if TYPE_CHECKING:
    from scipy.sparse import csr_array
    from scipy.spatial import cKDTree

RESOLUTION = 96
"""Default number of voxels along the longest side of the mesh's box."""
MOST_VOXELS = 80_000
"""Number above which ``solid_within`` uses a coarser grid: a ball fills half of its box."""

_MARGIN = 2  # voxels outside the box, so that the outside is connected
# Offset of the grid, in voxels: symmetric meshes have vertices and edges in the planes of a centred
# grid, and a ray through an edge would hit two triangles or none. Any irrational numbers will do.
_OFFSETS = np.sqrt([2.0, 3.0, 5.0]) * 1e-3
_BLOCK = 1 << 22  # pairs of triangle and ray per batch
_SAMPLES = 4.0  # samples of the surface per square of one voxel
_WIDEST_GAP = 0.1  # longest gap between components that is bridged, as a fraction of the side
_RAY_STEP = 0.25  # distance of the points of a ray that are looked up, in voxels
_ROUNDS = 40  # most rounds of bridging
# Hollows: the fraction of one end that is closed by a floor, or else the depth relative to the
# width. The hole of a ring or of a frame has no floor and is wider than deep.
_FLOOR, _DEEP = 0.8, 0.5


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class Solid:
    """A grid of voxels in the mesh's space."""

    origin: Floats
    """(3,). Centre of the first voxel."""
    spacing: float
    """Side of a voxel in the mesh's unit."""
    inside: Bools
    """(X, Y, Z). Voxels of the solid; all are connected."""
    distance: Floats
    """(X, Y, Z). Distance of each voxel's centre from the surface, in the mesh's unit; 0 outside.
    Accurate to half a voxel."""
    voxels: Ints
    """(N, 3). Grid coordinates of the voxels of the solid."""
    numbers: Ints
    """(X, Y, Z). Row of each voxel in ``voxels``, -1 outside."""
    tree: cKDTree
    """Search tree of the centres of ``voxels``."""

    def centers(self, voxels: Ints) -> Floats:
        """Return the centres of voxels (..., 3)."""
        return self.origin + self.spacing * voxels

    def voxel_of(self, points: Floats) -> Ints:
        """Return the voxels that contain points (..., 3), clamped to the grid."""
        nearest = np.rint((points - self.origin) / self.spacing)
        return np.clip(nearest, 0, np.array(self.inside.shape) - 1).astype(np.int32)

    def nearest(self, points: Floats) -> Ints:
        """Return the row in ``voxels`` of the nearest voxel of the solid: (N,)."""
        return np.asarray(self.tree.query(points)[1], dtype=np.int32)

    def middle(self, origin: Floats, direction: Floats) -> Floats | None:
        """Return the point (3,) of a ray halfway between entering the solid and leaving it.

        None if the ray, with a direction (3,) of any length, passes the solid.
        """
        direction = direction / np.linalg.norm(direction)
        # The ray crosses the grid's sphere near its point closest to the centre.
        sides = self.spacing * np.array(self.inside.shape)
        center = self.origin + 0.5 * (sides - self.spacing)
        along, reach = float((center - origin) @ direction), 0.5 * float(np.linalg.norm(sides))
        count = int(np.ceil(2.0 * reach / (_RAY_STEP * self.spacing))) + 1
        steps = along + np.linspace(-reach, reach, count)
        steps = steps[steps >= 0.0]
        # Voxels at the border of the grid are outside, and so are points beyond it.
        inside = self.inside[tuple(self.voxel_of(origin + steps[:, None] * direction).T)]
        if not inside.any():
            return None
        first = int(inside.argmax())
        after = np.flatnonzero(~inside[first:])
        last = first + int(after[0]) - 1 if len(after) else len(steps) - 1
        return np.asarray(origin + 0.5 * (steps[first] + steps[last]) * direction)

    def gaps(self, points: Floats) -> Floats:
        """Return the distances of points (N, 3) from the nearest voxels' centres: (N,)."""
        return np.asarray(self.tree.query(points)[0])

    def radii(self) -> Floats:
        """Return the distances of ``voxels`` from the surface: (N,)."""
        found: Floats = self.distance[tuple(self.voxels.T)]
        return found

    def graph(self) -> csr_array:
        """Return the lengths of steps to the 26 neighbours, sparse (N, N)."""
        from scipy import sparse

        starts, ends, lengths = [], [], []
        padded = np.pad(self.numbers, 1, constant_values=-1)
        numbers, places = padded.ravel(), np.ravel_multi_index((self.voxels + 1).T, padded.shape)
        strides = np.array(padded.strides) // padded.itemsize
        rows = np.arange(len(self.voxels))
        # One of each pair of opposite steps suffices: the matrix is symmetric.
        steps = np.array(list(np.ndindex(3, 3, 3)))[14:] - 1
        for step in steps:
            other = numbers[places + int(step @ strides)]
            found = other >= 0
            starts.append(rows[found])
            ends.append(other[found])
            lengths.append(np.full(int(found.sum()), self.spacing * np.linalg.norm(step)))
        a, b, length = (np.concatenate(parts) for parts in (starts, ends, lengths))
        matrix = sparse.coo_array((length, (a, b)), shape=(len(rows), len(rows)))
        return sparse.csr_array(matrix + matrix.T)


def solid_of(
    positions: Floats, triangles: Ints, resolution: int = RESOLUTION, fills_hollows: bool = False
) -> Solid:
    """Return the voxels inside a mesh; ``RigError`` if it encloses none."""
    from scipy import ndimage, spatial

    used = positions[triangles.ravel()]
    low, high = used.min(axis=0), used.max(axis=0)
    side = float((high - low).max())
    if not side > 0.0:
        raise RigError("expected a mesh with an extent, found a point")
    spacing = side / resolution
    origin = low + spacing * (0.5 - _MARGIN + _OFFSETS)
    counts = np.ceil((high - low) / spacing).astype(int) + 2 * _MARGIN
    shape = (int(counts[0]), int(counts[1]), int(counts[2]))
    report_fraction(0.0, "finding the inside")
    corners = (_outward(positions, triangles) - origin) / spacing  # in voxels
    votes = np.zeros(shape)
    for axis in range(3):
        votes += _windings(corners, shape, axis)
        report_fraction((axis + 1) / 4.0)
    solid = votes > 3.0  # of six directions
    solid |= _thin_parts(positions, triangles, origin, spacing, solid)
    if fills_hollows:
        solid |= _hollows(solid)
    inside = _joined(solid, _WIDEST_GAP * resolution)
    distance = np.asarray(ndimage.distance_transform_edt(inside), dtype=np.float64)
    # The surface is half a voxel before the centre of the nearest voxel outside.
    distance = np.where(inside, spacing * (distance - 0.5), 0.0)
    voxels = np.argwhere(inside).astype(np.int32)
    numbers = np.full(shape, -1, dtype=np.int32)
    numbers[inside] = np.arange(len(voxels))
    tree = spatial.cKDTree(origin + spacing * voxels)
    return Solid(origin, spacing, inside, distance, voxels, numbers, tree)


def solid_within(
    positions: Floats,
    triangles: Ints,
    finest: int = RESOLUTION,
    most: int = MOST_VOXELS,
    fills_hollows: bool = False,
) -> Solid:
    """Return the voxels inside a mesh, as fine as ``finest`` with about ``most`` voxels allows."""
    solid = solid_of(positions, triangles, fills_hollows=fills_hollows)
    resolution = int(RESOLUTION * (most / len(solid.voxels)) ** (1.0 / 3.0))
    if len(solid.voxels) > most or finest > RESOLUTION:
        finer = min(max(16, resolution), finest)
        solid = solid_of(positions, triangles, finer, fills_hollows)
    return solid


def _outward(positions: Floats, triangles: Ints) -> Floats:
    """Return one-sided triangles (T, 3, 3), flipped ones and parts inside out reversed."""
    mesh = one_sided(weld(positions, triangles))
    if len(mesh.triangles) == 0:
        raise RigError("expected a mesh with an area, found none")
    corners = mesh.positions[mesh.triangles]
    flipped = orientations(len(corners), edges_of(mesh.triangles))[1]
    corners[flipped] = corners[flipped][:, ::-1]
    parts = mesh.islands[mesh.triangles[:, 0]]
    volumes = part_volumes(corners, parts, mesh.n_islands)[0]
    against = volumes[parts] < 0.0
    corners[against] = corners[against][:, ::-1]
    return corners


def _windings(corners: Floats, shape: tuple[int, int, int], axis: int) -> Floats:
    """Return how many of the two directions along an axis wind around each voxel: 0 to 2."""
    u, v = (axis + 1) % 3, (axis + 2) % 3
    planar = corners[:, :, [u, v]]
    n_u, n_v, depth = shape[u], shape[v], shape[axis]
    changes = np.zeros((n_u * n_v, depth + 1))
    first = np.ceil(planar.min(axis=1)).astype(np.int64)
    last = np.floor(planar.max(axis=1)).astype(np.int64)
    sizes = np.maximum(last - first + 1, 0)
    areas = sizes[:, 0] * sizes[:, 1]
    rays = np.flatnonzero(areas)
    ends = np.cumsum(areas[rays])
    begin = 0
    while begin < len(rays):
        done = ends[begin - 1] if begin else 0
        stop = max(begin + 1, int(np.searchsorted(ends, done + _BLOCK)))
        chosen = rays[begin:stop]
        which = np.repeat(chosen, areas[chosen])
        offsets = np.cumsum(areas[chosen]) - areas[chosen]
        number = np.arange(len(which)) - np.repeat(offsets, areas[chosen])
        column = first[which, 0] + number // sizes[which, 1]
        row = first[which, 1] + number % sizes[which, 1]
        hit, sign, height = _hits(corners[which], planar[which], column, row, axis)
        # A crossing at height h changes the winding of all voxels above h.
        above = np.clip(np.ceil(height), 0, depth).astype(np.int64)
        np.add.at(changes, (column[hit] * n_v + row[hit], above), sign)
        begin = stop
    # Seen from a voxel, the surface below it and the surface above it must both be crossed outwards
    # once more than inwards. Counter-clockwise in (u, v) faces the positive axis.
    sums = np.cumsum(changes, axis=1)
    below, over = -sums[:, :depth], sums[:, depth:] - sums[:, :depth]
    both = np.clip(below, 0.0, 1.0) + np.clip(over, 0.0, 1.0)
    return np.moveaxis(both.reshape(n_u, n_v, depth), (0, 1, 2), (u, v, axis))


def _hits(
    corners: Floats, planar: Floats, column: Ints, row: Ints, axis: int
) -> tuple[Bools, Floats, Floats]:
    """Return which rays hit their triangle, its orientation and the height of the hit."""
    points = np.stack([column, row], axis=1)[:, None] - planar
    a, b, c = points[:, 0], points[:, 1], points[:, 2]
    # Twice the areas opposite each corner: barycentric coordinates up to their sum.
    areas = np.stack([_cross(b, c), _cross(c, a), _cross(a, b)], axis=1)
    hit: Bools = np.abs(np.sign(areas).sum(axis=1)) == 3.0
    areas = areas[hit]
    whole = areas.sum(axis=1)
    height = np.einsum("nk,nk->n", areas, corners[hit][:, :, axis]) / whole
    return hit, np.sign(whole), height


def _cross(a: Floats, b: Floats) -> Floats:
    crossed: Floats = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    return crossed


def _thin_parts(
    positions: Floats, triangles: Ints, origin: Floats, spacing: float, solid: Bools
) -> Bools:
    """Return voxels on the surface of parts so thin that no voxel's centre is inside them."""
    from scipy import ndimage

    edges = positions[triangles[:, 1:]] - positions[triangles[:, :1]]
    area = 0.5 * float(np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1).sum())
    count = int(_SAMPLES * area / spacing**2) + 1
    points = sample_surface(positions, triangles, count).positions
    found = np.rint((points - origin) / spacing).astype(np.int64)
    found = np.clip(found, 0, np.array(solid.shape) - 1)
    surface = np.zeros(solid.shape, dtype=np.bool_)
    surface[tuple(found.T)] = True
    # Next to the solid, the surface is its own: adding it would thicken limbs and close the gap
    # between them.
    thin = surface & ~ndimage.binary_dilation(solid, np.ones((3, 3, 3)))
    if not thin.any():
        return thin
    near: Bools = ndimage.binary_dilation(thin, np.ones((3, 3, 3))) & surface
    return near


def _hollows(solid: Bools) -> Bools:
    """Return the voxels of hollows that walls enclose all around, with a floor or deep."""
    from scipy import ndimage

    found = np.zeros_like(solid)
    for axis in range(3):
        # In slices across the axis, what is not connected with their corner is enclosed. Walls of
        # voxels that only share a corner are closed.
        outside = np.moveaxis(~solid, axis, 0)
        around = np.zeros((3, 3, 3), dtype=np.bool_)
        around[1] = ndimage.generate_binary_structure(2, 1)
        labels, _ = ndimage.label(outside, around)
        holes = outside & (labels != labels[:, :1, :1])
        labels, count = ndimage.label(holes)
        if count == 0:
            continue
        numbers = np.arange(count + 1)
        filled = np.moveaxis(found, axis, 0)
        closed = []
        for step in (1, -1):
            # Of the last voxels of the columns, those before a wall are closed.
            behind = np.roll(labels, -step, axis=0)
            ends = holes & (behind != labels)
            is_wall = ends & ~np.roll(outside, -step, axis=0)
            n_ends = np.bincount(labels[ends], minlength=count + 1)
            walls = np.bincount(labels[is_wall], minlength=count + 1)
            closed.append(walls / np.maximum(n_ends, 1))
        sizes = [np.bincount(layer.ravel(), minlength=count + 1) for layer in labels]
        areas = np.max(sizes, axis=0)
        depths = np.count_nonzero(sizes, axis=0)
        # A disc of an area A has the width 2 sqrt(A / pi).
        is_deep = depths >= _DEEP * 2.0 * np.sqrt(areas / np.pi)
        kept = is_deep | (np.max(closed, axis=0) >= _FLOOR)
        filled |= np.isin(labels, numbers[1:][kept[1:]])
    return found


def _joined(solid: Bools, widest: float) -> Bools:
    """Return the largest component, with all others that are near enough, joined by bridges."""
    from scipy import ndimage

    around = np.ones((3, 3, 3))
    if not solid.any():
        raise RigError("expected a mesh that encloses a volume, found none")
    solid = solid.copy()
    for _ in range(_ROUNDS):
        labels, count = ndimage.label(solid, around)
        sizes = np.bincount(labels.ravel())[1:]
        main = labels == int(sizes.argmax()) + 1
        if count == 1:
            return main
        gaps, nearest = ndimage.distance_transform_edt(~main, return_indices=True)
        # Every other component is joined at its voxel nearest to the largest one.
        gaps = np.where(solid & ~main, gaps, np.inf)
        numbers = np.arange(1, count + 1)
        closest = np.array(ndimage.minimum(gaps, labels, numbers))
        reached = np.flatnonzero(closest <= widest)
        if len(reached) == 0:
            return main
        limit = max(2.0, 1.5 * float(closest[reached].min()))
        chosen = reached[closest[reached] <= limit]
        places = ndimage.minimum_position(gaps, labels, numbers[chosen])
        for place in places:
            start, end = np.array(place), nearest[(slice(None), *place)]
            steps = int(np.abs(end - start).max()) + 1
            line = np.rint(np.linspace(start, end, steps + 1)).astype(int)
            solid[tuple(line.T)] = True
    labels, _ = ndimage.label(solid, around)
    main = labels == int(np.bincount(labels.ravel())[1:].argmax()) + 1
    return main
