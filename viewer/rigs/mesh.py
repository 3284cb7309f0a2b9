"""A triangle mesh with normals, texture coordinates and materials."""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.rigs.arrays import Bools, Floats, Ints, freeze_fields, frozen
from viewer.rigs.checked_fields import checked

if TYPE_CHECKING:
    from viewer.rigs.material import Material

PartView: TypeAlias = Literal["both", "auto", "third-person", "first-person", "hidden"]
"""Whether a part is drawn from outside, from the character's eyes, in both views, or in none.

``"auto"`` parts are drawn from outside and, unless they have triangles that move with the head,
from the eyes.
"""

_FLAT = 1e-7  # height of a triangle within float32 rounding, relative to the mesh
_SAMPLE = 4096  # number of vertices sampled for the median
_ROW = 64  # points per row of a reduction, see bounding_box


@checked
@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class Mesh:
    """An indexed triangle mesh, in the bind pose."""

    positions: Floats
    normals: Floats
    """(V, 3). Figure units; normals as stored, not necessarily of unit length."""
    triangles: Ints
    """(T, 3) int32. Vertex indices; counter-clockwise from outside in most files, on which no code
    relies."""
    uvs: Floats | None = None
    """(U, 2) or None. Texture coordinates, v = 0 at the bottom row of the image."""
    materials: tuple[Material, ...] = ()
    """In file order."""
    triangle_materials: Ints | None = None
    """(T,) int32. Index into ``materials``, -1 for none."""
    uv_triangles: Ints | None = None
    """(T, 3) int32 or None. Indices into ``uvs`` if they differ from ``triangles``: along a seam,
    one vertex has several texture coordinates. None if every vertex has exactly one; then U = V."""
    other_uvs: tuple[Floats, ...] = ()
    """tuple of (U, 2). Further texture coordinates for each row of ``uvs``, for textures that refer
    to these sets."""
    colors: Floats | None = None
    """(V, 4) or None. Linear vertex colours and opacity, 0 to 1, which multiply the materials' base
    colours."""
    parts: tuple[str, ...] = ()
    """Names of the parts that can be hidden; may repeat or be empty."""
    triangle_parts: Ints | None = None
    """(T,) int32. Index into ``parts``, -1 for none."""
    part_views: tuple[PartView, ...] = ()
    """The views in which the parts are drawn; empty if all are drawn in both."""

    def __post_init__(self) -> None:
        def put(name: str, values: object) -> None:
            object.__setattr__(self, name, values)

        freeze_fields(self, positions=(None, 3))
        freeze_fields(self, normals=(self.n_vertices, 3))
        freeze_fields(self, np.int32, triangles=(None, 3))
        freeze_fields(self, uvs=(self.n_vertices if self.uv_triangles is None else None, 2))
        rows = 0 if self.uvs is None else len(self.uvs)
        put("other_uvs", tuple(frozen("other_uvs", uvs, (rows, 2)) for uvs in self.other_uvs))
        freeze_fields(self, np.int32, uv_triangles=(self.n_triangles, 3))
        freeze_fields(self, colors=(self.n_vertices, 4))
        for name in ("triangle_materials", "triangle_parts"):
            given = getattr(self, name)
            if name == "triangle_parts" and not self.parts and np.all(np.asarray(given) == -1):
                # The array may belong to a mesh with other triangles, copied by
                # ``dataclasses.replace``.
                given = None
            values = np.full(self.n_triangles, -1, dtype=np.int32) if given is None else given
            put(name, frozen(name, values, (self.n_triangles,), np.int32))
        self._check_indices()

    def _check_indices(self) -> None:
        if self.n_triangles == 0:
            return
        _check_range("triangles", self.triangles, self.n_vertices)
        if self.uv_triangles is not None:
            _check_range(
                "uv_triangles", self.uv_triangles, 0 if self.uvs is None else len(self.uvs)
            )
        for name, indices, count in (
            ("triangle_materials", self.material_indices, len(self.materials)),
            ("triangle_parts", self.part_indices, len(self.parts)),
        ):
            if indices.min() < -1 or indices.max() >= count:
                raise RigError(
                    f"{name}: expected -1 to {count - 1}, found {indices.min()} to {indices.max()}"
                )

    @property
    def n_vertices(self) -> int:
        """Number of vertices, V."""
        return len(self.positions)

    @property
    def n_triangles(self) -> int:
        """Number of triangles, T."""
        return len(self.triangles)

    @property
    def material_indices(self) -> Ints:
        """``triangle_materials``, never None: (T,) int32."""
        assert self.triangle_materials is not None  # set by __post_init__
        return self.triangle_materials

    @property
    def part_indices(self) -> Ints:
        """``triangle_parts``, never None: (T,) int32."""
        assert self.triangle_parts is not None  # set by __post_init__
        return self.triangle_parts


def _check_range(name: str, indices: Ints, end: int) -> None:
    """Raise RigError unless all indices are from 0 to ``end`` - 1."""
    if indices.min() < 0 or indices.max() >= end:
        raise RigError(
            f"{name}: expected vertex indices 0 to {end - 1}, "
            f"found {indices.min()} to {indices.max()}"
        )


def bounding_box(points: Floats) -> Floats:
    """Return the lowest and highest corner (2, 3) of points (N, 3); zeros without points."""
    if len(points) == 0:
        return np.zeros((2, 3))
    # Rows of 64 points reduce ten times faster than rows of three numbers.
    whole = len(points) - len(points) % _ROW
    wide = points[:whole].reshape(-1, 3 * _ROW)
    if len(wide) == 0:
        return np.stack([points.min(axis=0), points.max(axis=0)])
    low = np.vstack([wide.min(axis=0).reshape(_ROW, 3), points[whole:]]).min(axis=0)
    high = np.vstack([wide.max(axis=0).reshape(_ROW, 3), points[whole:]]).max(axis=0)
    return np.stack([low, high])


def box_size(box: Floats) -> float:
    """Return the length of a box's diagonal, the "size" to which tolerances refer."""
    return math.dist(*box.tolist())


def triangle_areas(positions: Floats, triangles: Ints) -> Floats:
    """Return each triangle's area (T,), |(b - a) x (c - a)| / 2."""
    return 0.5 * np.linalg.norm(area_vectors(positions, triangles), axis=1)


def side_lengths(positions: Floats, triangles: Ints) -> Floats:
    """Return the lengths of each triangle's sides, from each corner to the next: (T, 3)."""
    corners = positions[triangles]
    lengths: Floats = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    return lengths


def flat_triangles(mesh: Mesh) -> Bools:
    """Return which triangles have no area within float32 rounding: (T,)."""
    edges = side_lengths(mesh.positions, mesh.triangles).max(axis=1)
    areas = triangle_areas(mesh.positions, mesh.triangles)
    # The height over the longest edge; 0 for a point.
    heights = np.divide(2.0 * areas, edges, out=np.zeros_like(areas), where=edges > 0.0)
    flat: Bools = heights <= _FLAT * typical_place(mesh)[1]
    return flat


def typical_place(mesh: Mesh) -> tuple[Floats, float]:
    """Return the median of the mesh and the median distance from it, both robust to strays."""
    some = mesh.positions[:: max(1, mesh.n_vertices // _SAMPLE)]
    center = _median(some)
    return center, float(_median(np.abs(some - center).max(axis=1)))


def _median(values: Floats) -> Floats:
    """Return the median along the first axis; ``np.median`` imports numpy.ma, which takes 14 ms."""
    low, high = (len(values) - 1) // 2, len(values) // 2
    parted = np.partition(values, (low, high), axis=0)
    middle: Floats = (parted[low] + parted[high]) / 2.0
    return middle


def volume(positions: Floats, triangles: Ints) -> float:
    """Return the volume inside a closed mesh: sum a . (b x c) / 6; negative if it is clockwise."""
    # All tetrahedra share the mean as a corner, so that a small hole changes the sum only slightly.
    centered = positions - positions.mean(axis=0)
    a, b, c = (centered[triangles[:, corner]] for corner in range(3))
    return float(np.einsum("ta,ta->", a, np.cross(b, c)) / 6.0)


def split_seams(mesh: Mesh) -> tuple[Ints, Ints, Ints]:
    """Split vertices along texture seams, so that each has one texture coordinate, as on GPUs.

    Returns the vertex of the mesh (R,) and the texture coordinate (R,) of each split vertex, those
    without triangles included, and the triangles (T, 3) as indices of split vertices.
    """
    if mesh.uv_triangles is None or mesh.uvs is None:
        identity = np.arange(mesh.n_vertices, dtype=np.int32)
        return identity, identity, mesh.triangles
    # Only corners with an additional texture coordinate of their vertex are sorted; these are few.
    corners, uvs, n_uvs = mesh.triangles.ravel(), mesh.uv_triangles.ravel(), len(mesh.uvs)
    lowest = np.full(mesh.n_vertices, n_uvs, dtype=np.int32)
    np.minimum.at(lowest, corners, uvs)
    further = np.flatnonzero(uvs != lowest[corners])
    pairs = corners[further].astype(np.int64) * n_uvs + uvs[further]
    pairs, which = np.unique(pairs, return_inverse=True)
    owners = pairs // n_uvs
    is_used, n_further = lowest < n_uvs, np.bincount(owners, minlength=mesh.n_vertices)
    counts = is_used + n_further
    starts = np.cumsum(counts) - counts
    # Additional copies of a vertex keep their order among all additional copies.
    places = starts[owners] + 1 + np.arange(len(pairs)) - (np.cumsum(n_further) - n_further)[owners]
    triangles = starts[corners]
    triangles[further] = places[which]
    copies = np.repeat(np.arange(mesh.n_vertices), counts)
    sources = np.concatenate([copies, np.flatnonzero(~is_used)]).astype(np.int32)
    uv_indices = np.zeros(len(sources), dtype=np.int32)
    uv_indices[starts[is_used]] = lowest[is_used]
    uv_indices[places] = pairs % n_uvs
    return sources, uv_indices, triangles.reshape(-1, 3).astype(np.int32)


def without_seams(mesh: Mesh) -> tuple[Mesh, Ints]:
    """Return a mesh of R vertices split along texture seams, and their original vertices (R,)."""
    sources, uv_indices, triangles = split_seams(mesh)
    return Mesh(
        positions=mesh.positions[sources],
        normals=mesh.normals[sources],
        triangles=triangles,
        uvs=None if mesh.uvs is None else mesh.uvs[uv_indices],
        materials=mesh.materials,
        triangle_materials=mesh.triangle_materials,
        other_uvs=tuple(uvs[uv_indices] for uvs in mesh.other_uvs),
        colors=None if mesh.colors is None else mesh.colors[sources],
        parts=mesh.parts,
        triangle_parts=mesh.triangle_parts,
        part_views=mesh.part_views,
    ), sources


def vertex_normals(positions: Floats, triangles: Ints) -> Floats:
    """Return unit normals (V, 3), triangles weighted by area; +y where no triangle has an area."""
    vectors = area_vectors(positions, triangles)
    corners = triangles.ravel()
    columns = [
        np.bincount(corners, np.repeat(vectors[:, axis], 3), minlength=len(positions))
        for axis in range(3)
    ]
    normals = np.stack(columns, axis=1)
    lengths = np.linalg.norm(normals, axis=1)
    flat: Bools = lengths == 0.0
    normals[flat] = 0.0, 1.0, 0.0
    return normals / np.where(flat, 1.0, lengths)[:, None]


def visible_triangles(mesh: Mesh, hidden: Collection[int]) -> Bools:
    """Return a mask (T,) of the triangles that are not in a hidden part."""
    shown: Bools = ~np.isin(mesh.part_indices, list(hidden))
    return shown


def visible_vertices(mesh: Mesh, hidden: Collection[int]) -> Bools:
    """Return a mask of the vertices that are not used by hidden triangles alone: (V,) bool."""
    shown = visible_triangles(mesh, hidden)
    visible = np.ones(mesh.n_vertices, dtype=np.bool_)
    visible[mesh.triangles[~shown]] = False
    visible[mesh.triangles[shown]] = True
    return visible


def area_vectors(positions: Floats, triangles: Ints) -> Floats:
    """Return (b - a) x (c - a) of each triangle (T, 3): its normal, scaled to twice its area."""
    a, b, c = (positions[triangles[:, corner]] for corner in range(3))
    return np.cross(b - a, c - a)


def hidden_parts(mesh: Mesh | None) -> frozenset[int]:
    """Return the parts that are not drawn from outside, and therefore start hidden."""
    views = () if mesh is None else mesh.part_views
    return frozenset(part for part, view in enumerate(views) if view in ("first-person", "hidden"))
