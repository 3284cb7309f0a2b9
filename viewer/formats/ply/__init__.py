"""Reader of ``.ply`` meshes (Stanford polygons), text or binary of either byte order; no rig.

::

    ply      = "ply" format line* "end_header" rows
    line     = "comment" text | "element" name count | "property" type name
             | "property" "list" type type name

Properties used: x y z, nx ny nz, s t (or u v, texture_u texture_v), red green blue alpha of
``vertex``; the corners (``vertex_indices`` or ``vertex_index``) and ``texcoord``, two numbers per
corner, of ``face``. Colours are sRGB, integers or numbers from 0 to 1; alpha may be missing. A
comment ``TextureFile`` names a texture image, which replaces them. Polygons are triangulated;
other data is ignored with a warning that names it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.diagnostics import wording
from viewer.formats._placeholders import neutral_positions
from viewer.formats._polygons import (
    axis_and_unit,
    filled_normals,
    first_known,
    picked,
    polygon_text,
    triangles_of,
    triangulate,
)
from viewer.formats._references import load_image
from viewer.formats._source import Source
from viewer.formats._text.numbers import LARGEST
from viewer.formats.ply.elements import CORNERS, Header, Table, read_header, read_tables
from viewer.phrases import counted, listed, printable
from viewer.rigs.arrays import Floats, Ints, freeze
from viewer.rigs.figure import Figure
from viewer.rigs.material import Material, Texture
from viewer.rigs.mesh import Mesh
from viewer.rigs.srgb import decode_srgb

_Indices = NDArray[np.integer]
_UVS = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"))
_COLORS = ("red", "green", "blue", "alpha")
_TEXTURE = "texturefile"


def read(source: Source) -> Figure:
    """Read a mesh; y up without a unit, unless a comment written by this program states them."""
    header = read_header(source)
    tables = read_tables(source, header)
    vertices, positions = _vertices(source, header, tables)
    counts, corners, uv_corners = _faces(source, tables, len(positions))
    rough = neutral_positions(positions, np.zeros((0, 3), np.int32))
    picks, owners = triangulate(rough, corners, counts)
    triangles = picked(corners, picks).astype(np.int32, copy=False)
    positions = neutral_positions(positions, triangles)
    _remember(source, tables, owners)
    normals = _columns(source, vertices, ("nx", "ny", "nz"))
    uvs, uv_triangles = _uvs(source, vertices, uv_corners, picks)
    materials = _materials(source, header, uvs is not None)
    # Scans also have the colours of their texture at the vertices.
    is_painted = any(material.image is not None for material in materials)
    colors = None if is_painted else _colors(source, vertices)
    vertices.columns.clear()  # the values of the file, which take more memory than the mesh
    mesh = Mesh(
        positions=freeze(positions),
        normals=freeze(filled_normals(source, normals, positions, triangles)),
        triangles=freeze(triangles),
        uvs=uvs,
        uv_triangles=uv_triangles,
        colors=colors,
        materials=materials,
        triangle_materials=np.zeros(len(owners), np.int32) if materials else None,
    )
    _report(source, tables, uv_corners is not None, is_painted)
    if mesh.n_triangles == 0:
        source.warn(
            "F007.ply-no-faces: no faces: {n}, not drawn", n=counted(mesh.n_vertices, "point")
        )
    up, unit = axis_and_unit(source, "\n".join(text for text, _ in header.comments))
    facts = []
    if (counts > 3).any():
        facts.append(("polygons", polygon_text(counts, mesh.n_triangles)))
    if normals is None:
        facts.append(("normals", "none in the file: computed from the triangles"))
    return Figure(
        name=source.path.stem,
        mesh=mesh,
        up=up,
        unit=unit,
        facts=tuple(facts),
    )


def _remember(source: Source, tables: dict[str, Table], owners: _Indices) -> None:
    """Register the offsets of vertices and triangles in a text file."""
    if (vertices := tables["vertex"].offset_of) is not None:
        source.remember("positions", vertices)
    if "face" in tables and (faces := tables["face"].offset_of) is not None:
        source.remember("triangles", lambda triangle: faces(int(owners[triangle])))


def _vertices(source: Source, header: Header, tables: dict[str, Table]) -> tuple[Table, Floats]:
    """Return the element of the vertices, and their positions."""
    if "vertex" not in tables:
        if not tables:
            raise source.fault(
                "F002.ply-nothing: expected a vertex element, found none", header.end - 1
            )
        names = [printable(name, 40) for name in tables]
        raise source.fault(
            "F002.ply-no-vertex: expected a vertex element, found {names}",
            header.end - 1,
            names=listed(names, 12),
        )
    vertices = tables["vertex"]
    positions = _columns(source, vertices, ("x", "y", "z"))
    if positions is None:
        raise source.fault(
            "F002.ply-coordinates: vertex element has no x, y and z properties",
            vertices.element.offset,
        )
    if len(positions) == 0:
        raise source.fault(
            "F002.ply-vertices: expected at least one vertex, found none", vertices.element.offset
        )
    return vertices, positions


def _columns(source: Source, table: Table, names: tuple[str, ...]) -> Floats | None:
    """Return properties as columns (N, len(names)), NaN in invalid rows; None if one is missing."""
    if any(name not in table.columns for name in names):
        return None
    with np.errstate(over="ignore"):
        values = np.empty((table.element.count, len(names)))
        for column, name in enumerate(names):
            values[:, column] = table.columns[name]
    # A single NaN makes the extremes NaN.
    if len(values) == 0 or (values.min() >= -LARGEST and values.max() <= LARGEST):
        return values
    odd = np.flatnonzero(~(np.abs(values) <= LARGEST).all(axis=1))
    if len(odd):
        if table.offset_of is None:
            row = values[odd[0]]
            is_place = names == ("x", "y", "z")
            source.refuse(
                wording.PLY_FINITE,
                None,
                int((~(np.abs(values) <= LARGEST)).sum()),
                "positions" if is_place else "",
                odd if is_place else None,
                item=table.row(int(odd[0])),
                names=" ".join(names),
                found=float(row[~(np.abs(row) <= LARGEST)][0]),
            )
        values[odd] = np.nan
    return values


def _faces(
    source: Source, tables: dict[str, Table], n_vertices: int
) -> tuple[_Indices, _Indices, Floats | None]:
    """Return corner counts of the faces, all corners, and their texture coordinates if any."""
    faces = tables.get("face")
    nothing = np.zeros(0, np.int64)
    if faces is None:
        if "tristrips" in tables:
            raise source.fault(
                "F002.ply-strips: expected a face element, found tristrips",
                tables["tristrips"].element.offset,
            )
        return nothing, nothing, None
    name = next((name for name in CORNERS if name in faces.lists), None)
    if name is None:
        raise source.fault(
            "F002.ply-no-corners: face: expected a vertex_indices list, found none",
            faces.element.offset,
        )
    counts, values = faces.lists[name]
    corners = _corners(source, faces, counts, values, n_vertices)
    small = counts < 3
    uvs = _wedges(source, faces, counts)
    faces.lists.clear()
    del values
    if small.any():
        source.warn(
            "F007.ply-small-faces: omitted {n} with fewer than 3 corners (first: face {face})",
            n=counted(int(small.sum()), "face"),
            face=int(small.argmax()),
        )
        keeps = np.repeat(~small, counts)
        counts, corners = counts[~small], corners[keeps]
        uvs = None if uvs is None else uvs[keeps]
    return counts, corners, uvs


def _corners(
    source: Source, faces: Table, counts: _Indices, values: NDArray[Any], n_vertices: int
) -> _Indices:
    """Return the vertices of all faces; invalid ones are replaced by others of the same face."""
    # A single NaN makes the extremes NaN.
    if len(values) and values.min() >= 0 and values.max() < n_vertices:
        corners = values.astype(np.int32, copy=False)
        if values.dtype.kind in "iu" or (corners == values).all():
            return corners
    corners = np.clip(np.nan_to_num(values, nan=-1.0), -1.0, n_vertices).astype(np.int64)
    is_wrong = (corners != values) | (corners < 0) | (corners >= n_vertices)
    if not is_wrong.any():
        return corners
    owners = np.repeat(np.arange(len(counts)), counts)
    # Words of a text that are not numbers have already been recorded.
    wrong = np.flatnonzero(
        is_wrong & ~np.isnan(values) if faces.offset_of is not None else is_wrong
    )
    if len(wrong):
        face = int(owners[wrong[0]])
        source.refuse(
            "F002.ply-corner: face {face}: expected a vertex index from 0 to {last}, found "
            "{found:g}",
            faces.offset(face),
            len(wrong),
            "triangles",
            triangles_of(counts, owners[wrong]),
            face=face,
            last=n_vertices - 1,
            found=float(values[wrong[0]]),
        )
    corners[is_wrong] = -1
    return first_known(corners, counts, owners)


def _wedges(source: Source, faces: Table, counts: _Indices) -> Floats | None:
    """Return texture coordinates of corners, (C, 2), if every face has two numbers per corner."""
    if "texcoord" not in faces.lists:
        return None
    found, values = faces.lists["texcoord"]
    wrong = np.flatnonzero(found != 2 * counts)
    if len(wrong):
        source.warn(
            "F007.ply-texcoord: texcoord of {n} does not have two numbers per corner (first: "
            "face {face}): texture coordinates omitted",
            n=counted(len(wrong), "face"),
            face=int(wrong[0]),
        )
        return None
    uvs = values.astype(np.float64).reshape(-1, 2)
    odd = np.flatnonzero(~(np.abs(uvs) <= LARGEST).all(axis=1))
    if len(odd):
        if faces.offset_of is None:
            face = int(np.searchsorted(np.cumsum(counts), odd[0], side="right"))
            source.refuse(
                wording.PLY_FINITE,
                count=len(odd),
                item=faces.row(face),
                names="texcoord",
                found=float(uvs[odd[0]].max()),
            )
        uvs = np.where(np.abs(uvs) <= LARGEST, uvs, 0.0)
    return uvs


def _uvs(
    source: Source, vertices: Table, wedges: Floats | None, picks: _Indices
) -> tuple[Floats | None, Ints | None]:
    """Return texture coordinates: distinct ones of corners, or the coordinates of vertices."""
    if wedges is not None and len(wedges):
        # Each pair is viewed as one complex number, so that sorting finds equal pairs.
        pairs = np.ascontiguousarray(wedges + 0.0).view(np.complex128).ravel()
        unique, inverse = np.unique(pairs, return_inverse=True)
        uvs = np.stack([unique.real, unique.imag], axis=1)
        return uvs, inverse[picks].astype(np.int32)
    for names in _UVS:
        uvs_of_vertices = _columns(source, vertices, names)
        if uvs_of_vertices is not None:
            return np.nan_to_num(uvs_of_vertices), None
    return None, None


def _colors(source: Source, vertices: Table) -> Floats | None:
    """Return linear colours with opacity: bytes and other integers are fractions of the largest."""
    names = _COLORS[:4] if _COLORS[3] in vertices.columns else _COLORS[:3]
    values = _columns(source, vertices, names)
    if values is None:
        return None
    kinds = {prop.name: np.dtype(prop.kind) for prop in vertices.element.properties}
    largest = [
        1.0 if kinds[name].kind == "f" else float(np.iinfo(kinds[name]).max) for name in names
    ]
    colors = np.ones((len(values), 4))
    colors[:, : len(names)] = np.clip(np.nan_to_num(values) / largest, 0.0, 1.0)
    colors[:, :3] = decode_srgb(colors[:, :3])
    return colors


def _materials(source: Source, header: Header, has_uvs: bool) -> tuple[Material, ...]:
    """Return a material, for all faces, with the image that a comment specifies."""
    named = [
        (text.split(None, 1)[1].strip(), offset)
        for text, offset in header.comments
        if text.lower().startswith(_TEXTURE) and len(text.split(None, 1)) > 1
    ]
    if not named or not has_uvs:
        return ()
    if len(named) > 1:
        source.warn(
            "F007.ply-textures: {n} textures: only the first one is used", named[1][1], n=len(named)
        )
    name, offset = named[0]
    return (Material(name, Texture(name, load_image(source, name, offset))),)


def _report(source: Source, tables: dict[str, Table], uses_wedges: bool, is_painted: bool) -> None:
    """Issue a single warning about all data in the file that the mesh does not use."""
    used = {
        "vertex": {"x", "y", "z", "nx", "ny", "nz", *(name for pair in _UVS for name in pair)},
        "face": {*CORNERS, *(("texcoord",) if uses_wedges else ())},
    }
    single = {p.name for p in tables["vertex"].element.properties if not p.count_kind}
    if not is_painted and set(_COLORS[:3]) <= single:
        used["vertex"] |= {*_COLORS}
    left = []
    for name, table in tables.items():
        if name not in used:
            left.append(f"element {name}")
            continue
        others = (prop.name for prop in table.element.properties)
        left += [f"{name} {other}" for other in others if other not in used[name]]
    if left:
        source.warn(
            "F007.ply-unused: unused: {names}",
            names=listed([printable(name, 40) for name in left], 12),
        )
