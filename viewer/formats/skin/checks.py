"""Checks of a ``.skin`` file beyond its grammar: indices, weights and bindings."""

from __future__ import annotations

import numpy as np

from viewer.formats._placeholders import neutral_corners
from viewer.formats._source import Source
from viewer.formats._text.numbers import LARGEST
from viewer.formats.skin.sections import Sections, check_declared
from viewer.formats.skin.tables import LOST
from viewer.rig.arrays import Floats, Ints
from viewer.rig.geometry.transform import translation_matrix
from viewer.rig.mesh import Mesh, bounding_box
from viewer.rig.skin import Skin, has_influence, weight_sums

# Tolerance of the format for sums of weights; larger deviations from 1 cause a warning.
_WEIGHT_TOLERANCE = 0.01
_SINGULAR = 1e-12  # minimum determinant relative to the product of the column lengths
_NEARLY_SINGULAR = 1e6  # maximum condition number
_FAR = 1e6  # multiple of the median distance beyond which a vertex is stray


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
                "F002.skin-entries",
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
            "F002.skin-entries",
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
                    "F002.skin-corner-range",
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
    """Warn about textures that cannot be drawn and vertices far from all others."""
    has_texture = any(material.texture for material in mesh.materials)
    if mesh.uvs is not None and not has_texture:
        source.warn("F007.skin-texcoords", sections.offsets["texcoords"])
    if mesh.uvs is None and has_texture:
        source.warn("F005.skin-texture", sections.offsets["material"])
    # A sample of a few thousand vertices is enough to locate the figure.
    some = mesh.positions[:: max(1, mesh.n_vertices // 4096)]
    # The middle value is used instead of np.median, which imports numpy.ma and takes 14 ms.
    middle = len(some) // 2
    center = np.partition(some, middle, axis=0)[middle]
    typical = float(np.partition(np.abs(some - center).max(axis=1), middle)[middle])
    farthest = np.abs(bounding_box(mesh.positions) - center).max()
    if typical > 0 and farthest > _FAR * typical:
        distance = np.abs(mesh.positions - center).max(axis=1)
        vertex = int(distance.argmax())
        source.warn(
            "M010.skin-vertex",
            source.offset_of("positions", vertex),
            1,
            "positions",
            [vertex],
            vertex=vertex,
            distance=float(distance[vertex]),
        )


def invert_bindings(source: Source, sections: Sections) -> Floats:
    """Return the inverse bind matrices, (J, 4, 4); refuse bindings that are singular in float32."""
    assert sections.bindings is not None  # checked by the caller
    linear = sections.bindings[:, :3, :3]
    lengths = np.linalg.norm(linear, axis=1).prod(axis=1)
    determinants = np.linalg.det(linear)
    flat = np.abs(determinants) <= _SINGULAR * lengths
    bindings = sections.bindings
    with np.errstate(over="ignore", invalid="ignore"):
        inverse = np.linalg.inv(np.where(flat[:, None, None], np.eye(4), bindings))
        flat |= ~(np.abs(inverse) <= LARGEST).all(axis=(1, 2))
    if flat.any():
        index = int(flat.argmax())
        source.refuse(
            "B002.skin-matrix",
            source.offset_of("bindings", index),
            int(flat.sum()),
            "bindings",
            np.flatnonzero(flat),
            matrix=index,
            determinant=float(determinants[index]),
        )
        # A singular binding is replaced by its translation alone.
        inverse[flat] = translation_matrix(-bindings[flat, :3, 3])
        linear = np.where(flat[:, None, None], np.eye(3), linear)
    if len(linear):
        conditions = np.linalg.cond(linear)
        if conditions.max() > _NEARLY_SINGULAR:
            worst = int(conditions.argmax())
            source.warn(
                "B003.skin-matrix",
                source.offset_of("bindings", worst),
                1,
                "bindings",
                [worst],
                matrix=worst,
                condition=float(conditions[worst]),
            )
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
        "W010.skin-joint",
        source.offset_of("weights", vertex),
        len(wrong),
        "weights",
        vertices,
        vertex=vertex,
        limit=n_joints,
        found=int(joints[wrong[0]]),
    )
    return np.where(fits, joints, 0).astype(np.int32), np.where(fits, weights, 0.0)


def check_weights(source: Source, skin: Skin) -> None:
    """Warn, once each, about weights that are negative, missing, or do not sum to 1."""
    moved = has_influence(skin)
    if not moved.all():
        first = int((~moved).argmax())
        source.warn(
            "W004.vertices",
            source.offset_of("weights", first),
            1,
            "weights",
            [first],
            n=int((~moved).sum()),
            vertex=first,
        )
    negative = skin.weights < 0
    if negative.any():
        vertex = int(np.searchsorted(skin.starts, negative.argmax(), side="right")) - 1
        source.warn(
            "W002.skin-negative",
            source.offset_of("weights", vertex),
            1,
            "weights",
            [vertex],
            n=int(negative.sum()),
            weight=float(skin.weights[negative][0]),
            vertex=vertex,
        )
    sums = weight_sums(skin)
    errors = np.where(moved, np.abs(sums - 1.0), 0.0)
    off = errors > _WEIGHT_TOLERANCE
    if off.any():
        worst = int(errors.argmax())
        source.warn(
            "W001.skin-sums",
            source.offset_of("weights", worst),
            1,
            "weights",
            [worst],
            n=int(off.sum()),
            vertex=worst,
            sum=float(sums[worst]),
        )
