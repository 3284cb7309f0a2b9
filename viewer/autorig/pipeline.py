"""Pipeline of a rig transfer: align, transfer weights and joints, invert the pose, and check.

The robust method aligns template and target, validates closest points, moves the joints with the
surface around them, and transforms the target to the bind pose of the template. The pose in which
the target was found becomes the rest pose. The seed method, provided for comparison, is in
``seed``.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from viewer.autorig.alignment.posed_alignment import align_posed, keeps
from viewer.autorig.alignment.surface_alignment import Alignment, alignment_lines
from viewer.autorig.checks import (
    check_lines,
    newly_outside,
    require_target,
    residual_of,
    with_joint_name,
)
from viewer.autorig.confidence import judge, refusal, remarks
from viewer.autorig.correspondence import Template, with_reversed_winding
from viewer.autorig.rigged import Rigged, as_found, standing, with_fields
from viewer.autorig.seed import nearest
from viewer.autorig.settings import BINDING, TransferSettings
from viewer.autorig.transfer.corrective_transfer import transfer_correctives
from viewer.autorig.transfer.inverse_skinning import invert_skinning, repair_tears
from viewer.autorig.transfer.joint_transfer import boundary_weights, surface_shifts, transfer_joints
from viewer.autorig.transfer.rest_skeleton import RestSkeleton, fit_rest_skeleton
from viewer.autorig.weights.result import WeightTransfer
from viewer.autorig.weights.weight_transfer import transferred_weights
from viewer.diagnostics import Diagnostic, Phrase, note
from viewer.errors import RigError
from viewer.phrases import counted, listed
from viewer.progress import part_of_work, report_fraction
from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.figure import Figure
from viewer.rigs.kinematics import skinning_matrices, world_matrices
from viewer.rigs.mesh import Mesh, bounding_box, box_size, vertex_normals
from viewer.rigs.pose import Pose
from viewer.rigs.shape import pose_weights, shaped
from viewer.rigs.skeleton import Skeleton, joint_label
from viewer.rigs.skinning import deform, joint_matrices
from viewer.rigs.units import UNIT_NAMES, unit_of_scaled

_AT_JOINT = 1e-6  # distance of a landmark from a joint, as a fraction of the skeleton's size
_JOINT_REACH = 0.08  # maximum distance between the two surfaces, as a fraction of the target's size


def transfer(
    template: Figure,
    pose: Pose,
    target: Mesh,
    settings: TransferSettings | None = None,
    name: str = "rigged",
) -> Rigged:
    """Rig a mesh with the rig of another figure; ``Rigged.pose`` then reproduces the mesh."""
    how = settings or TransferSettings()
    require_target(target)
    if how.method in BINDING:
        from viewer.autorig.binding import bind

        if template.skeleton is None:
            raise RigError(f"{template.name}: expected a skeleton, found {_parts(template)}")
        bound = bind(template, pose, target, how, name)
        report_fraction(1.0, "done")
        dropped = _dropped_parts(template, bound.figure, replace(how, correctives=False))
        return as_found(replace(bound, lines=(*bound.lines, *dropped)))
    if not template.is_attached:
        raise RigError(
            f"{template.name}: expected a template with mesh, skeleton and skin, found "
            f"{_parts(template)}"
        )
    figure = shaped(template, pose.shape_weights)
    # The shape has become part of the mesh.
    plain = pose.copy()
    plain.shape_weights = np.zeros(0)
    if how.method == "nearest":
        rigged = nearest(figure, plain, target, name)
    else:
        rigged = robust(figure, plain, target, how, name)
    report_fraction(1.0, "done")
    return standing(as_found(with_fields(rigged)), how.alignment.up)


def robust(template: Figure, pose: Pose, target: Mesh, how: TransferSettings, name: str) -> Rigged:
    """Transfer a rig; see ``transfer``, which checks the arguments."""
    with part_of_work(span=(0.0, 0.4)):
        met = align_posed(template, pose, target, how.alignment, how.fits)
    given, alignment, pose, posed = pose, met.alignment, met.pose, met.positions
    plain, original, template = template, template.skeleton, met.figure
    aligned = alignment.similarity.apply(posed)
    # In the same pose, so that skin that is folded at a joint is not taken for squeezed skin.
    turn = alignment.similarity.rotation
    unfitted = None if template is plain else deform(plain, met.pose)[0] @ turn.T
    with part_of_work(span=(0.4, 0.8)):
        weights = transferred_weights(
            Template(aligned, template.require_mesh().triangles, unfitted),
            template.require_skin(),
            target.positions,
            target.triangles,
            how.weights,
        )
    report_fraction(0.8, "placing the joints")
    pinned = _pinned_joints(plain, given, how) if how.fits and keeps(how.alignment) else {}
    rest, transferred, lines = _transferred_skeleton(
        template, original, pose, alignment, aligned, target, how, pinned
    )
    report_fraction(0.85, "inverse skinning")
    scale = alignment.similarity.scale * pose.figure_scale
    figure, guarded = _at_rest(template, rest, weights, target, scale, how, name)
    report_fraction(0.95, "checking the result")
    joints = joint_matrices(figure, rest.pose)[:, :3, 3]
    if transferred is not None:
        # A joint that was placed belongs in the mesh even if no surface around it was found.
        transferred = transferred | np.isin(np.arange(len(joints)), list(pinned))
    out = newly_outside(template, pose, posed, target, joints, transferred)
    residual = residual_of(figure, rest.pose, np.eye(4), target)
    with part_of_work(span=(0.95, 1.0)):
        up = how.alignment.up
        found = judge(plain, given, figure, rest.pose, target, alignment, met.solids, met.legs, up)
    if not how.insists and (why := refusal(found, met.alike)):
        raise RigError(why)
    lines = [
        *remarks(found),
        *alignment_lines(alignment),
        *met.lines,
        *(with_joint_name(line, figure) for line in weights.lines),
        *lines,
        *rest.lines,
        *_judged(template, figure, weights),
        *_dropped_parts(template, figure, how),
        *check_lines(figure, rest.pose, guarded, out, residual),
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
        length_scale=alignment.similarity.scale,
        figure_scale=pose.figure_scale,
        path_scale=rest.root_scale / pose.figure_scale,
        lines=tuple(lines),
        findings=found,
        max_influences=how.weights.max_influences,
    )


def _transferred_skeleton(
    template: Figure,
    original: Skeleton | None,
    pose: Pose,
    alignment: Alignment,
    aligned: Floats,
    target: Mesh,
    how: TransferSettings,
    pinned: dict[int, Floats],
) -> tuple[RestSkeleton, Bools | None, list[Diagnostic]]:
    """Move the joints to the target; return those that were transferred, and messages.

    ``pinned``: joints with known positions (3,).
    """
    mesh, skeleton, skin = template.mesh, template.skeleton, template.skin
    assert mesh is not None and skeleton is not None and skin is not None  # checked by the caller
    joints = alignment.similarity.apply(joint_matrices(template, pose)[:, :3, 3])
    if how.joints == "alignment":
        placed = _with_pins(joints, skeleton.parents, np.zeros(len(joints), dtype=bool), pinned)
        rest = fit_rest_skeleton(template, pose, alignment.similarity, placed, None, original)
        return rest, None, [note("R008.aligned: joints: aligned with the template")]
    reach = _JOINT_REACH * box_size(bounding_box(target.positions[target.triangles.ravel()]))
    normals = vertex_normals(aligned, mesh.triangles)
    ways, matched = surface_shifts(aligned, normals, target.positions, target.triangles, reach)
    given = template.joint_regressor
    # Entries that mix coordinates are not weights of vertices.
    regressor = None if given is not None and given.axes is not None else given
    found = transfer_joints(
        joints,
        skeleton.parents,
        regressor or boundary_weights(skin, skeleton.parents),
        ways,
        matched,
    )
    placed = _with_pins(found.positions, skeleton.parents, found.transferred, pinned)
    rest = fit_rest_skeleton(
        template, pose, alignment.similarity, placed, found.transferred, original, pinned
    )
    missed = np.flatnonzero(found.measurable & ~found.transferred)
    labels = [joint_label(skeleton, joint) for joint in missed.tolist()]
    without = int((~found.measurable).sum())
    values = {
        "n": int(found.transferred.sum()),
        "all": skeleton.n_joints,
        "by": Phrase("the joint regressor" if regressor else "the boundaries of their regions"),
        "missed": Phrase("; too few target vertices around {names}", names=listed(labels, 8))
        if labels
        else "",
        "without": Phrase("; {n} without such a boundary moved with their parents", n=without)
        if without
        else "",
    }
    return (
        rest,
        found.transferred,
        [
            note(
                "R008.transferred: joints: {n} of {all} transferred using {by}{missed}{without}",
                **values,
            )
        ],
    )


def _pinned_joints(template: Figure, pose: Pose, how: TransferSettings) -> dict[int, Floats]:
    """Return the joints at which landmarks are, with the positions of these in the target."""
    landmarks = how.alignment.landmarks
    assert landmarks is not None  # checked by the caller
    joints = joint_matrices(template, pose)[:, :3, 3]
    size = box_size(bounding_box(joints))
    found = {}
    for point, position in landmarks:
        gaps = np.linalg.norm(joints - point, axis=1)
        if gaps.min() <= _AT_JOINT * size:
            found[int(gaps.argmin())] = position
    return found


def _with_pins(
    joints: Floats, parents: Ints, transferred: Bools, pinned: dict[int, Floats]
) -> Floats:
    """Return joints (J, 3), some at known positions; untransferred ones follow their parents."""
    moves = np.zeros_like(joints)
    for joint, parent in enumerate(parents.tolist()):
        if joint in pinned:
            moves[joint] = pinned[joint] - joints[joint]
        elif parent >= 0 and not transferred[joint]:
            moves[joint] = moves[parent]
    return joints + moves


def _at_rest(
    template: Figure,
    rest: RestSkeleton,
    weights: WeightTransfer,
    target: Mesh,
    scale: float,
    how: TransferSettings,
    name: str,
) -> tuple[Figure, Bools]:
    """Apply inverse skinning to the target and assemble the figure."""
    skin = weights.skin(rest.inverse_bind)
    skeleton, pose = rest.skeleton, rest.pose
    palette = skinning_matrices(world_matrices(skeleton, pose), skin.inverse_bind)
    posed = target.positions - pose.figure_translation
    found = invert_skinning(posed, skin, palette)
    positions = repair_tears(found, posed, target.triangles) if how.repairs else found.positions
    correctives = None
    if how.correctives and template.correctives is not None and weights.points is not None:
        correctives = transfer_correctives(
            template.correctives,
            weights.points,
            template.require_mesh().triangles,
            weights.matched,
            target.positions,
            target.triangles,
            scale,
        )
    if correctives is not None:
        # The pose's effect on the rest mesh is removed here, and added back when posing.
        weights_there = pose_weights(correctives, skeleton, pose)
        positions = positions - correctives.displacement(weights_there)
    mesh = replace(target, positions=positions, normals=vertex_normals(positions, target.triangles))
    mesh = with_reversed_winding(mesh, weights.backwards)
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
        facts=(("rig", f"transferred from {template.name}"),),
    )
    return figure, found.guarded


def _judged(template: Figure, figure: Figure, weights: WeightTransfer) -> Iterator[Diagnostic]:
    """Return messages about the target's winding and unit."""
    n_reversed = int(weights.backwards[figure.require_mesh().triangles].any(axis=1).sum())
    if n_reversed:
        yield note(
            "R014.wound: {n} wound inside out: reversed in the result",
            n=counted(n_reversed, "triangle"),
        )
    if template.unit in UNIT_NAMES:
        if figure.unit in UNIT_NAMES:
            yield note(
                "R014.unit: unit estimated from the size: {unit}",
                unit=UNIT_NAMES[figure.unit],
            )
        else:
            yield note(
                "R014.unit-unknown: unit unknown, because the target is much larger or smaller "
                "than the template"
            )


def _dropped_parts(template: Figure, figure: Figure, how: TransferSettings) -> Iterator[Diagnostic]:
    """Return messages about template data that is missing in the new figure."""
    if template.blend_shapes is not None:
        yield note(
            "R013.shapes: {n} of the template not transferred",
            n=counted(template.n_shapes, "blend shape"),
        )
    if template.correctives is not None and figure.correctives is None:
        key = (
            "R013.correctives-too-large: pose correctives of the template omitted: too large "
            "for this many vertices"
            if how.correctives
            else "R013.correctives: pose correctives of the template omitted"
        )
        yield note(key)


def _parts(figure: Figure) -> str:
    parts = {"mesh": figure.mesh, "skeleton": figure.skeleton, "skin": figure.skin}
    return " and ".join(name for name, part in parts.items() if part is not None) or "none"
