"""The recommended way: alignment, checked closest points, carried joints, unposing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.autorig.alignment.posed_alignment import align_posed
from viewer.autorig.alignment.surface_alignment import Alignment, alignment_lines
from viewer.autorig.checks import (
    check_lines,
    joint_list,
    newly_outside,
    residual_of,
    with_joint_name,
)
from viewer.autorig.correspondence.inside_out import turned_round
from viewer.autorig.correspondence.matching import Template
from viewer.autorig.rigged import Rigged
from viewer.autorig.settings import Report, TransferSettings
from viewer.autorig.transfer.corrective_transfer import carry_correctives
from viewer.autorig.transfer.inverse_skinning import mend, unpose
from viewer.autorig.transfer.joint_transfer import boundary_weights, carry_joints, surface_shifts
from viewer.autorig.transfer.rest_skeleton import RestSkeleton, fit_rest_skeleton
from viewer.autorig.weights.result import WeightTransfer
from viewer.autorig.weights.weight_transfer import transferred_weights
from viewer.rig.arrays import Bools, Floats
from viewer.rig.blendshapes import Correctives, corrective_weights
from viewer.rig.figure import Figure
from viewer.rig.kinematics import skinning_matrices, world_matrices
from viewer.rig.mesh import Mesh, bounding_box, box_size, vertex_normals
from viewer.rig.pose import Pose, joint_rotations
from viewer.rig.skeleton import Skeleton
from viewer.rig.skinning import joint_matrices
from viewer.rig.units import WORDS, unit_of_scaled

__all__ = ["robust"]

_JOINT_REACH = 0.08  # of the target's size: how far a surface may be from the template's


def robust(
    template: Figure, pose: Pose, target: Mesh, how: TransferSettings, report: Report, name: str
) -> Rigged:
    """Carry a rig over; see ``pipeline.transfer``, which checks what it is given.

    Parameters
    ----------
    template : Figure
        Attached, and already shaped.
    pose : Pose
        Without shape weights.
    target : Mesh
        With triangles.
    how : TransferSettings
        All but the method.
    report : callable
        For progress.
    name : str
        Of the new figure.
    """
    met = align_posed(template, pose, target, how.alignment, how.fits, _within(report, 0.0, 0.4))
    alignment, pose, posed = met.alignment, met.pose, met.positions
    original, template = template.skeleton, met.figure
    laid = alignment.placed.apply(posed)
    weights = _weighed(template, laid, target, how, report)
    report(0.8, "joints")
    rest, carried, lines = _carried_skeleton(template, original, pose, alignment, laid, target, how)
    report(0.85, "rest pose")
    scale = alignment.placed.scale * pose.figure_scale
    figure, guarded = _at_rest(template, rest, weights, target, scale, how, name)
    report(0.95, "checks")
    joints = joint_matrices(figure, rest.pose)[:, :3, 3]
    out = newly_outside(template, pose, posed, target, joints, carried)
    residual = residual_of(figure, rest.pose, np.eye(4), target)
    lines = [
        *alignment_lines(alignment),
        *met.lines,
        *(with_joint_name(line, figure) for line in weights.lines),
        *lines,
        *rest.lines,
        *_judged(template, figure, weights),
        *_lost(template, figure, how),
        *check_lines(figure, guarded, out, residual),
    ]
    return Rigged(
        figure=figure,
        pose=rest.pose,
        placement=np.eye(4),
        alignment=alignment,
        weights=weights,
        guarded=guarded,
        residual=residual,
        outside=out,
        length_scale=alignment.placed.scale,
        figure_scale=pose.figure_scale,
        path_scale=rest.root_scale / pose.figure_scale,
        lines=tuple(lines),
    )


def _weighed(
    template: Figure, laid: Floats, target: Mesh, how: TransferSettings, report: Report
) -> WeightTransfer:
    """Carry the weights of a template over that lies on the target."""
    mesh, skin = template.mesh, template.skin
    assert mesh is not None and skin is not None  # the caller looked
    return transferred_weights(
        Template(laid, mesh.triangles),
        skin,
        target.positions,
        target.triangles,
        how.weights,
        _within(report, 0.4, 0.8),
    )


def _within(report: Report, low: float, high: float) -> Report:
    return lambda share, what: report(low + (high - low) * share, what)


def _carried_skeleton(
    template: Figure,
    original: Skeleton | None,
    pose: Pose,
    alignment: Alignment,
    laid: Floats,
    target: Mesh,
    how: TransferSettings,
) -> tuple[RestSkeleton, Bools | None, list[str]]:
    """Place the joints in the target; return which were carried, and what a person should know."""
    mesh, skeleton, skin = template.mesh, template.skeleton, template.skin
    assert mesh is not None and skeleton is not None and skin is not None  # the caller looked
    joints = alignment.placed.apply(joint_matrices(template, pose)[:, :3, 3])
    if how.joints == "copied":
        rest = fit_rest_skeleton(template, pose, alignment.placed, joints, None, original)
        return rest, None, ["joints: those of the template, aligned"]
    reach = _JOINT_REACH * box_size(bounding_box(target.positions[target.triangles.ravel()]))
    normals = vertex_normals(laid, mesh.triangles)
    ways, matched = surface_shifts(laid, normals, target.positions, target.triangles, reach)
    regressor = template.joint_regressor
    found = carry_joints(
        joints,
        skeleton.parents,
        regressor or boundary_weights(skin, skeleton.parents),
        ways,
        matched,
    )
    rest = fit_rest_skeleton(
        template, pose, alignment.placed, found.positions, found.carried, original
    )
    by = "the joint regressor" if regressor else "the boundaries of the joints' regions"
    count = int(found.carried.sum())
    line = f"joints: {count} of {skeleton.n_joints} carried by {by}"
    missed = np.flatnonzero(found.measurable & ~found.carried).tolist()
    if missed:
        line += f"; too little of the target around {joint_list(template, missed)}"
    without = int((~found.measurable).sum())
    if without:
        line += f"; {without} without such a boundary moved with their parents"
    return rest, found.carried, [line]


def _at_rest(
    template: Figure,
    rest: RestSkeleton,
    weights: WeightTransfer,
    target: Mesh,
    scale: float,
    how: TransferSettings,
    name: str,
) -> tuple[Figure, Bools]:
    """Unpose the target and put the figure together."""
    skin = weights.skin(rest.inverse_bind)
    skeleton, pose = rest.skeleton, rest.pose
    palette = skinning_matrices(world_matrices(skeleton, pose), skin.inverse_bind)
    posed = target.positions - pose.figure_translation
    found = unpose(posed, skin, palette)
    positions = mend(found, posed, target.triangles) if how.mends else found.positions
    correctives = _correctives(template, weights, target, scale) if how.correctives else None
    if correctives is not None:
        # What the pose adds to the rest mesh is taken off now, and added back when posing.
        turned = joint_rotations(skeleton, pose)
        positions = positions - correctives.displacement(corrective_weights(turned))
    mesh = replace(target, positions=positions, normals=vertex_normals(positions, target.triangles))
    mesh = turned_round(mesh, weights.backwards)
    figure = Figure(
        name=name,
        mesh=mesh,
        skeleton=skeleton,
        skin=skin,
        up=template.up,
        unit=unit_of_scaled(template.unit, scale),
        correctives=correctives,
        hands=template.hands,
        pose_layout=template.pose_layout,
        facts=(("rig", f"carried over from {template.name}"),),
    )
    return figure, found.guarded


def _correctives(
    template: Figure, weights: WeightTransfer, target: Mesh, scale: float
) -> Correctives | None:
    if template.correctives is None or template.mesh is None or weights.points is None:
        return None
    return carry_correctives(
        template.correctives,
        weights.points,
        template.mesh.triangles,
        weights.matched,
        target.positions,
        target.triangles,
        scale,
    )


def _judged(template: Figure, figure: Figure, weights: WeightTransfer) -> list[str]:
    """Say what was judged of the target: which way round it is wound, and its unit."""
    assert figure.mesh is not None  # it was just made
    lines = []
    turned = int(weights.backwards[figure.mesh.triangles].any(axis=1).sum())
    if turned:
        lines.append(f"wound inside out, and turned round in the result: {turned} triangles")
    if template.unit in WORDS:
        unit = WORDS.get(figure.unit, "not known, much larger or smaller than the template")
        lines.append(f"unit, judged by size: {unit}")
    return lines


def _lost(template: Figure, figure: Figure, how: TransferSettings) -> list[str]:
    """Say what of the template the new figure does not have."""
    lines = []
    if template.blend_shapes is not None:
        lines.append(f"not carried over: {template.n_shapes} shape directions of the template")
    if template.correctives is not None and figure.correctives is None:
        why = ", too large for this many vertices" if how.correctives else ""
        lines.append(f"pose correctives of the template: left out{why}")
    return lines
