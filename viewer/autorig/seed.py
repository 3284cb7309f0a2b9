"""The seed method, provided for comparison: aligned boxes, nearest vertices, copied joints."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.autorig.alignment.box_alignment import align_boxes
from viewer.autorig.checks import check_lines, newly_outside, residual_of
from viewer.autorig.rigged import Rigged
from viewer.autorig.settings import Report
from viewer.autorig.transfer.inverse_skinning import invert_skinning
from viewer.autorig.weights.weight_transfer import nearest_weights
from viewer.diagnostics import Diagnostic
from viewer.rig.arrays import Floats
from viewer.rig.figure import Figure
from viewer.rig.geometry.transform import apply_transform
from viewer.rig.kinematics import skinning_matrices, world_matrices
from viewer.rig.mesh import Mesh, vertex_normals
from viewer.rig.pose import Pose, placement_matrix
from viewer.rig.skin import Skin
from viewer.rig.skinning import deform

__all__ = ["nearest"]


def nearest(template: Figure, pose: Pose, target: Mesh, report: Report, name: str) -> Rigged:
    """Apply the steps of Tex-An Mesh: the target is changed; the template's joints are not.

    As in the original, pose correctives are neither removed nor added back. Only nearly singular
    blended matrices are replaced by the nearest rotation, which is reported.

    Parameters
    ----------
    template : Figure
        Template with bindings, and with its shape applied.
    pose : Pose
        Pose without shape weights.
    target : Mesh
        Mesh with triangles.
    report : callable
        Called with progress.
    name : str
        Name of the new figure.
    """
    _, skeleton, skin = template.attached()
    posed = deform(template, pose)[0]
    report(0.1, "boxes")
    box = align_boxes(target.positions, posed)
    aligned = apply_transform(box, target.positions)
    report(0.2, "nearest vertices")
    weights = nearest_weights(posed, skin, aligned)
    report(0.6, "rest pose")
    bound = weights.skin(skin.inverse_bind)
    palette = skinning_matrices(world_matrices(skeleton, pose), skin.inverse_bind)
    unaligned = np.asarray(np.linalg.inv(placement_matrix(pose)), dtype=np.float64)
    found = invert_skinning(apply_transform(unaligned, aligned), bound, palette)
    figure = _figure(template, bound, target, found.positions, name)
    back = np.asarray(np.linalg.inv(box), dtype=np.float64)
    residual = residual_of(figure, pose, back, target)
    out = newly_outside(template, pose, posed, replace(target, positions=aligned))
    factors = dict(zip("xyz", np.diag(box)[:3].tolist(), strict=True))
    matched = {
        "n": int(weights.matched.sum()),
        "all": len(weights.matched),
        "ratio": float(weights.matched.mean()),
    }
    lines = (
        Diagnostic("R001.boxes", values=factors),
        Diagnostic("R005.all-nearest", values=matched),
        Diagnostic("R008.copied"),
        *check_lines(figure, found.guarded, out, residual),
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
