"""Contents of an ``.obj`` as arrays, before they are converted to a mesh."""

from __future__ import annotations

from collections import Counter
from dataclasses import field, replace

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.formats._obj.faces import FEWEST, CornerFault, FaceRows, read_faces
from viewer.formats._obj.faulty_lines import checked_corners, faulty_faces, faulty_rows
from viewer.formats._obj.lines import (
    KEYWORDS,
    Lines,
    NumberRows,
    Places,
    number_rows,
    pieces,
    without_comments,
)
from viewer.formats._source import Source
from viewer.formats._text.growing_table import GrowingTable
from viewer.rig.arrays import Floats
from viewer.rig.srgb import decode_srgb

__all__ = ["ObjParts", "read_parts"]

# Smoothing groups, and keywords that a viewer does not need.
_QUIET = frozenset((b"s", b"lod", b"vp", b"shadow_obj", b"trace_obj", b"bevel"))
_SHAPES = {b"l": "line", b"p": "point"}
_WIDTHS = {"v": 3, "vt": 2, "vn": 3}  # number of values of an element
_RUNS = (b"usemtl", b"g", b"o")
_NO_FACES = FaceRows(np.zeros(0, np.int64), np.zeros((0, 3), np.int64), np.zeros(0, np.int64))


@dataclass(slots=True)
class ObjParts:
    """Content of the file.

    Attributes
    ----------
    positions, normals : (V, 3), (N, 3)
        Vectors as listed in the file.
    uvs : (U, 2)
        Texture coordinates as listed, v = 0 at the bottom row.
    colors : (V, 4) or None
        Linear colours and opacity of the vertices; white for those without a colour.
    counts : (F,)
        Corners of each face.
    corners : (C, 3)
        Vertex, texture coordinate and normal of each corner; -1 if missing.
    offsets : (F,)
        Offset of each face in the file.
    runs : dict of bytes to list of (int, str)
        For ``usemtl``, ``g`` and ``o``: the names, and the index of the first face after each.
    libraries : list of (bytes, int)
        Text after each ``mtllib``, and its offset.
    """

    positions: Floats
    normals: Floats
    uvs: Floats
    colors: Floats | None
    counts: NDArray[np.integer]
    corners: NDArray[np.integer]
    offsets: Places
    runs: dict[bytes, list[tuple[int, str]]]
    libraries: list[tuple[bytes, int]]


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


def read_parts(source: Source) -> ObjParts:
    """Read a whole file.

    Parameters
    ----------
    source : Source
        The file; ignored data is added to its warnings.

    Raises
    ------
    FormatError
        If a line violates the grammar or has an index out of range.
    """
    gathered = _Gathered()
    for lines in pieces(source):
        _read_piece(source, lines, gathered)
    for what, (count, offset) in gathered.unused.items():
        source.warn(f"F007.obj-{what}", offset, n=count)
    for keyword, name in _SHAPES.items():
        if gathered.odd[keyword]:
            source.warn(f"F007.obj-{name}s", n=gathered.odd[keyword])
    vertices = gathered.vertices.rows()
    source.remember("positions", lambda vertex: int(vertices[vertex]))
    tables = {keyword: table.rows() for keyword, table in gathered.tables.items()}
    faces = FaceRows(gathered.counts.rows(), gathered.corners.rows(), gathered.offsets.rows())
    return ObjParts(
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


def _read_piece(source: Source, lines: Lines, gathered: _Gathered) -> None:
    for keyword, read in (("v", _positions), ("vt", _uvs), ("vn", _normals)):
        if len(lines.of[keyword]):
            gathered.tables[keyword].add(read(source, lines, gathered))
    if len(lines.of["f"]):
        faces = read_faces(lines, gathered.before)
        if faces is None:
            lines = _without_edges(lines, gathered)
            faces = read_faces(lines, gathered.before) if len(lines.of["f"]) else _NO_FACES
        _add_faces(gathered, faces or faulty_faces(source, lines, gathered.before))
    _read_others(source, lines, gathered)
    for keyword, found in lines.of.items():
        gathered.before[keyword] += len(found)


def _without_edges(lines: Lines, gathered: _Gathered) -> Lines:
    """Return lines without faces of one or two corners, once Blender's form of loose edges."""
    counts = np.array(
        [len(without_comments(lines.text(line)).split()) - 1 for line in lines.of["f"].tolist()]
    )
    is_edge = (counts > 0) & (counts < FEWEST)
    if not is_edge.any():
        return lines
    first = lines.base + int(lines.starts[lines.of["f"][is_edge.argmax()]])
    gathered.leave_out("edges", int(is_edge.sum()), first)
    return replace(lines, of={**lines.of, "f": lines.of["f"][~is_edge]})


def _add_faces(gathered: _Gathered, faces: FaceRows) -> None:
    first = gathered.n_faces
    gathered.n_faces += len(faces.counts)
    gathered.faults += [replace(fault, faces=fault.faces + first) for fault in faces.faults]
    gathered.counts.add(faces.counts.astype(np.int32))
    gathered.corners.add(faces.corners)
    gathered.offsets.add(faces.offsets)


def _rows(
    source: Source, lines: Lines, gathered: _Gathered, keyword: str, width: int
) -> NumberRows:
    found = number_rows(lines, keyword, width)
    return found or faulty_rows(source, lines, keyword, width, gathered.before[keyword])


def _positions(source: Source, lines: Lines, gathered: _Gathered) -> Floats:
    table, counts, values, rows = _rows(source, lines, gathered, "v", 3)
    gathered.vertices.add(rows.origins - 1)
    if len(values) == table.size:
        return table
    wrong = np.flatnonzero((counts == 5) | (counts > 7))
    if len(wrong):
        offset = int(rows.origins[wrong[0]]) - 1
        source.refuse("F002.obj-vertex", offset, len(wrong), found=int(counts[wrong[0]]))
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


def _uvs(source: Source, lines: Lines, gathered: _Gathered) -> Floats:
    table, counts, values, _ = _rows(source, lines, gathered, "vt", 1)
    uvs = np.zeros((len(counts), 2))
    uvs[:, :1] = table
    firsts = np.cumsum(counts) - counts
    has_v = counts > 1
    uvs[has_v, 1] = values[firsts[has_v] + 1]
    return uvs


def _normals(source: Source, lines: Lines, gathered: _Gathered) -> Floats:
    return _rows(source, lines, gathered, "vn", 3)[0]


def _read_others(source: Source, lines: Lines, gathered: _Gathered) -> None:
    """Record names of materials, groups and objects; warn about unknown keywords."""
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
                source.warn("F006.unknown", offset, found=words[0])
            gathered.odd[words[0]] += 1
