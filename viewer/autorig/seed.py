"""The seed method, provided for comparison: aligned boxes, nearest vertices, copied joints."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from viewer.autorig.checks import check_lines, newly_outside, residual_of
from viewer.autorig.rigged import Rigged
from viewer.autorig.transfer.inverse_skinning import invert_skinning
from viewer.autorig.weights.weight_transfer import nearest_weights
from viewer.diagnostics import note
from viewer.errors import RigError
from viewer.phrases import rounded
from viewer.progress import report_fraction
from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.transform import apply_transform
from viewer.rigs.kinematics import skinning_matrices, world_matrices
from viewer.rigs.mesh import Mesh, bounding_box, vertex_normals
from viewer.rigs.pose import Pose, placement_matrix
from viewer.rigs.skin import Skin
from viewer.rigs.skinning import deform

_FLAT = 1e-9  # minimum thickness of a box that can be scaled, as a fraction of its longest side


def nearest(template: Figure, pose: Pose, target: Mesh, name: str) -> Rigged:
    """Apply the steps of Tex-An Mesh: the target is changed; the template's joints are not.

    As in the original, pose correctives are neither removed nor added back. Only nearly singular
    blended matrices are replaced by the nearest rotation, which is reported.
    """
    _, skeleton, skin = template.attached()
    posed = deform(template, pose)[0]
    report_fraction(0.1, "matching boxes")
    box = align_boxes(target.positions, posed)
    aligned = apply_transform(box, target.positions)
    report_fraction(0.2, "finding nearest vertices")
    weights = nearest_weights(posed, skin, aligned)
    report_fraction(0.6, "inverse skinning")
    bound = weights.skin(skin.inverse_bind)
    palette = skinning_matrices(world_matrices(skeleton, pose), skin.inverse_bind)
    unaligned = np.asarray(np.linalg.inv(placement_matrix(pose)), dtype=np.float64)
    found = invert_skinning(apply_transform(unaligned, aligned), bound, palette)
    figure = _figure(template, bound, target, found.positions, name)
    back = np.asarray(np.linalg.inv(box), dtype=np.float64)
    residual = residual_of(figure, pose, back, target)
    out = newly_outside(template, pose, posed, replace(target, positions=aligned))
    scales = map(partial(rounded, digits=4), np.diag(box)[:3].tolist())
    factors = dict(zip("xyz", scales, strict=True))
    matched = {
        "n": int(weights.matched.sum()),
        "all": len(weights.matched),
        "ratio": float(weights.matched.mean()),
    }
    lines = (
        note(
            "R001.boxes: alignment: bounding boxes; target scaled along x, y, z by {x}, {y}, {z}",
            **factors,
        ),
        note(
            "R005.all-nearest: matched {n} of {all} vertices ({ratio:.1%}); all take the "
            "weights of the nearest vertex",
            **matched,
        ),
        note("R008.copied: joints: copied from the template"),
        *check_lines(figure, pose, found.guarded, out, residual),
    )
    return Rigged(
        figure=figure,
        pose=pose,
        placement=back,
        alignment=None,
        weights=weights,
        guarded=found.guarded,
        residual=residual,
        outside=out,
        length_scale=1.0,
        figure_scale=1.0,
        path_scale=1.0,
        lines=lines,
    )


def _figure(template: Figure, skin: Skin, target: Mesh, rest: Floats, name: str) -> Figure:
    mesh = replace(target, positions=rest, normals=vertex_normals(rest, target.triangles))
    return Figure(
        name=name,
        mesh=mesh,
        skeleton=template.skeleton,
        skin=skin,
        up=template.up,
        unit=template.unit,
        hands=template.hands,
        pose_layout=template.pose_layout,
        facts=(("rig", f"transferred from {template.name} by nearest vertices"),),
    )


def align_boxes(positions: Floats, onto: Floats) -> Floats:
    """Return the scale and shift (4, 4) that map one bounding box to another, as Tex-An Mesh does.

    p' = (p - c) * e' / e + c', with box centres c and extents e, per axis. An axis along which both
    boxes are flat keeps its scale; ``RigError`` if only one of them is.
    """
    box, other = bounding_box(positions), bounding_box(onto)
    extents, wanted = box[1] - box[0], other[1] - other[0]
    flat = extents <= _FLAT * extents.max(initial=0.0)
    other_flat = wanted <= _FLAT * wanted.max(initial=0.0)
    odd = np.flatnonzero(flat != other_flat)
    if len(odd):
        name = "xyz"[odd[0]]
        raise RigError(
            f"alignment of boxes: expected both meshes to extend along {name}, "
            f"found {extents[odd[0]]:g} and {wanted[odd[0]]:g}"
        )
    factors = np.where(flat, 1.0, wanted / np.where(flat, 1.0, extents))
    matrix = np.eye(4)
    matrix[:3, :3] *= factors
    matrix[:3, 3] = other.mean(axis=0) - factors * box.mean(axis=0)
    return matrix
