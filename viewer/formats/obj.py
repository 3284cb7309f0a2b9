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
from collections.abc import Sequence

import numpy as np

from viewer.formats._mesh.polygons import Picks, picked, triangulate
from viewer.formats._mesh.surface import filled_normals, polygon_text, stated_unit, stated_up
from viewer.formats._neutral import neutral_positions
from viewer.formats._obj.mtl import read_libraries
from viewer.formats._obj.parts import ObjParts, read_parts
from viewer.formats._source import Source
from viewer.rig.arrays import Bools, Floats, Ints, freeze
from viewer.rig.figure import Figure
from viewer.rig.material import Material
from viewer.rig.mesh import Mesh

__all__ = ["read"]

_HEAD = 4096  # number of bytes within which files written by this program state the up axis
_SHORTEST = 1e-9  # length of the mean below which unit normals cancel each other out


def read(source: Source) -> Figure:
    """Read a mesh.

    Parameters
    ----------
    source : Source
        The file; recoverable errors and ignored data are added to its warnings.

    Returns
    -------
    Figure
        Mesh without skeleton and skin; y up and without a unit, unless a comment written by this
        program states them.

    Raises
    ------
    FormatError
        If the text violates the grammar; the error has the file and line.
    """
    parts = read_parts(source)
    source.release()
    if len(parts.positions) == 0:
        looks = source.looks_like()
        raise source.fault("F002.obj-mesh", None if looks else source.end, looks=looks)
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
        source.warn("F007.no-faces", n=mesh.n_vertices)
    if uvs is None and any(material.texture for material in materials):
        source.warn("F005.obj-texture")
    head = source.peek(_HEAD).decode("ascii", "replace")
    comments = "\n".join(re.findall(r"^#.*$", head, re.MULTILINE))
    return Figure(
        name=source.path.stem,
        mesh=mesh,
        up=stated_up(comments),
        unit=stated_unit(comments),
        facts=_facts(parts, mesh, has_normals=normals is not None),
    )


def _facts(parts: ObjParts, mesh: Mesh, has_normals: bool) -> tuple[tuple[str, str], ...]:
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


def _uvs(source: Source, parts: ObjParts, picks: Picks) -> tuple[Floats | None, Ints | None]:
    """Return the table of texture coordinates, and their index for each triangle corner."""
    # Invalid values are NaN, which a single sum detects.
    uvs = np.nan_to_num(parts.uvs) if np.isnan(parts.uvs.sum()) else parts.uvs
    if len(uvs) == 0:
        return None, None
    corners = picked(parts.corners[:, 1], picks)
    absent = corners < 0
    if absent.all():
        source.warn("F007.obj-texcoords", n=len(uvs))
        return None, None
    if absent.any():
        source.warn("F007.obj-corners", n=int(absent.sum()))
        corners = np.where(absent, len(uvs), corners)
        uvs = np.vstack([uvs, [0.0, 0.0]])
    return uvs, corners.astype(np.int32)


def _normals(source: Source, parts: ObjParts) -> Floats | None:
    """Return a normal for every vertex; NaN if no corner has one."""
    listed, n_vertices = parts.normals, len(parts.positions)
    if len(listed) == 0:
        return None
    used: Bools = parts.corners[:, 2] >= 0
    if not used.any():
        source.warn("F007.obj-normals", n=len(listed))
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
            "F007.obj-hard-edges",
            None,
            1,
            "positions",
            [first],
            n=int(several.sum()),
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


def _materials(source: Source, parts: ObjParts) -> tuple[tuple[Material, ...], Ints]:
    """Return the materials, and the material index of each face.

    If there is no ``usemtl``, several groups or objects become materials, to preserve their names.
    """
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


def _parts_of(source: Source, parts: ObjParts) -> tuple[tuple[str, ...], Ints]:
    """Return the names of objects, or else of groups, and the index of each face's name.

    A file with fewer than two of them has no parts. Groups within objects are reported, as a face
    has one part, unless they are kept as materials.
    """
    objects, groups = ({name: None for _, name in parts.runs[word]} for word in (b"o", b"g"))
    within = [name for name in groups if name and name not in objects]
    if len(objects) > 1 and len(within) > 1 and parts.runs[b"usemtl"]:
        source.warn("F007.obj-groups", n=len(within), names=within)
    for word in (b"o", b"g"):
        names, of_face = _named(parts.runs[word], len(parts.counts))
        used = np.unique(of_face[of_face >= 0])
        if len(used) > 1:
            numbers = np.full(len(names) + 1, -1, dtype=np.int32)
            numbers[used] = np.arange(len(used))
            return tuple(names[index] for index in used.tolist()), numbers[of_face]
    return (), np.full(len(parts.counts), -1, dtype=np.int32)
