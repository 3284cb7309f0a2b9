r"""Reader and writer of ``.skin`` meshes with weights (UCSD course CSE169, texture extension).

::

    skin    = section*                                    in any order
    section = "positions"   N "{" (x y z)*N "}"
            | "normals"     N "{" (x y z)*N "}"
            | "texcoords"   N "{" (u v)*N "}"
            | "skinweights" N "{"? (k (joint weight)*k)*N "}"
            | "material" name? "{" ("texture" file)? "}"
            | "triangles"   M "{" (i j k)*M "}"
            | "bindings"    B "{"? ("matrix" "{" 12 numbers "}")*B "}"

A binding's four rows of three are the columns a, b, c, d of B = [a b c d; 0 0 0 1]. A material
applies to the triangles sections after it. Weights are used as stored.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from itertools import chain
from pathlib import Path

import numpy as np

from viewer.diagnostics import Diagnostic, Phrase, note, wording
from viewer.errors import OutputError, UnsupportedFormatError
from viewer.formats._placeholders import neutral_corners, neutral_positions
from viewer.formats._polygons import filled_normals
from viewer.formats._references import load_image
from viewer.formats._source import Source
from viewer.formats._text.number_text import row_texts
from viewer.formats._text.numbers import LARGEST
from viewer.formats.skin.sections import (
    KEYWORDS,
    LOST,
    Sections,
    check_declared,
    read_sections,
    weights_lines,
)
from viewer.media.image import save_image
from viewer.media.saving import as_words, save_parts
from viewer.phrases import all_of, optional, printable, rounded
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.transform import translation_matrix
from viewer.rigs.inspection.faults import are_singular
from viewer.rigs.material import Material
from viewer.rigs.mesh import Mesh, without_seams
from viewer.rigs.skin import Skin, skin_rows


def read(source: Source) -> Figure:
    """Read a mesh with its weights and bindings; it has no skin if the file has neither."""
    sections = read_sections(source)
    mesh = _mesh(source, sections)
    has_texture = any(material.texture for material in mesh.materials)
    if mesh.uvs is not None and not has_texture:
        source.warn(
            "F007.skin-texcoords: texcoords without a texture: drawn untextured",
            sections.offsets["texcoords"],
        )
    if mesh.uvs is None and has_texture:
        source.warn(
            "F005.skin-texture: texture without texcoords: drawn untextured",
            sections.offsets["material"],
        )
    return Figure(name=source.path.stem, mesh=mesh, skin=_skin(source, sections))


def _mesh(source: Source, sections: Sections) -> Mesh:
    table = sections.tables.get("positions")
    if table is None:
        looks = source.looks_like()
        raise source.fault(
            "F002.skin-positions: expected a skin, found no `positions` section{looks}",
            None if looks else source.end,
            looks=optional(" ({})", looks),
        )
    if len(table) == 0:
        raise source.fault(
            "F002.skin-no-vertex: expected at least one vertex, found positions 0",
            sections.offsets["positions"],
        )
    _even_counts(source, sections)
    if not sections.triangles:
        raise source.fault(
            "F002.skin-triangles: expected triangles, found no `triangles` section", source.end
        )
    triangles = _checked_triangles(source, sections, len(sections.tables["positions"]))
    if len(triangles) == 0:
        raise source.fault(
            "F002.skin-no-triangle: expected at least one triangle, found none",
            sections.offsets["triangles"],
        )
    source.remember("triangles", sections.triangle_offset)
    materials = np.repeat(
        [run.material for run in sections.triangles],
        [len(run.triangles) for run in sections.triangles],
    )
    positions = neutral_positions(sections.tables["positions"], triangles)
    normals, uvs = sections.tables.get("normals"), sections.tables.get("texcoords")
    if normals is None and "normals" not in sections.offsets:
        source.warn("F007.skin-normals: no `normals` section: computed from the triangles")
    return Mesh(
        positions=positions,
        normals=filled_normals(source, normals, positions, triangles),
        triangles=triangles,
        # Invalid values are NaN, which a single sum detects.
        uvs=uvs if uvs is None or not np.isnan(uvs.sum()) else np.nan_to_num(uvs),
        materials=tuple(sections.materials),
        triangle_materials=materials.astype(np.int32),
    )


def _skin(source: Source, sections: Sections) -> Skin | None:
    if sections.starts is None and sections.bindings is None:
        source.warn("F007.skin-unbound: no `skinweights` or `bindings`: the mesh cannot be skinned")
        return None
    if sections.starts is None or sections.bindings is None:
        missing = "skinweights" if sections.starts is None else "bindings"
        present = "bindings" if sections.starts is None else "skinweights"
        skin = None if sections.starts is None else _unbound_skin(sections)
        source.refuse(
            "B001.skin-section: expected a `{missing}` section to go with `{present}`, found none",
            sections.offsets[present],
            1,
            "bindings",
            np.arange(0 if skin is None else skin.n_joints),
            missing=missing,
            present=present,
        )
        return skin
    inverse_bind = _invert_bindings(source, sections)
    joints, weights = _checked_influences(source, sections, len(inverse_bind))
    return Skin(starts=sections.starts, joints=joints, weights=weights, inverse_bind=inverse_bind)


def _unbound_skin(sections: Sections) -> Skin:
    """Return the skin of a file without bindings, with the joints bound at their rest positions."""
    assert sections.starts is not None  # checked by the caller
    fits = sections.joints >= 0
    joints = np.where(fits, sections.joints, 0).astype(np.int32)
    count = int(joints.max(initial=0)) + 1
    weights = np.where(fits, sections.weights, 0.0)
    return Skin(sections.starts, joints, weights, np.tile(np.eye(4), (count, 1, 1)))


def _even_counts(source: Source, sections: Sections) -> None:
    """Refuse sections that have another number of vertices than the positions have."""
    tables = sections.tables
    counts = {name: len(table) for name, table in tables.items()}
    if sections.starts is not None:
        counts["skinweights"] = len(sections.starts) - 1
    n_positions = counts["positions"]
    others = {name: count for name, count in counts.items() if name != "positions"}
    if len(others) > 1 and len(set(others.values())) == 1:
        name, wanted = next(iter(others.items()))
        if wanted != n_positions:
            source.refuse(
                wording.SKIN_ENTRIES,
                sections.offsets["positions"],
                1,
                "positions",
                np.arange(wanted),
                section="positions",
                expected=wanted,
                other=name,
                found=n_positions,
            )
            missing = max(wanted - n_positions, 0)
            padded = np.pad(tables["positions"], ((0, missing), (0, 0)), constant_values=np.nan)
            tables["positions"] = padded[:wanted]
            return
    for name, count in counts.items():
        if count == n_positions:
            check_declared(source, sections, name)
            continue
        is_weights = name == "skinweights"
        source.refuse(
            wording.SKIN_ENTRIES,
            sections.offsets[name],
            1,
            "weights" if is_weights else "",
            np.arange(count, n_positions) if is_weights else (),
            section=name,
            expected=n_positions,
            other="positions",
            found=count,
        )
        if is_weights:
            assert sections.starts is not None  # checked by the caller
            starts = sections.starts[: n_positions + 1]
            sections.starts = np.pad(starts, (0, n_positions + 1 - len(starts)), mode="edge")
            sections.joints = sections.joints[: starts[-1]]
            sections.weights = sections.weights[: starts[-1]]
        else:
            del tables[name]


def _checked_triangles(source: Source, sections: Sections, n_vertices: int) -> Ints:
    """Return all triangles, (T, 3); refuse indices of nonexistent vertices."""
    first, tables = 0, []
    for run in sections.triangles:
        rows = run.triangles
        if len(rows) and (rows.min() < 0 or rows.max() >= n_vertices):
            fits = (rows >= 0) & (rows < n_vertices)
            wrong = ~fits & (rows != LOST)
            if wrong.any():
                row, corner = np.argwhere(wrong)[0].tolist()
                source.refuse(
                    "F002.skin-corner-range: triangle {triangle}: expected a vertex index below "
                    "{limit}, found {found}",
                    run.offset_of(row),
                    int(wrong.sum()),
                    "triangles",
                    np.flatnonzero(wrong.any(axis=1)) + first,
                    triangle=row + first,
                    limit=n_vertices,
                    found=int(rows[row, corner]),
                )
            rows = neutral_corners(rows, fits)
        tables.append(rows)
        first += len(rows)
    return tables[0] if len(tables) == 1 else np.concatenate(tables)


def _invert_bindings(source: Source, sections: Sections) -> Floats:
    """Return the inverse bind matrices, (J, 4, 4); refuse bindings that are singular in float32."""
    assert sections.bindings is not None  # checked by the caller
    linear = sections.bindings[:, :3, :3]
    determinants = np.linalg.det(linear)
    bindings = sections.bindings
    flat = are_singular(bindings)
    with np.errstate(over="ignore", invalid="ignore"):
        inverse = np.linalg.inv(np.where(flat[:, None, None], np.eye(4), bindings))
        flat |= ~(np.abs(inverse) <= LARGEST).all(axis=(1, 2))
    if flat.any():
        index = int(flat.argmax())
        source.refuse(
            "B002.skin-matrix: bindings: expected invertible matrices, found matrix {matrix} "
            "with determinant {determinant}",
            source.offset_of("bindings", index),
            int(flat.sum()),
            "bindings",
            np.flatnonzero(flat),
            matrix=index,
            determinant=rounded(float(determinants[index])),
        )
        # A singular binding is replaced by its translation alone.
        inverse[flat] = translation_matrix(-bindings[flat, :3, 3])
    return inverse.astype(np.float64, copy=False)


def _checked_influences(source: Source, sections: Sections, n_joints: int) -> tuple[Ints, Floats]:
    """Return joints and weights of all influences; refuse indices of joints without a binding."""
    joints, weights = sections.joints, sections.weights
    fits = (joints >= 0) & (joints < n_joints)
    if fits.all():
        return joints, weights
    assert sections.starts is not None  # checked by the caller
    wrong = np.flatnonzero(~fits)
    vertices = np.searchsorted(sections.starts, wrong, side="right") - 1
    vertex = int(vertices[0])
    source.refuse(
        "W010.skin-joint: skinweights of vertex {vertex}: expected a joint index below "
        "{limit}, found {found}",
        source.offset_of("weights", vertex),
        len(wrong),
        "weights",
        vertices,
        vertex=vertex,
        limit=n_joints,
        found=int(joints[wrong[0]]),
    )
    return np.where(fits, joints, 0).astype(np.int32), np.where(fits, weights, 0.0)


def write(figure: Figure, path: str | Path) -> list[Diagnostic]:
    """Write a figure's mesh, weights and bindings, and its texture images that are missing."""
    if figure.mesh is None:
        raise UnsupportedFormatError(f"figure {figure.name} has no mesh to write as .skin")
    mesh, sources = without_seams(figure.mesh)
    skin = None if figure.skin is None else skin_rows(figure.skin, sources)
    _check_writable(figure.name, mesh, skin)
    parts = [*_table("positions", mesh.positions), *_table("normals", mesh.normals)]
    if mesh.uvs is not None:
        parts += _table("texcoords", mesh.uvs)
    if skin is not None:
        parts += _section("skinweights", skin.n_vertices, weights_lines(skin))
    parts += _triangle_runs(mesh)
    if skin is not None:
        parts.append([_bindings_text(skin)])
    for material in mesh.materials:
        _save_texture(material, Path(path).parent)
    n_tables = 2 + (mesh.uvs is not None) + (skin is not None)
    save_parts(path, chain.from_iterable(parts), n_tables * mesh.n_vertices + mesh.n_triangles)
    notes = []
    if len(sources) != figure.mesh.n_vertices:
        notes.append(
            note(wording.SEAMS, Path(path), before=figure.mesh.n_vertices, after=mesh.n_vertices)
        )
    if lost := lost_parts(mesh):
        notes.append(note(wording.PARTS, Path(path), format=".skin", parts=all_of(lost)))
    return notes


def lost_parts(mesh: Mesh) -> list[Phrase]:
    """Return the data of a mesh that the format cannot hold."""
    lost = []
    if not all(material.is_plain for material in mesh.materials):
        lost.append(Phrase("material properties except one texture each"))
    if mesh.other_uvs:
        lost.append(Phrase("second texture coordinates"))
    if mesh.colors is not None:
        lost.append(Phrase("vertex colours"))
    if mesh.parts:
        lost.append(Phrase("names of its parts"))
    return lost


def _check_writable(name: str, mesh: Mesh, skin: Skin | None) -> None:
    if mesh.n_triangles == 0:
        raise UnsupportedFormatError(f"figure {name} has no triangles to write as .skin")
    arrays = [mesh.positions, mesh.normals, mesh.uvs, None if skin is None else skin.weights]
    if any(np.abs(array).max(initial=0.0) > LARGEST for array in arrays if array is not None):
        raise UnsupportedFormatError(f".skin cannot store numbers beyond {LARGEST:.3g}")


def _table(name: str, rows: Floats) -> list[Iterable[bytes]]:
    return _section(name, len(rows), row_texts(rows, start=b"  "))


def _section(name: str, count: int, lines: Iterable[bytes]) -> list[Iterable[bytes]]:
    """Return the text of a section in parts, which are composed when they are written."""
    return [[f"{name} {count} {{\n".encode()], lines, [b"}\n"]]


def _triangle_runs(mesh: Mesh) -> list[Iterable[bytes]]:
    """Return the triangles sections, each after its material, as assigned by the reader."""
    indices = mesh.material_indices
    edges = np.flatnonzero(np.diff(indices)) + 1
    parts: list[Iterable[bytes]] = []
    written = 0
    for first, last in zip([0, *edges], [*edges, len(indices)], strict=True):
        material = int(indices[first])
        if written and material != written - 1 and material < written:
            raise UnsupportedFormatError(".skin cannot return to an earlier material")
        for index in range(written, material + 1):
            parts.append([_material_text(mesh.materials[index])])
            written = index + 1
        rows = mesh.triangles[first:last]
        parts += _section("triangles", len(rows), row_texts(rows, start=b"  "))
    parts.append(map(_material_text, mesh.materials[written:]))
    return parts


def _material_text(material: Material) -> bytes:
    name, texture = as_words(material.name), _as_rest_of_line(material.texture)
    if name is None or not KEYWORDS.isdisjoint(name) or texture != material.texture:
        raise UnsupportedFormatError(
            f'.skin cannot store the material "{printable(material.name)}" '
            f'with the texture "{printable(material.texture)}"'
        )
    head = " ".join(filter(None, ["material", material.name, "{\n"]))
    text = head + (f"  texture {material.texture}\n" if material.texture else "") + "}\n"
    return text.encode("utf-8", "surrogateescape")


def _as_rest_of_line(texture: str | None) -> str | None:
    """Return a texture's name as it would be read back."""
    try:
        text = (texture or "").encode("utf-8", "surrogateescape").strip()
    except UnicodeEncodeError:  # the name has a lone surrogate, which decoding never yields
        return None
    return re.split(rb"[\r\n{}]", text)[0].decode("utf-8", "surrogateescape") or None


def _bindings_text(skin: Skin) -> bytes:
    bindings = np.linalg.inv(skin.inverse_bind) + 0.0  # adding 0.0 replaces -0.0 by 0.0
    # The rows of the text are the matrix's columns.
    blocks = [_matrix_text(columns) for columns in bindings[:, :3, :].transpose(0, 2, 1)]
    return f"bindings {len(bindings)} {{\n{''.join(blocks)}}}\n".encode()


def _matrix_text(rows: Floats) -> str:
    lines = "".join(f"    {' '.join(map(repr, row))}\n" for row in rows.tolist())
    return f"  matrix {{\n{lines}  }}\n"


def _save_texture(material: Material, folder: Path) -> None:
    """Save an image under its name in the file, unless the same image is already there."""
    if material.texture is None or material.image is None:
        return
    name = Path(material.texture.replace("\\", "/"))  # the reader interprets it in the same way
    path = folder / name
    if path.exists():
        there = load_image(Source(folder / "x.skin", b""), material.texture, 0)
        if there is None or not np.array_equal(there, material.image):
            raise OutputError(f"{printable(path, 300)}: a different image already exists")
        return
    if name.is_absolute() or ".." in name.parts:
        why = "is an absolute path" if name.is_absolute() else "lies outside the folder"
        raise UnsupportedFormatError(f"the texture {printable(path, 300)} {why}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise OutputError.at(path.parent, problem) from None
    save_image(path, material.image)
