"""Exporter for .skel-style rigs: a ``.skel`` and a ``.skin`` for any figure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from mimetypes import guess_type
from pathlib import Path

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, Phrase, note, wording
from viewer.errors import RigError
from viewer.exporters._exporter import Selection
from viewer.exporters._left_out import (
    animation_parts,
    extra_parts,
    not_held_note,
    shape_parts,
)
from viewer.exporters._losses.pose_errors import PoseLosses
from viewer.exporters._options import ExportOptions
from viewer.formats import Source, all_or_none, free_path, keeping_written, read, write
from viewer.formats.skel import KEYWORDS
from viewer.formats.skin import lost_parts
from viewer.media.png import encode_png
from viewer.media.saving import as_words
from viewer.phrases import Shown, agree, counted, listed
from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.rotation import matrix_to_euler, quaternion_to_matrix
from viewer.rigs.geometry.transform import affine_matrices
from viewer.rigs.hierarchy import depth_first
from viewer.rigs.kinematics import joint_worlds, world_matrices
from viewer.rigs.mesh import without_seams
from viewer.rigs.motion.evaluation import still_frames
from viewer.rigs.placed_figure import placed
from viewer.rigs.pose import Pose, joint_offsets, rest_pose
from viewer.rigs.scene import Actor
from viewer.rigs.shape import shaped
from viewer.rigs.skeleton import FIRST_ROTATION, Skeleton, joint_label
from viewer.rigs.skin import skin_rows
from viewer.rigs.skinning import Skinning, deform, joint_matrices, skin_used

_ROUNDED = 1e-5  # scales in files differ from 1 by less than this if they are rounded
_FLAT = 1e-12  # determinant below which a joint counts as scaled to 0
_SAME = 1e-12  # tolerance of rotation matrices and scales
_CUBE = 0.01  # half the edge length of default boxes, relative to the skeleton's size


def export(selection: Selection, path: Path, options: ExportOptions) -> list[Diagnostic]:
    """Write skeleton and skin in the pose and shape, and report the error of the posed mesh."""
    actor, skinning = selection.part.actor, options.skinning
    figure, pose = actor.figure, actor.own_pose
    if figure.skeleton is None:
        raise RigError(f"figure {figure.name} has no skeleton to write as .skel")
    assert pose is not None  # figures with joints have a pose
    course, rig, sources = _as_rig(actor, skinning)
    skel, skin = path.with_suffix(".skel"), path.with_suffix(".skin")
    rig = _with_picture_names(rig, skin)
    notes = [note("X001.skel: {n}", skel, n=counted(figure.skeleton.n_joints, "joint"))]
    with keeping_written() as saved, all_or_none(_files(rig, skel, skin)):
        write(rig, skel)
        if rig.mesh is not None:
            write(rig, skin)
        files = [Source(file, saved[file]) for file in (skel, skin) if file in saved]
        error = _error(actor, files, sources, skinning)
    if rig.mesh is not None:
        notes.append(note("X001.skin: {n}", skin, n=counted(rig.mesh.n_vertices, "vertex")))
        if figure.mesh is not None and rig.mesh.n_vertices != figure.mesh.n_vertices:
            notes.append(
                note(wording.SEAMS, before=figure.mesh.n_vertices, after=rig.mesh.n_vertices)
            )
    return notes + _changed(actor, course) + _lost(figure) + error


def _files(rig: Figure, skel: Path, skin: Path) -> list[Path]:
    """Return all written files, including images under the names used by the mesh."""
    if rig.mesh is None:
        return [skel]
    pictures = [material.texture for material in rig.mesh.materials if material.image is not None]
    return [skel, skin, *(skin.parent / name.replace("\\", "/") for name in pictures if name)]


def _with_picture_names(rig: Figure, skin: Path) -> Figure:
    """Return a figure whose embedded images are named as files, after the ``.skin``."""
    if rig.mesh is None:
        return rig
    # glTF files name images image0 or not at all: without a suffix, few programs would open them,
    # and two figures in one folder would have different images of one name.
    names: dict[bytes, str] = {}  # by the pixels of the image, which materials may share
    materials = []
    for index, material in enumerate(rig.mesh.materials):
        texture = material.base_texture
        if texture is not None and texture.image is not None and not _is_picture(texture.name):
            pixels, stem = texture.image.tobytes(), f"{skin.stem[:80]}_{index}"
            if pixels not in names:
                data = encode_png(texture.image)
                names[pixels] = free_path(skin.parent, stem, ".png", data).name
            material = replace(material, base_texture=replace(texture, name=names[pixels]))
        materials.append(material)
    return replace(rig, mesh=replace(rig.mesh, materials=tuple(materials)))


def _is_picture(name: str) -> bool:
    return (guess_type(name)[0] or "").startswith("image/")


def _as_rig(actor: Actor, skinning: Skinning) -> tuple[_CourseSkeleton, Figure, np.ndarray | None]:
    """Return the figure in the form of the files, and the original vertex of each split vertex."""
    pose = actor.pose
    figure = replace(shaped(actor.figure, pose.shape_weights), blend_shapes=None)
    if pose.figure_scale != 1.0:
        figure = placed(figure, affine_matrices(pose.figure_scale * np.eye(3), np.zeros(3)))
    skeleton, mesh, skin = figure.require_skeleton(), figure.mesh, figure.skin
    course = course_skeleton(skeleton, pose)
    posed, order = course.skeleton, course.order
    if mesh is None:
        return course, Figure(figure.name, skeleton=posed), None
    split, sources = without_seams(mesh)
    if skin is None:
        return course, Figure(figure.name, split, posed), sources
    used = skin_rows(skin_used(skin, skinning), sources)
    place = np.argsort(order).astype(np.int32)
    bound = skin.inverse_bind[order]
    if course.is_scaled:
        bound = _scaling_bindings(actor, course)
    moved = replace(used, joints=place[used.joints], inverse_bind=bound)
    return course, Figure(figure.name, split, posed, moved), sources


def _scaling_bindings(actor: Actor, course: _CourseSkeleton) -> Floats:
    """Return inverse binding matrices that scale as the posed joints do: (J, 4, 4)."""
    figure, pose = actor.figure, actor.pose
    skin = shaped(figure, pose.shape_weights).require_skin()
    # With the skinning matrices M of the figure and the matrices W of the unscaled joints in the
    # same pose, both in the scaled figure, the bindings are W^-1 M.
    palette = joint_matrices(figure, pose) @ skin.inverse_bind
    palette[:, :3, :3] /= pose.figure_scale  # the mesh is scaled already
    joints = world_matrices(course.skeleton, rest_pose(course.skeleton))
    bound = np.linalg.inv(joints) @ palette[course.order]
    flat = np.abs(np.linalg.det(bound[:, :3, :3])) < _FLAT
    if flat.any():
        skeleton, joint = figure.require_skeleton(), int(course.order[flat.argmax()])
        raise RigError(
            f".skin cannot store joint {joint_label(skeleton, joint)}, which is scaled to 0: show "
            "it, or choose .glb"
        )
    return bound


def _changed(actor: Actor, course: _CourseSkeleton) -> list[Diagnostic]:
    """Return notes about data in another form."""
    skeleton, notes = actor.figure.require_skeleton(), list[Diagnostic]()
    for key, joints in (
        (
            "X005.skel-turned: {n} a rest rotation, a constraint or another order of rotations: "
            "the "
            "pose in the file contains {their} whole rotation ({names})",
            course.turned,
        ),
        (
            "X005.skel-unlimited: limits of {joints} are omitted, because {their} angles in the "
            "file are defined differently: {names}",
            course.unlimited,
        ),
    ):
        if joints:
            n = len(joints)
            notes.append(
                note(
                    key,
                    n=counted(n, "joint", "has", "have"),
                    joints=Shown(counted(n, "joint")),
                    names=listed([joint_label(skeleton, joint) for joint in joints], 8),
                    their=agree(n, "its", "their"),
                )
            )
    if (np.abs(actor.pose.scales - 1.0) > _ROUNDED).any():
        notes.append(
            note(
                "X005.skel-scaled: joints are scaled, which .skel cannot store: the bindings of "
                "the .skin scale the vertices, and bones keep their lengths when the file is posed"
            )
        )
    if course.renamed:
        notes.append(
            note(
                "X005.skel-names: {n} changed, because .skel has no braces or keywords in names: "
                "{names}",
                n=counted(len(course.renamed), "joint name", "is", "are"),
                names=listed(course.renamed, 8),
            )
        )
    return notes


def _lost(figure: Figure) -> list[Diagnostic]:
    """Return a note that lists the data that the formats cannot store."""
    lost = shape_parts(figure)
    if figure.correctives is not None:
        lost.append(Phrase("pose correctives"))
    if figure.mesh is not None:
        lost += lost_parts(figure.mesh)
    if figure.up != "y":
        lost.append(Phrase("the up axis {up}", up=figure.up))
    return not_held_note(".skel and .skin", [*lost, *extra_parts(figure), *animation_parts(figure)])


def _error(
    actor: Actor, files: list[Source], sources: np.ndarray | None, skinning: Skinning
) -> list[Diagnostic]:
    """Read the files back and compare their pose with the posed figure."""
    figure, pose = actor.figure, actor.pose
    skeleton = read(files[0])
    assert isinstance(skeleton, Figure) and skeleton.skeleton is not None
    joints = np.empty((figure.require_skeleton().n_joints, 3))
    order = depth_first(figure.require_skeleton().parents)
    joints[order] = world_matrices(skeleton.skeleton, rest_pose(skeleton.skeleton))[:, :3, 3]
    vertices = None
    if sources is not None:
        mesh = read(files[1])
        assert isinstance(mesh, Figure)
        again = Figure("again", mesh.mesh, skeleton.skeleton, mesh.skin)
        vertices = deform(again, rest_pose(skeleton.skeleton))[0]
    losses = PoseLosses(figure, skinning)
    losses.look(pose, vertices, joints, sources)
    return losses.notes(files[-1].path)


@dataclass(frozen=True, slots=True, eq=False)
class _CourseSkeleton:
    """A skeleton in the form of ``.skel`` files: joints only rotate about x, then y, then z."""

    skeleton: Skeleton
    """Joints in depth-first order, with the pose as rest pose."""
    order: Ints
    """(J,): the old index of each new joint."""
    turned: Sequence[int]
    """Old indices of joints whose three angles include a rest rotation, another order of rotations
    or a constraint: they have no limits."""
    unlimited: Sequence[int]
    """Those of them that had limits."""
    is_scaled: bool
    """Whether the pose scales joints, which a ``.skel`` cannot: the bindings have to."""
    renamed: Sequence[str]
    """Names that the format cannot store."""


def course_skeleton(skeleton: Skeleton, pose: Pose) -> _CourseSkeleton:
    """Return a skeleton in the form of ``.skel`` files, with the pose as its rest pose."""
    # A joint of a .skel has the local matrix T(offset) Rz Ry Rx in the axes of its parent, so
    # translations are part of the offsets. A joint with a rest rotation R0 has the angles of
    # R0 R(DOFs), its rotation in the pose, instead of its DOFs.
    pose, moved = _scaled(skeleton, pose)
    order = depth_first(skeleton.parents)
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    above = skeleton.parents[order]
    rows, is_plain = _plain_rows(skeleton, pose)
    offsets = skeleton.rest_translations + moved
    frames = still_frames(Figure("", skeleton=skeleton), pose)
    rotations = quaternion_to_matrix(frames.rotations[0])
    is_scaled = bool((np.abs(pose.scales - 1.0) > _SAME).any())
    if is_scaled:
        offsets = _unscaled_offsets(skeleton, pose, offsets, rotations)
    offsets[skeleton.parents < 0] += pose.figure_translation
    values = np.where(rows >= 0, pose.dofs[rows], 0.0)
    values[~is_plain] = matrix_to_euler(rotations[~is_plain])
    limits = np.where(rows[..., None] >= 0, skeleton.dof_limits[rows], 0.0)
    limits[~is_plain] = -np.inf, np.inf
    count = skeleton.n_joints
    names, renamed = _course_names([skeleton.names[joint] for joint in order])
    limited = skeleton.dof_joints[np.isfinite(skeleton.dof_limits).any(axis=1)]
    return _CourseSkeleton(
        Skeleton(
            names=names,
            parents=np.where(above >= 0, place[above], -1).astype(np.int32),
            rest_translations=offsets[order],
            rest_rotations=np.tile([0.0, 0.0, 0.0, 1.0], (count, 1)),
            rest_scales=np.ones((count, 3)),
            dof_joints=np.concatenate([np.zeros(3, int), np.repeat(np.arange(count), 3)]),
            dof_kinds=np.concatenate([np.arange(3), np.tile([3, 4, 5], count)]),
            rest_dofs=np.concatenate([np.zeros(3), values[order].ravel()]),
            dof_limits=np.concatenate(
                [np.tile([-np.inf, np.inf], (3, 1)), limits[order].reshape(-1, 2)]
            ),
            boxes=_boxes(skeleton)[order],
        ),
        order,
        np.flatnonzero(~is_plain).tolist(),
        np.intersect1d(np.flatnonzero(~is_plain), limited).tolist(),
        is_scaled,
        renamed,
    )


def course_pose(figure: Figure, pose: Pose) -> tuple[Figure, Pose]:
    """Return the skeleton that is written for a figure at rest, and a pose of the figure for it."""
    skeleton, plain = figure.require_skeleton(), pose.copy()
    plain.figure_scale, plain.figure_translation = 1.0, np.zeros(3)
    written = course_skeleton(skeleton, rest_pose(skeleton)).skeleton
    posed = course_skeleton(skeleton, plain).skeleton
    found = rest_pose(written)
    found.dofs[:] = posed.rest_dofs
    found.translations[:] = posed.rest_translations - written.rest_translations
    found.figure_scale, found.figure_translation = pose.figure_scale, pose.figure_translation
    return Figure(figure.name, skeleton=written, up=figure.up, unit=figure.unit), found


def _scaled(skeleton: Skeleton, pose: Pose) -> tuple[Pose, Floats]:
    """Return a pose with the lengths of the scaled figure, and the translations of its joints."""
    factor = pose.figure_scale
    moves = np.flatnonzero(skeleton.dof_kinds < FIRST_ROTATION)
    # The shape is applied already.
    scaled = replace(pose.copy(), figure_scale=1.0, shape_weights=np.zeros(0))
    scaled.translations *= factor
    scaled.dofs[moves] *= factor
    if skeleton.posing is not None:
        scaled.translations += (factor - 1.0) * skeleton.posing.translations(pose.dofs)
    return scaled, joint_offsets(skeleton, scaled.dofs, scaled.translations)


def _plain_rows(skeleton: Skeleton, pose: Pose) -> tuple[Ints, Bools]:
    """Return the DOF rows about x, y and z, -1 if missing, and which joints have only these."""
    rows = np.full((skeleton.n_joints, 3), -1, dtype=np.int32)
    rotated = np.abs(quaternion_to_matrix(pose.rotations) - np.eye(3)).max(axis=(1, 2))
    is_plain: Bools = (rotated <= _SAME) & (skeleton.posing is None)
    for row in np.flatnonzero(skeleton.dof_kinds >= FIRST_ROTATION).tolist():
        joint, axis = int(skeleton.dof_joints[row]), int(skeleton.dof_kinds[row]) - FIRST_ROTATION
        # R = Rz Ry Rx needs the row of x before that of y before that of z, each once.
        if rows[joint, axis:].max() >= 0:
            is_plain[joint] = False  # another order of rotations
        rows[joint, axis] = row
    is_plain[[constraint.joint for constraint in skeleton.constraints]] = False
    return rows, is_plain


def _unscaled_offsets(
    skeleton: Skeleton, pose: Pose, translations: Floats, rotations: Floats
) -> Floats:
    """Return the offsets that put unscaled joints where the scaled ones are: (J, 3)."""
    # With the product D of the rotations down to the parent, an offset is D^-1 (p_j - p_parent).
    scaled = rotations * pose.scales[:, None]
    places = joint_worlds(skeleton.parents, scaled, translations)[:, :3, 3]
    turns = joint_worlds(skeleton.parents, rotations, np.zeros(3))[:, :3, :3]
    inner = skeleton.parents >= 0
    offsets = translations.copy()
    above = skeleton.parents[inner]
    offsets[inner] = np.einsum("jba,jb->ja", turns[above], places[inner] - places[above])
    return offsets


def _course_names(names: Sequence[str]) -> tuple[tuple[str, ...], list[str]]:
    """Return names of words without braces or keywords, and the names that had to be changed."""
    found, renamed = [], []
    for name in names:
        words = as_words(name)
        if words is not None and not KEYWORDS & set(words):
            found.append(name)
            continue
        renamed.append(name)
        plain = name.translate({ord("{"): "(", ord("}"): ")"}).encode("utf-8", "replace").decode()
        found.append(" ".join(f"_{w}" if w.encode() in KEYWORDS else w for w in plain.split()))
    return tuple(found), renamed


def _boxes(skeleton: Skeleton) -> Floats:
    if skeleton.boxes is not None:
        return skeleton.boxes
    half = _CUBE * (float(np.abs(skeleton.rest_translations).max()) or 1.0)
    return np.tile([[-half] * 3, [half] * 3], (skeleton.n_joints, 1, 1))
