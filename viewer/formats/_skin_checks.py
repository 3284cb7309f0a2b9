"""What a ``.skin`` file may get wrong beyond its grammar: indices, weights, bindings."""

from __future__ import annotations

import numpy as np

from viewer.formats._numbers import LARGEST
from viewer.formats._skin_sections import Sections
from viewer.formats._source import Source
from viewer.rig.arrays import Floats
from viewer.rig.mesh import Mesh, bounding_box
from viewer.rig.skin import Skin, has_influence, influence_counts, weight_sums

__all__ = ["check_joints", "check_mesh", "check_triangles", "check_weights", "invert_bindings"]

WEIGHT_TOLERANCE = 0.01  # the format's own: a sum further from 1 is worth a warning
_SINGULAR = 1e-12  # determinant relative to the product of the column lengths
_NEARLY_SINGULAR = 1e6  # condition number
_FAR = 1e6  # a vertex this many times the median distance away is no part of the figure


def check_mesh(source: Source, sections: Sections, mesh: Mesh) -> None:
    """Warn of textures that cannot be drawn and of vertices that are far from all others."""
    has_texture = any(material.texture for material in mesh.materials)
    if mesh.uvs is not None and not has_texture:
        source.warn("texcoords without a texture: drawn untextured", sections.offsets["texcoords"])
    if mesh.uvs is None and has_texture:
        source.warn("a texture without texcoords: drawn untextured", sections.offsets["material"])
    # Some thousand vertices tell where the others are.
    some = mesh.positions[:: max(1, mesh.n_vertices // 4096)]
    # The middle value instead of np.median, which imports numpy.ma: 14 ms at the start.
    middle = len(some) // 2
    center = np.partition(some, middle, axis=0)[middle]
    typical = float(np.partition(np.abs(some - center).max(axis=1), middle)[middle])
    farthest = np.abs(bounding_box(mesh.positions) - center).max()
    if typical > 0 and farthest > _FAR * typical:
        distance = np.abs(mesh.positions - center).max(axis=1)
        source.warn(
            f"vertex {distance.argmax()} is {distance.max():.2g} units away from the others",
            sections.offsets["positions"],
        )


def check_triangles(source: Source, sections: Sections, n_vertices: int) -> None:
    """Refuse indices of vertices that do not exist."""
    for run in sections.triangles:
        corners = run.triangles.ravel()
        if len(corners) and (corners.min() < 0 or corners.max() >= n_vertices):
            place = int(((corners < 0) | (corners >= n_vertices)).argmax())
            raise source.error(
                f"triangle {place // 3}: expected a vertex index below {n_vertices}, "
                f"found {corners[place]}",
                source.word_offset(run.block.start, place),
            )


def invert_bindings(source: Source, sections: Sections) -> Floats:
    """Return the inverse bind matrices, (J, 4, 4); refuse bindings that a float32 has none for."""
    assert sections.bindings is not None  # the caller looked
    linear = sections.bindings[:, :3, :3]
    lengths = np.linalg.norm(linear, axis=1).prod(axis=1)
    determinants = np.linalg.det(linear)
    flat = np.abs(determinants) <= _SINGULAR * lengths
    with np.errstate(over="ignore", invalid="ignore"):
        inverse = np.linalg.inv(np.where(flat[:, None, None], np.eye(4), sections.bindings))
        flat |= ~(np.abs(inverse) <= LARGEST).all(axis=(1, 2))
    if flat.any():
        index = int(flat.argmax())
        raise source.error(
            f"bindings: expected matrices that can be inverted, found matrix {index} "
            f"with determinant {determinants[index]:.3g}",
            sections.offsets["bindings"],
        )
    if len(linear):
        conditions = np.linalg.cond(linear)
        if conditions.max() > _NEARLY_SINGULAR:
            source.warn(
                f"matrix {conditions.argmax()} of bindings can hardly be inverted "
                f"(condition number {conditions.max():.2g})",
                sections.offsets["bindings"],
            )
    return inverse.astype(np.float64, copy=False)


def check_joints(source: Source, sections: Sections, n_joints: int) -> None:
    """Refuse indices of joints that are not bound."""
    wrong = np.flatnonzero((sections.joints < 0) | (sections.joints >= n_joints))
    if len(wrong):
        assert sections.starts is not None  # the caller looked
        influence = int(wrong[0])
        vertex = int(np.searchsorted(sections.starts, influence, side="right")) - 1
        # Words before it: a count for each vertex up to this one, and two for each influence.
        place = vertex + 1 + 2 * influence
        raise source.error(
            f"skinweights of vertex {vertex}: expected a joint index below {n_joints}, "
            f"found {sections.joints[influence]}",
            source.word_offset(sections.blocks["skinweights"].start, place),
        )


def check_weights(source: Source, sections: Sections, skin: Skin) -> None:
    """Warn, once each, of weights that are negative, missing, or do not add up to 1."""
    offset = sections.offsets["skinweights"]
    moved = has_influence(skin)
    if not moved.all():
        source.warn(
            f"{(~moved).sum()} vertices without influence stay where they were bound, "
            f"first vertex {(~moved).argmax()}",
            offset,
        )
    negative = skin.weights < 0
    if negative.any():
        owners = np.repeat(np.arange(skin.n_vertices), influence_counts(skin))
        source.warn(
            f"{negative.sum()} negative weights are used as stored, first "
            f"{skin.weights[negative][0]:g} of vertex {owners[negative.argmax()]}",
            offset,
        )
    errors = np.where(moved, np.abs(weight_sums(skin) - 1.0), 0.0)
    off = errors > WEIGHT_TOLERANCE
    if off.any():
        worst = int(errors.argmax())
        source.warn(
            f"the weights of {off.sum()} vertices do not add up to 1 and are used as stored, "
            f"worst vertex {worst} with {weight_sums(skin)[worst]:.6g}",
            offset,
        )
