"""The seed's way, step by step, kept to compare with: boxes, nearest vertices, copied joints."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.autorig.alignment.box_alignment import align_boxes
from viewer.autorig.checks import check_lines, newly_outside, residual_of
from viewer.autorig.rigged import Rigged
from viewer.autorig.settings import Report
from viewer.autorig.transfer.inverse_skinning import unpose
from viewer.autorig.weights.weight_transfer import nearest_weights
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
    """Follow Tex-An Mesh step by step: the target is altered, the template's joints are not.

    Pose correctives are neither taken off nor added back, as there. Only where a blended matrix
    is nearly singular the nearest rotation takes its place, which is reported.

    Parameters
    ----------
    template : Figure
        Attached, and already shaped.
    pose : Pose
        Without shape weights.
    target : Mesh
        With triangles.
    report : callable
        For progress.
    name : str
        Of the new figure.
    """
    mesh, skeleton, skin = template.mesh, template.skeleton, template.skin
    assert mesh is not None and skeleton is not None and skin is not None  # the caller looked
    posed = deform(template, pose)[0]
    report(0.1, "boxes")
    box = align_boxes(target.positions, posed)
    laid = apply_transform(box, target.positions)
    report(0.2, "nearest vertices")
    weights = nearest_weights(posed, skin, laid)
    report(0.6, "rest pose")
    bound = weights.skin(skin.inverse_bind)
    palette = skinning_matrices(world_matrices(skeleton, pose), skin.inverse_bind)
    unplaced = np.asarray(np.linalg.inv(placement_matrix(pose)), dtype=np.float64)
    found = unpose(apply_transform(unplaced, laid), bound, palette)
    figure = _figure(template, bound, target, found.positions, name)
    back = np.asarray(np.linalg.inv(box), dtype=np.float64)
    residual = residual_of(figure, pose, back, target)
    out = newly_outside(template, pose, posed, replace(target, positions=laid))
    factors = ", ".join(f"{factor:.4g}" for factor in np.diag(box)[:3])
    lines = (
        f"alignment: boxes; the target scaled along x, y, z by {factors}",
        f"matched {int(weights.matched.sum())} of {len(weights.matched)} vertices "
        f"({weights.matched.mean():.1%}); all have the weights of the nearest vertex",
        "joints: those of the template, copied",
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
        facts=(("rig", f"carried over from {template.name} by nearest vertices"),),
    )
