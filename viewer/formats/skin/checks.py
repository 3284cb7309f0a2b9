"""Checks of a ``.skin`` file beyond its grammar: indices, weights and bindings."""

from __future__ import annotations

import numpy as np

from viewer.diagnostics import wording
from viewer.formats._placeholders import neutral_corners
from viewer.formats._source import Source
from viewer.formats._text.numbers import LARGEST
from viewer.formats.skin.sections import Sections, check_declared
from viewer.formats.skin.tables import LOST
from viewer.phrases import rounded
from viewer.rig.arrays import Floats, Ints
from viewer.rig.geometry.transform import translation_matrix
from viewer.rig.inspection.faults import are_singular
from viewer.rig.mesh import Mesh


def even_counts(source: Source, sections: Sections) -> None:
    """Refuse sections whose number of vertices differs from the number of positions.

    If all other sections agree, the positions are assumed to be wrong.
    """
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
            _fit_weights(sections, n_positions)
        else:
            del tables[name]


def _fit_weights(sections: Sections, count: int) -> None:
    """Drop the influences of surplus vertices, and add missing vertices without influences."""
    assert sections.starts is not None  # checked by the caller
    starts = sections.starts[: count + 1]
    sections.starts = np.pad(starts, (0, count + 1 - len(starts)), mode="edge")
    sections.joints = sections.joints[: starts[-1]]
    sections.weights = sections.weights[: starts[-1]]


def checked_triangles(source: Source, sections: Sections, n_vertices: int) -> Ints:
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


def check_mesh(source: Source, sections: Sections, mesh: Mesh) -> None:
    """Warn about textures that cannot be drawn."""
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


def invert_bindings(source: Source, sections: Sections) -> Floats:
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


def checked_influences(source: Source, sections: Sections, n_joints: int) -> tuple[Ints, Floats]:
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
