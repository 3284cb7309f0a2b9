r"""Reader of Wavefront ``.obj`` meshes, which have no rig.

::

    obj    = line*                                   a "\" at its end continues a line
    line   = "v" x y z (w | r g b | r g b a)? | "vt" u v? w? | "vn" x y z
           | "f" corner corner corner+ | "usemtl" name | "mtllib" file | "g" name* | "o" name
           | "#" comment | other                     a comment may also follow the numbers of a line
    corner = v | v/vt | v//vn | v/vt/vn              from 1, or from -1 for the last one so far;
                                                     slashes at the end are ignored

Vertices keep their indices, including those without a face. Polygons are triangulated. A vertex
with several normals gets their mean, because a ``Mesh`` has one normal per vertex. Colours of
vertices are sRGB, 0 to 1 or 0 to 255; a texture replaces them.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import field, replace

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.formats._placeholders import neutral_positions
from viewer.formats._polygons import (
    Picks,
    axis_and_unit,
    filled_normals,
    picked,
    polygon_text,
    triangulate,
)
from viewer.formats._source import Source
from viewer.formats._text.growing_table import GrowingTable
from viewer.formats.obj.lines import (
    KEYWORDS,
    CornerFault,
    FaceRows,
    Lines,
    Places,
    checked_corners,
    number_rows,
    pieces,
    read_faces,
)
from viewer.formats.obj.mtl import read_libraries
from viewer.phrases import counted, listed, optional
from viewer.rigs.arrays import Bools, Floats, Ints, freeze
from viewer.rigs.figure import Figure
from viewer.rigs.material import Material
from viewer.rigs.mesh import Mesh
from viewer.rigs.srgb import decode_srgb

_HEAD = 4096  # number of bytes within which files written by this program state the up axis
_SHORTEST = 1e-9  # length of the mean below which unit normals cancel each other out
_WIDTHS = {"v": 3, "vt": 2, "vn": 3}  # number of values of an element
_RUNS = (b"usemtl", b"g", b"o")
_SHAPES = {b"l": "line", b"p": "point"}
# Smoothing groups, and keywords that a viewer does not need.
_QUIET = frozenset((b"s", b"lod", b"vp", b"shadow_obj", b"trace_obj", b"bevel"))


@dataclass(slots=True)
class _ObjParts:
    """Content of the file."""

    positions: Floats
    normals: Floats
    """(V, 3), (N, 3). Vectors as listed in the file."""
    uvs: Floats
    """(U, 2). Texture coordinates as listed, v = 0 at the bottom row."""
    colors: Floats | None
    """(V, 4) or None. Linear colours and opacity of the vertices; white for those without a
    colour."""
    counts: NDArray[np.integer]
    """(F,). Corners of each face."""
    corners: NDArray[np.integer]
    """(C, 3). Vertex, texture coordinate and normal of each corner; -1 if missing."""
    offsets: Places
    """(F,). Offset of each face in the file."""
    runs: dict[bytes, list[tuple[int, str]]]
    """For ``usemtl``, ``g`` and ``o``: the names, and the index of the first face after each."""
    libraries: list[tuple[bytes, int]]
    """Text after each ``mtllib``, and its offset."""


@dataclass(slots=True)
class _Gathered:
    """Parts of a file that is being read, piece by piece."""

    tables: dict[str, GrowingTable] = field(
        default_factory=lambda: {k: GrowingTable((n,), np.float64) for k, n in _WIDTHS.items()}
    )
    counts: GrowingTable = field(default_factory=lambda: GrowingTable((), np.int32))
    corners: GrowingTable = field(default_factory=lambda: GrowingTable((3,), np.int32))
    offsets: GrowingTable = field(default_factory=GrowingTable)
    faults: list[CornerFault] = field(default_factory=list)
    n_faces: int = 0
    vertices: GrowingTable = field(default_factory=GrowingTable)
    before: dict[str, int] = field(default_factory=lambda: dict.fromkeys(KEYWORDS, 0))
    runs: dict[bytes, list[tuple[int, str]]] = field(
        default_factory=lambda: {word: [] for word in _RUNS}
    )
    libraries: list[tuple[bytes, int]] = field(default_factory=list)
    odd: Counter[bytes] = field(default_factory=Counter)
    # Vertices with colours; opacity is NaN if it is missing.
    colored: list[Places] = field(default_factory=list)
    colors: list[Floats] = field(default_factory=list)
    # Number of vertices with ignored data, and the offset of the first.
    unused: dict[str, list[int]] = field(default_factory=dict)

    def leave_out(self, what: str, count: int, offset: int) -> None:
        """Count ignored data, which is reported once when the whole file has been read."""
        self.unused.setdefault(what, [0, offset])[0] += count


def read(source: Source) -> Figure:
    """Read a mesh; y up without a unit, unless a comment written by this program states them."""
    parts = _read_parts(source)
    source.release()
    if len(parts.positions) == 0:
        looks = source.looks_like()
        raise source.fault(
            "F002.obj-mesh: expected a mesh, found no `v` line{looks}",
            None if looks else source.end,
            looks=optional(" ({})", looks),
        )
    rough = neutral_positions(parts.positions, np.zeros((0, 3), np.int32))
    picks, owners = triangulate(rough, parts.corners[:, 0], parts.counts)
    triangles = picked(parts.corners[:, 0], picks).astype(np.int32)
    positions = neutral_positions(parts.positions, triangles)
    source.remember("triangles", lambda triangle: int(parts.offsets[owners[triangle]]))
    normals = _normals(source, parts)
    uvs, uv_triangles = _uvs(source, parts, picks)
    # These tables are large and no longer needed.
    parts.normals, parts.corners = parts.normals[:0].copy(), parts.corners[:0].copy()
    materials, of_face = _materials(source, parts)
    names, part_of_face = _parts_of(source, parts)
    mesh = Mesh(
        positions=freeze(positions),
        normals=freeze(filled_normals(source, normals, positions, triangles)),
        triangles=freeze(triangles),
        uvs=uvs,
        uv_triangles=uv_triangles,
        materials=materials,
        triangle_materials=of_face[owners],
        parts=names,
        triangle_parts=part_of_face[owners],
        # Scans also have the colours of their texture at the vertices.
        colors=None if any(one.image is not None for one in materials) else parts.colors,
    )
    if mesh.n_triangles == 0:
        source.warn("F007.no-faces: no faces: {n} points, not drawn", n=mesh.n_vertices)
    if uvs is None and any(material.texture for material in materials):
        source.warn("F005.obj-texture: texture without vt lines: drawn untextured")
    head = source.peek(_HEAD).decode("ascii", "replace")
    comments = "\n".join(re.findall(r"^#.*$", head, re.MULTILINE))
    up, unit = axis_and_unit(source, comments)
    return Figure(
        name=source.path.stem,
        mesh=mesh,
        up=up,
        unit=unit,
        facts=_facts(parts, mesh, has_normals=normals is not None),
    )


def _read_parts(source: Source) -> _ObjParts:
    """Read a whole file, and warn of ignored data."""
    gathered = _Gathered()
    for lines in pieces(source):
        _read_piece(source, lines, gathered)
    for what, (count, offset) in gathered.unused.items():
        if what == "w":
            source.warn("F007.obj-w: w of {n} ignored", offset, n=counted(count, "vertex"))
        else:
            source.warn(
                "F007.obj-edges: {n} with fewer than 3 corners not drawn",
                offset,
                n=counted(count, "face"),
            )
    for keyword, name in _SHAPES.items():
        if gathered.odd[keyword]:
            n = counted(gathered.odd[keyword], name)
            source.warn(f"F007.obj-{name}s: {{n}} not drawn", n=n)
    vertices = gathered.vertices.rows()
    source.remember("positions", lambda vertex: int(vertices[vertex]))
    tables = {keyword: table.rows() for keyword, table in gathered.tables.items()}
    faces = FaceRows(gathered.counts.rows(), gathered.corners.rows(), gathered.offsets.rows())
    return _ObjParts(
        positions=tables["v"],
        normals=tables["vn"],
        uvs=tables["vt"],
        colors=_colors(gathered),
        counts=faces.counts,
        corners=checked_corners(source, faces, gathered.faults, gathered.before),
        offsets=faces.offsets,
        runs=gathered.runs,
        libraries=gathered.libraries,
    )


def _read_piece(source: Source, lines: Lines, gathered: _Gathered) -> None:
    if len(lines.of["v"]):
        gathered.tables["v"].add(_positions(source, lines, gathered))
    if len(lines.of["vt"]):
        gathered.tables["vt"].add(_texture_coordinates(source, lines, gathered.before["vt"]))
    if len(lines.of["vn"]):
        normals = number_rows(source, lines, "vn", 3, gathered.before["vn"])[0]
        gathered.tables["vn"].add(normals)
    if len(lines.of["f"]):
        faces = read_faces(source, lines, gathered.before)
        _add_faces(gathered, faces)
        if len(faces.edges):
            first = int(lines.starts[lines.of["f"][faces.edges[0]]])
            gathered.leave_out("edges", len(faces.edges), lines.base + first)
            kept = np.delete(lines.of["f"], faces.edges)
            lines = replace(lines, of={**lines.of, "f": kept})
    # Names of materials, groups and objects
    for line in lines.others.tolist():
        words = lines.text(line).split(None, 1)
        rest = words[1] if len(words) > 1 else b""
        offset = lines.base + int(lines.starts[line])
        if words[0] in gathered.runs:
            face = gathered.before["f"] + int(np.searchsorted(lines.of["f"], line))
            name = rest.decode("utf-8", "surrogateescape")
            gathered.runs[words[0]].append((face, name))
        elif words[0] == b"mtllib":
            gathered.libraries.append((rest, offset))
        elif words[0] not in _QUIET:
            if words[0] not in _SHAPES and not gathered.odd[words[0]]:
                source.warn_unknown(words[0], offset, (b"usemtl", b"mtllib"))
            gathered.odd[words[0]] += 1
    for keyword, found in lines.of.items():
        gathered.before[keyword] += len(found)


def _add_faces(gathered: _Gathered, faces: FaceRows) -> None:
    first = gathered.n_faces
    gathered.n_faces += len(faces.counts)
    gathered.faults += [replace(fault, faces=fault.faces + first) for fault in faces.faults]
    gathered.counts.add(faces.counts.astype(np.int32))
    gathered.corners.add(faces.corners)
    gathered.offsets.add(faces.offsets)


def _positions(source: Source, lines: Lines, gathered: _Gathered) -> Floats:
    table, counts, values, rows = number_rows(source, lines, "v", 3, gathered.before["v"])
    gathered.vertices.add(rows.origins - 1)
    if len(values) == table.size:
        return table
    wrong = np.flatnonzero((counts == 5) | (counts > 7))
    if len(wrong):
        offset = int(rows.origins[wrong[0]]) - 1
        source.refuse(
            "F002.obj-vertex: v: expected 3 numbers, or 4, 6 or 7 with w or a colour, found "
            "{found}",
            offset,
            len(wrong),
            found=int(counts[wrong[0]]),
        )
    firsts = np.cumsum(counts) - counts
    for count in (6, 7):
        colored = np.flatnonzero(counts == count)
        if len(colored):
            gathered.colored.append(gathered.before["v"] + colored)
            columns = values[firsts[colored, None] + np.arange(3, count)]
            opaque = np.full((len(colored), 7 - count), np.nan)
            gathered.colors.append(np.hstack([columns, opaque]))
    fourth = np.flatnonzero(counts == 4)
    weighted = fourth[values[firsts[fourth] + 3] != 1.0]
    if len(weighted):
        gathered.leave_out("w", len(weighted), int(rows.origins[weighted[0]]) - 1)
    return table


def _texture_coordinates(source: Source, lines: Lines, first: int) -> Floats:
    table, counts, values, _ = number_rows(source, lines, "vt", 1, first)
    uvs = np.zeros((len(counts), 2))
    uvs[:, :1] = table
    firsts = np.cumsum(counts) - counts
    has_v = counts > 1
    uvs[has_v, 1] = values[firsts[has_v] + 1]
    return uvs


def _colors(gathered: _Gathered) -> Floats | None:
    """Return linear colours from sRGB; some programs write 0 to 255 instead of 0 to 1."""
    if not gathered.colored:
        return None
    listed = np.concatenate(gathered.colors)
    opacity = np.nan_to_num(listed[:, 3], nan=1.0)
    bytes_or_fractions = np.nan_to_num(listed[:, :3])
    largest = 255.0 if bytes_or_fractions.max() > 1.0 else 1.0
    colors = np.ones((gathered.before["v"], 4))
    rows = np.concatenate(gathered.colored)
    colors[rows, :3] = decode_srgb(np.clip(bytes_or_fractions / largest, 0.0, 1.0))
    colors[rows, 3] = np.clip(opacity / (255.0 if opacity.max() > 1.0 else 1.0), 0.0, 1.0)
    return colors


def _normals(source: Source, parts: _ObjParts) -> Floats | None:
    """Return a normal for every vertex; NaN if no corner has one."""
    listed, n_vertices = parts.normals, len(parts.positions)
    if len(listed) == 0:
        return None
    used: Bools = parts.corners[:, 2] >= 0
    if not used.any():
        source.warn("F007.obj-normals: omitted {n} normals not used by any face", n=len(listed))
        return None
    if np.isnan(listed.sum()):
        # Invalid normals are computed from the triangles instead.
        used &= ~np.isnan(listed.sum(axis=1)[parts.corners[:, 2]])
    vertices, indices = parts.corners[:, 0], parts.corners[:, 2]
    if not used.all():
        vertices, indices = vertices[used], indices[used]
    # Most vertices have the same normal at all corners, so only few need to be compared.
    chosen = np.full(n_vertices, -1, dtype=indices.dtype)
    chosen[vertices] = indices
    others = np.flatnonzero(chosen[vertices] != indices)
    result = listed[chosen]
    result[chosen < 0] = np.nan
    differs = (result[vertices[others]] != listed[indices[others]]).any(axis=1)
    several = np.bincount(vertices[others], differs, minlength=n_vertices) > 0
    if several.any():
        first = int(several.argmax())
        source.warn(
            "F007.obj-hard-edges: {n} several normals (first: vertex {vertex}): averaged, so "
            "hard edges are drawn smooth",
            None,
            1,
            "positions",
            [first],
            n=counted(int(several.sum()), "vertex", "has", "have"),
            vertex=first,
        )
        result[several] = _means(n_vertices, vertices, indices, listed)[several]
    return result


def _means(n_vertices: int, vertices: Picks, indices: Picks, listed: Floats) -> Floats:
    """Return the mean of each vertex's distinct normals: (V, 3)."""
    # Products of two counts exceed 32 bits in files of some 50,000 vertices.
    pairs = np.unique(vertices.astype(np.int64) * len(listed) + indices)
    owners, normals = pairs // len(listed), listed[pairs % len(listed)]
    sums = np.stack(
        [np.bincount(owners, normals[:, axis], minlength=n_vertices) for axis in range(3)], axis=1
    )
    lengths = np.linalg.norm(sums, axis=1, keepdims=True)
    return np.divide(sums, lengths, out=np.zeros_like(sums), where=lengths > _SHORTEST)


def _uvs(source: Source, parts: _ObjParts, picks: Picks) -> tuple[Floats | None, Ints | None]:
    """Return the table of texture coordinates, and their index for each triangle corner."""
    # Invalid values are NaN, which a single sum detects.
    uvs = np.nan_to_num(parts.uvs) if np.isnan(parts.uvs.sum()) else parts.uvs
    if len(uvs) == 0:
        return None, None
    corners = picked(parts.corners[:, 1], picks)
    absent = corners < 0
    if absent.all():
        source.warn(
            "F007.obj-texcoords: omitted {n} texture coordinates not used by any face", n=len(uvs)
        )
        return None, None
    if absent.any():
        source.warn(
            "F007.obj-corners: {n} without vt: 0 0 used",
            n=counted(int(absent.sum()), "triangle corner"),
        )
        corners = np.where(absent, len(uvs), corners)
        uvs = np.vstack([uvs, [0.0, 0.0]])
    return uvs, corners.astype(np.int32)


def _materials(source: Source, parts: _ObjParts) -> tuple[tuple[Material, ...], Ints]:
    """Return the materials, or names of groups without ``usemtl``, and the index of each face's."""
    used = parts.runs[b"usemtl"]
    by_name = bool(used)
    if not used:
        used = sorted(parts.runs[b"g"] + parts.runs[b"o"], key=lambda run: run[0])
    if not by_name and len({name for _, name in used}) < 2:
        used = []
    names, of_face = _named(used, len(parts.counts))
    if by_name:
        return read_libraries(source, parts.libraries, names), of_face
    return tuple(map(Material, names)), of_face


def _named(runs: Sequence[tuple[int, str]], count: int) -> tuple[list[str], Ints]:
    """Return the distinct names of runs of faces, and the index of the name of each face, or -1."""
    names = list(dict.fromkeys(name for _, name in runs))
    numbers = {name: index for index, name in enumerate(names)}
    of_run = np.array([-1, *(numbers[name] for _, name in runs)], dtype=np.int32)
    first = [face for face, _ in runs]
    return names, of_run[np.searchsorted(first, np.arange(count), side="right")]


def _parts_of(source: Source, parts: _ObjParts) -> tuple[tuple[str, ...], Ints]:
    """Return two or more names of objects, or else of groups, and the index of each face's name."""
    objects, groups = ({name: None for _, name in parts.runs[word]} for word in (b"o", b"g"))
    within = [name for name in groups if name and name not in objects]
    if len(objects) > 1 and len(within) > 1 and parts.runs[b"usemtl"]:
        source.warn(
            "F007.obj-groups: {n} within objects ignored, as a face has one part: {names}",
            n=counted(len(within), "group"),
            names=listed(within, 8),
        )
    for word in (b"o", b"g"):
        names, of_face = _named(parts.runs[word], len(parts.counts))
        used = np.unique(of_face[of_face >= 0])
        if len(used) > 1:
            numbers = np.full(len(names) + 1, -1, dtype=np.int32)
            numbers[used] = np.arange(len(used))
            return tuple(names[index] for index in used.tolist()), numbers[of_face]
    return (), np.full(len(parts.counts), -1, dtype=np.int32)


def _facts(parts: _ObjParts, mesh: Mesh, has_normals: bool) -> tuple[tuple[str, str], ...]:
    facts = []
    if (parts.counts > 3).any():
        facts.append(("polygons", polygon_text(parts.counts, mesh.n_triangles)))
    if not has_normals:
        facts.append(("normals", "none in the file: computed from the triangles"))
    objects = {name for _, name in parts.runs[b"o"]}
    if len(objects) == 1 and "" not in objects:
        facts.append(("object", objects.pop()))
    names = {name for word in (b"g", b"o") for _, name in parts.runs[word]}
    if len(names) > 1:
        facts.append(("parts", f"{len(names)} groups and objects"))
    return tuple(facts)
