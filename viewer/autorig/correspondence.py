"""Correspondence of a target's vertices with the template's surface.

A vertex is matched if the closest point of the template is close enough and faces the same way
(Abdrashitov et al. 2023). Skin that touches other skin, such as an arm at rest on the torso,
is close to the wrong part but faces the other way: its weights are inpainted. So are those of small
patches whose matches are on another limb than the matches around them, as those of a leg that the
template's tail touches.

Parts of a target whose triangles are wound the wrong way face the other way, too. Such a part may
be a lining, which is correct. It is an error if it encloses a volume, or if it makes up most of the
target.
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import product

import numpy as np

from viewer.autorig.surface.laplacian import voronoi_areas
from viewer.autorig.surface.welding import Welded, edge_graph, edges, weld
from viewer.data_classes import dataclass, setting
from viewer.errors import RigError
from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.geometry.closest_point import Surface, SurfacePoints, interpolate
from viewer.rigs.geometry.topology import CLOSED, Indices, components, edges_of, part_volumes
from viewer.rigs.geometry.vectors import unit
from viewer.rigs.mesh import (
    Mesh,
    area_vectors,
    bounding_box,
    box_size,
    side_lengths,
    vertex_normals,
)

_INSIDE_OUT = math.radians(120.0)  # angle above which a triangle is reversed rather than folded
_MOST = 0.75  # fraction of an island's near vertices above which the island is reversed

# Maximum angle between a normal and the centre of its group; see _sides.
_TOGETHER = math.radians(80.0)

# Two sides of a sheet cancel out if less than this fraction of the area around a vertex remains.
_CANCELLED = 1e-3

_MOST_REVERSED = 0.5  # fraction of the target's area above which an island is reversed

# Length of the path on the template between the matches of two neighbours, relative to the path
# between these, from which the matches are on different limbs. On 9 characters, 99 % of all paths
# are up to 3.1 times as long, as they follow edges and round what is thicker in the template; paths
# to another limb are 15 to 90 times as long. From 3 to 4, the same patches are found.
_DETOUR = 3.0
# Maximum area of a patch that is dropped, relative to the patch that it is torn from: larger ones
# may be limbs that are attached elsewhere. From 0.02 to 0.1, the same patches are found.
_SMALL_PATCH = 0.05
# Distance of matches in the template's own proportions, relative to that of neighbours, up to which
# nothing was squeezed. Links of persons' meshes have up to 1.2 at the 90th percentile, of figures
# with a large head 1.3 to 1.9.
_PROPORTIONS = 1.2
_LENGTHS = 1 << 22  # number of path lengths that are computed together, 32 MB

MAX_ANGLE = 30.0
"""Usual limit of the angle between matching normals, degrees."""


@dataclass(frozen=True, slots=True)
class MatchSettings:
    """Criteria by which a vertex is matched with the template."""

    max_distance: float = setting(
        0.05,
        "maximum distance of matching points, relative to the target's size (default: {default})",
        limits=(0.0, math.inf),
        metavar="X",
    )
    """Fraction of the target's box diagonal."""
    max_angle: float = setting(
        math.radians(MAX_ANGLE),
        f"maximum angle between the normals of matching points (default: {MAX_ANGLE:g})",
        given=MAX_ANGLE,
        limits=(0.0, 180.0),
        read=math.radians,
        metavar="DEG",
    )
    """Radians between the normals of both surfaces."""
    near_distance: float = 0.005
    near_angle: float = math.radians(60.0)
    """Within this fraction of the diagonal, this angle suffices, or ``max_angle`` if it is larger:
    normals of sharp and thin parts of a coarse mesh are unreliable. Sheets thinner than this are
    matched on the side whose normal agrees. Weights of vertices farther away are diffused."""
    flipped_normals: bool = False
    """Also accept opposite normals. An island that is entirely inside out is reversed in any
    case."""

    def __post_init__(self) -> None:
        for name in ("max_distance", "max_angle", "near_distance", "near_angle"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise RigError(f"{name}: expected a number of at least 0, found {value}")
        # The stricter limit for all points must not exclude what the wider one admits.
        object.__setattr__(self, "near_angle", max(self.near_angle, self.max_angle))


@dataclass(frozen=True, slots=True, eq=False)
class Matches:
    """Matches of a target's vertices on the template."""

    points: SurfacePoints
    """W points of the template: for each matched vertex, the closest point with an agreeing normal;
    for other vertices, the closest point."""
    matched: Bools
    """(W,) bool. Whether each vertex lies on the template."""
    angles: Floats
    """(W,). Angles between the normals, radians; 0 if the target has no normal."""
    inside_out: Ints
    """(I,) int32. Islands of the target that were reversed."""


class Template:
    """The template's surface, aligned with the targets to match; ``RigError`` without triangles.

    ``unfitted`` (V, 3): the surface in its own proportions, if the aligned one has others, along
    the same axes; it is scaled to the same size, the diagonal of its box.
    """

    def __init__(self, positions: Floats, triangles: Ints, unfitted: Floats | None = None) -> None:
        self.surface = Surface(positions, triangles)
        self.positions, self.triangles = positions, triangles
        self.unfitted: Floats | None = None
        if unfitted is not None:
            used = triangles.ravel()
            size, own = (box_size(bounding_box(each[used])) for each in (positions, unfitted))
            self.unfitted = unfitted * (size / own)
        self.welded = weld(positions, triangles)
        normals = vertex_normals(self.welded.positions, self.welded.triangles)
        self.normals: Floats = normals[self.welded.vertices]

    def normals_at(self, points: SurfacePoints) -> Floats:
        """Return unit normals at points of the surface, (N, 3), interpolated from the corners."""
        return unit(interpolate(points, self.triangles, self.normals))

    def crowding(self, target: Welded, points: SurfacePoints, matched: Bools) -> Floats:
        """Return how much farther the matches of neighbours are apart than the neighbours: (W,).

        Measured in the template's own proportions. Where these were squeezed to fit a target, the
        surface of an arm or a neck may be in that of a chest, and each match is uncertain by this.
        Matches up to a fifth farther apart are only on a limb of another length.
        """
        result = np.zeros(len(matched))
        if self.unfitted is None:
            return result
        links = edges(target.triangles)
        links = links[matched[links].all(axis=1)]
        there = interpolate(points, self.triangles, self.unfitted)
        apart, near = (
            np.linalg.norm(places[links[:, 1]] - places[links[:, 0]], axis=1)
            for places in (there, target.positions)
        )
        for ends in links.T:
            np.maximum.at(result, ends, apart - _PROPORTIONS * near)
        return result


def sheet_normals(mesh: Welded) -> Floats:
    """Return unit normals (W, 3), 0 without triangles and where two sides of a sheet cancel out."""
    vectors = area_vectors(mesh.positions, mesh.triangles)
    corners, count = mesh.triangles.ravel(), len(mesh.positions)
    areas = np.bincount(corners, np.repeat(np.linalg.norm(vectors, axis=1), 3), minlength=count)
    columns = [
        np.bincount(corners, np.repeat(vectors[:, axis], 3), minlength=count) for axis in range(3)
    ]
    sums = np.stack(columns, axis=1).astype(float)
    sums[np.linalg.norm(sums, axis=1) <= _CANCELLED * areas] = 0.0
    return unit(sums)


def match(template: Template, target: Welded, size: float, settings: MatchSettings) -> Matches:
    """Match the vertices of a target that lie on the template."""
    points, welded = template.surface.closest(target.positions), template.welded
    same = same_vertices(welded, target, points.distances)
    corners = welded.vertices[template.triangles]
    points = at_vertices(points, target.positions, corners, welded.positions, same)
    normals = sheet_normals(target)
    angles = _angles(template, points, normals)
    meets = points.distances <= settings.max_distance * size
    inside_out = _inside_out(target, angles, meets & normals.any(axis=1))
    normals[np.isin(target.islands, inside_out)] *= -1.0
    angles = _judged(_angles(template, points, normals), normals, settings)
    is_near = points.distances <= settings.near_distance * size
    matched = meets & (angles <= settings.max_angle)
    matched |= is_near & (angles <= settings.near_angle)
    rest = np.nonzero(~matched & is_near)[0]
    sides = _sides(template, target.positions[rest], normals[rest])
    side_angles = _judged(_angles(template, sides, normals[rest]), normals[rest], settings)
    fits = (sides.distances <= settings.near_distance * size) & (side_angles <= settings.near_angle)
    matched[rest[fits]] = True
    angles[rest[fits]] = side_angles[fits]
    points = _replaced(points, rest[fits], sides, fits)
    matched &= ~_in_torn_patches(template, target, points, matched)
    return Matches(points, matched, angles, inside_out)


def _in_torn_patches(
    template: Template, target: Welded, points: SurfacePoints, matched: Bools
) -> Bools:
    """Return the matched vertices (W,) of small patches on another limb than what is around them.

    The closest point of a leg may be on a tail that hangs beside it, at a usual distance and with a
    normal that agrees. Only the surface shows the error: neighbours whose matches are far from each
    other on the template.
    """
    from scipy.sparse import csgraph

    known = np.flatnonzero(matched)
    if len(known) == 0:
        return matched
    # An unmatched vertex belongs to the nearest matched one, so that patches are neighbours also
    # across a gap.
    graph = edge_graph(target.positions, target.triangles).tocoo()
    gaps, _, owners = csgraph.dijkstra(
        graph.tocsr(), directed=False, indices=known, min_only=True, return_predecessors=True
    )
    starts, ends = owners[graph.row], owners[graph.col]
    rows = np.flatnonzero((starts != ends) & (starts >= 0))
    starts, ends = starts[rows], ends[rows]
    ways = gaps[graph.row[rows]], gaps[graph.col[rows]]
    lengths = ways[0] + graph.data[rows] + ways[1]
    torn = _are_apart(template, points, starts, ends, _DETOUR * lengths)
    count = len(matched)
    joined = ~torn & (ways[0] + ways[1] == 0.0)
    patches = components(count, np.stack([starts, ends], axis=1)[joined])
    areas = np.bincount(patches, voronoi_areas(target.positions, target.triangles) * matched, count)
    # A path across a wide gap may be as long as one to another limb: most links of a patch decide.
    first, second = patches[starts], patches[ends]
    balance, largest = np.zeros((2, count))
    outside = first != second
    for one, other in ((first, second), (second, first)):
        np.add.at(balance, one[outside], np.where(torn[outside], 1.0, -1.0))
        np.maximum.at(largest, one[torn], areas[other[torn]])
    wrong = (balance > 0.0) & (areas < _SMALL_PATCH * largest)
    return wrong[patches] & matched


def _are_apart(
    template: Template, points: SurfacePoints, starts: Indices, ends: Indices, reach: Floats
) -> Bools:
    """Return whether the path between two points on the template is longer than ``reach``: (N,).

    ``starts``, ``ends`` (N,): rows of ``points``. Parts of the template that are not connected have
    no path, and are not judged.
    """
    from scipy.sparse import csgraph

    if len(starts) == 0:
        return np.zeros(0, dtype=np.bool_)
    welded, corners = template.welded, template.welded.vertices[template.triangles]
    at = corners[points.triangles, points.barycentric.argmax(axis=1)]
    # A path from corner to corner may be longer by the way from each point to its corner.
    sides = side_lengths(template.positions, template.triangles).max(axis=1)[points.triangles]
    reach = reach + sides[starts] + sides[ends]
    graph = edge_graph(welded.positions, welded.triangles)
    # Most neighbours have the same corner or two ends of an edge, which takes no search.
    one, other = np.minimum(at[starts], at[ends]), np.maximum(at[starts], at[ends])
    direct = np.asarray(graph[one, other]).reshape(-1)
    is_near = (one == other) | ((direct > 0.0) & (direct <= reach))
    judged = np.flatnonzero(~is_near & (welded.islands[one] == welded.islands[other]))
    # Long edges need long paths: they are computed apart from the many short ones.
    judged = judged[np.argsort(reach[judged], kind="stable")]
    apart = np.zeros(len(starts), dtype=np.bool_)
    step = max(1, _LENGTHS // graph.shape[0])
    for start in range(0, len(judged), step):
        some = judged[start : start + step]
        sources, row = np.unique(at[starts[some]], return_inverse=True)
        limit = float(reach[some].max())
        paths = csgraph.dijkstra(graph, directed=False, indices=sources, limit=limit)
        apart[some] = paths[row.reshape(-1), at[ends[some]]] > reach[some]
    return apart


def _angles(template: Template, points: SurfacePoints, normals: Floats) -> Floats:
    """Return the angles between normals (N, 3) and the template's normals, 0 if undefined."""
    there = template.normals_at(points)
    cosines = np.clip(np.einsum("na,na->n", there, normals), -1.0, 1.0)
    return np.where(normals.any(axis=1), np.arccos(cosines), 0.0)


def _judged(angles: Floats, normals: Floats, settings: MatchSettings) -> Floats:
    if not settings.flipped_normals:
        return angles
    return np.where(normals.any(axis=1), np.minimum(angles, math.pi - angles), 0.0)


def _inside_out(target: Welded, angles: Floats, judged: Bools) -> Ints:
    """Return the islands in which most of the tested vertices face the other way."""
    of = target.islands[judged]
    total = np.bincount(of, minlength=target.n_islands)
    rotated = np.bincount(of[angles[judged] > _INSIDE_OUT], minlength=target.n_islands)
    return np.nonzero((rotated > _MOST * total) & (total > 0))[0].astype(np.int32)


def _sides(template: Template, positions: Floats, normals: Floats) -> SurfacePoints:
    """Return the closest points on triangles that face approximately the same way."""
    count = len(positions)
    triangles, distances = np.zeros(count, dtype=np.int32), np.full(count, np.inf)
    barycentric, found = np.tile([1.0, 0.0, 0.0], (count, 1)), positions.copy()
    grid = np.array([axes for axes in product((-1.0, 0.0, 1.0), repeat=3) if any(axes)])
    directions = unit(grid)
    faces = unit(area_vectors(template.positions, template.triangles))
    # Directions are grouped by the 26 directions of a cube's faces, edges and corners; each is
    # within 28 degrees of one of them. Each group is searched in its own subset of triangles.
    group = (normals @ directions.T).argmax(axis=1) if count else np.zeros(0, dtype=int)
    for number in np.unique(group):
        inside = np.nonzero(group == number)[0]
        facing = np.nonzero(faces @ directions[number] >= math.cos(_TOGETHER))[0]
        if len(facing) == 0:
            continue
        part = Surface(template.positions, template.triangles[facing]).closest(positions[inside])
        triangles[inside] = facing[part.triangles]
        barycentric[inside], found[inside] = part.barycentric, part.positions
        distances[inside] = part.distances
    # If no triangle faces in that direction, the distance is infinite, but the coordinates are
    # valid.
    distances[np.isinf(distances)] = np.finfo(float).max
    return SurfacePoints(triangles, barycentric, found, distances)


def _replaced(
    points: SurfacePoints, rows: Indices, others: SurfacePoints, of: Bools
) -> SurfacePoints:
    """Return the points with some rows replaced by others."""
    columns = []
    for name in ("triangles", "barycentric", "positions", "distances"):
        column = getattr(points, name).copy()
        column[rows] = getattr(others, name)[of]
        columns.append(column)
    return SurfacePoints(*columns)


# Vertices common to target and template: a mesh that was edited or sculpted, not remeshed.
#
# If a vertex was moved along the surface, its closest point has interpolated weights, whereas the
# original vertex has the exact ones. A target's vertex is identified with a vertex of the
# template if each is the nearest vertex to the other, it moved along the surface by less than
# half the length of its edges, and nearly all of its edges correspond to edges of the template. A
# different tessellation of the same surface has very few such vertices.
_EDGES = 0.8  # minimum fraction of a vertex's edges that are also edges of the template
_SLID = 0.5  # maximum shift along the surface, relative to the mean length of a vertex's edges
_FEW = 10_000  # number of points below which starting threads costs more time than it saves


def same_vertices(template: Welded, target: Welded, distances: Floats) -> Ints:
    """Return the template's vertex at each vertex of the target (W,), -1 for none; none twice."""
    there, far = _nearest(template.positions, target.positions)
    back, _ = _nearest(target.positions, template.positions)
    links, count = edges(target.triangles), len(there)
    degree = np.maximum(np.bincount(links.ravel(), minlength=count), 1)
    lengths = np.linalg.norm(np.diff(target.positions[links], axis=1)[:, 0], axis=1)
    around = np.bincount(links.ravel(), np.repeat(lengths, 2), minlength=count) / degree
    slid = np.sqrt(np.maximum(far**2 - distances**2, 0.0))
    is_near = (back[there] == np.arange(count)) & (slid < _SLID * around)
    same = np.where(is_near, there, -1)
    ends = same[links]
    known = np.isin(_keys(ends, template), _keys(edges(template.triangles), template))
    kept = (ends >= 0).all(axis=1) & known
    found = np.bincount(links[kept].ravel(), minlength=count)
    return np.where(found >= _EDGES * degree, same, -1)


def at_vertices(
    points: SurfacePoints, positions: Floats, corners: Ints, places: Floats, same: Ints
) -> SurfacePoints:
    """Return points of a surface, some of them snapped to the vertex in ``same`` (W,), or -1."""
    rows = np.flatnonzero(same >= 0)
    used, first = np.unique(corners, return_index=True)
    place = np.full(len(places), -1)
    place[used] = first
    rows = rows[place[same[rows]] >= 0]  # a vertex without triangles is not on the surface
    at = place[same[rows]]
    triangles, barycentric = points.triangles.copy(), points.barycentric.copy()
    found, distances = points.positions.copy(), points.distances.copy()
    triangles[rows] = at // 3
    barycentric[rows] = np.eye(3)[at % 3]
    found[rows] = places[same[rows]]
    distances[rows] = np.linalg.norm(found[rows] - positions[rows], axis=1)
    return SurfacePoints(triangles, barycentric, found, distances)


def _nearest(points: Floats, asked: Floats) -> tuple[Indices, Floats]:
    from scipy import spatial

    tree = spatial.cKDTree(points)
    distances, found = tree.query(asked, workers=1 if len(asked) < _FEW else -1)
    return found, distances


def _keys(pairs: Ints, template: Welded) -> Ints:
    """Return a unique integer for each undirected pair of the template's vertices."""
    low, high = pairs.min(axis=1).astype(np.int64), pairs.max(axis=1)
    keys: Ints = low * len(template.positions) + high
    return keys


def wound_backwards(target: Welded, facing_away: Ints) -> Bools:
    """Return the vertices (V,) of parts whose triangles should be reversed."""
    of = target.islands[target.triangles[:, 0]]
    count = target.n_islands
    volumes, areas, members = part_volumes(target.positions[target.triangles], of, count)
    # An island that is wound backwards encloses a negative volume. The sign is reliable if it is
    # closed except for small holes, or has more than half of the area.
    borders = np.bincount(np.repeat(of, 3)[edges_of(target.triangles).counts == 1], None, count)
    is_whole = borders**2 <= CLOSED * members
    is_most = areas > _MOST_REVERSED * areas.sum()
    wrong = np.flatnonzero((volumes < 0.0) & (is_whole | is_most))
    return np.isin(target.islands, np.intersect1d(wrong, facing_away))[target.vertices]


def with_reversed_winding(mesh: Mesh, vertices: Bools) -> Mesh:
    """Return a mesh with the triangles at vertices (V,) reversed, and with matching normals."""
    rows = np.logical_or.reduce(vertices[mesh.triangles], axis=1)
    if not rows.any():
        return mesh
    triangles = _reversed(mesh.triangles, rows)
    uvs = None if mesh.uv_triangles is None else _reversed(mesh.uv_triangles, rows)
    normals = vertex_normals(mesh.positions, triangles)
    return replace(mesh, triangles=triangles, uv_triangles=uvs, normals=normals)


def _reversed(triangles: Ints, rows: Bools) -> Ints:
    return np.where(rows[:, None], triangles[:, ::-1], triangles)
