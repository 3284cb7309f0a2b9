"""Exporter for .skel-style rigs: a ``.skel`` and a ``.skin`` for any figure."""

from __future__ import annotations

from dataclasses import replace
from mimetypes import guess_type
from pathlib import Path

import numpy as np

from viewer.diagnostics import Diagnostic, Phrase
from viewer.errors import RigError
from viewer.export._course_rig import CourseSkeleton, course_skeleton
from viewer.export._left_out import extra_parts, not_held_note
from viewer.export._losses.posed import PoseLosses
from viewer.formats import Source, all_or_none, free_path, keeping_written, read, write
from viewer.formats.skin import lost_parts
from viewer.media.image import encode_png
from viewer.rig.arrays import Floats
from viewer.rig.figure import Figure
from viewer.rig.hierarchy import depth_first
from viewer.rig.kinematics import world_matrices
from viewer.rig.mesh import without_seams
from viewer.rig.pose import rest_pose
from viewer.rig.scene import Actor
from viewer.rig.shape import shaped
from viewer.rig.skeleton import joint_label
from viewer.rig.skin import skin_rows
from viewer.rig.skinning import Skinning, deform, joint_matrices, skin_used

__all__ = ["export", "require"]

_ROUNDED = 1e-5  # scales in files differ from 1 by less than this if they are rounded
_FLAT = 1e-12  # determinant below which a joint counts as scaled to 0


def export(actor: Actor, path: Path, skinning: Skinning) -> list[Diagnostic]:
    """Write skeleton and skin, read them back, and report the error of the posed mesh.

    The shape is applied to the rest mesh, the pose becomes the file's pose, and the figure's
    translation is added to the root's offset.
    """
    figure, pose = actor.figure, actor.pose
    require(figure)
    assert figure.skeleton is not None and pose is not None  # figures with joints have a pose
    course, rig, sources = _as_rig(actor, skinning)
    skel, skin = path.with_suffix(".skel"), path.with_suffix(".skin")
    rig = _with_picture_names(rig, skin)
    notes = [Diagnostic("X001.skel", skel, values={"n": figure.skeleton.n_joints})]
    with keeping_written() as saved, all_or_none(_files(rig, skel, skin)):
        write(rig, skel)
        if rig.mesh is not None:
            write(rig, skin)
        files = [Source(file, saved[file]) for file in (skel, skin) if file in saved]
        error = _error(actor, files, sources, skinning)
    if rig.mesh is not None:
        notes.append(Diagnostic("X001.skin", skin, values={"n": rig.mesh.n_vertices}))
        if figure.mesh is not None and rig.mesh.n_vertices != figure.mesh.n_vertices:
            counts = {"before": figure.mesh.n_vertices, "after": rig.mesh.n_vertices}
            notes.append(Diagnostic("X005.seams", values=counts))
    return notes + _changed(actor, course) + _lost(figure) + error


def require(figure: Figure) -> None:
    """Raise RigError for a figure that the format cannot hold."""
    if figure.skeleton is None:
        raise RigError(f"figure {figure.name} has no skeleton to write as .skel")


def _files(rig: Figure, skel: Path, skin: Path) -> list[Path]:
    """Return all written files, including images under the names used by the mesh."""
    if rig.mesh is None:
        return [skel]
    pictures = [material.texture for material in rig.mesh.materials if material.image is not None]
    return [skel, skin, *(skin.parent / name.replace("\\", "/") for name in pictures if name)]


def _with_picture_names(rig: Figure, skin: Path) -> Figure:
    """Return a figure whose embedded images are named as files, after the ``.skin``.

    glTF files name them ``image0`` or not at all: without a suffix, few programs would open them,
    and two figures in one folder would have different images of one name.
    """
    if rig.mesh is None:
        return rig
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


def _as_rig(actor: Actor, skinning: Skinning) -> tuple[CourseSkeleton, Figure, np.ndarray | None]:
    """Return the figure in the form of the files, and the original vertex of each split vertex."""
    pose = actor.require_pose()
    figure = scaled(shaped(actor.figure, pose.shape_weights), pose.figure_scale)
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


def _scaling_bindings(actor: Actor, course: CourseSkeleton) -> Floats:
    """Return inverse binding matrices that scale as the posed joints do: (J, 4, 4).

    With the skinning matrices M of the figure and the matrices W of the unscaled joints in the same
    pose, both in the scaled figure, they are W^-1 M.
    """
    figure, pose = actor.figure, actor.require_pose()
    skin = shaped(figure, pose.shape_weights).require_skin()
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


def _changed(actor: Actor, course: CourseSkeleton) -> list[Diagnostic]:
    """Return notes about data in another form."""
    skeleton, notes = actor.figure.require_skeleton(), list[Diagnostic]()
    for key, joints in (("turned", course.turned), ("unlimited", course.unlimited)):
        if joints:
            names = [joint_label(skeleton, joint) for joint in joints]
            notes.append(Diagnostic(f"X005.skel-{key}", values={"n": len(names), "names": names}))
    if (np.abs(actor.require_pose().scales - 1.0) > _ROUNDED).any():
        notes.append(Diagnostic("X005.skel-scaled"))
    if course.renamed:
        values = {"n": len(course.renamed), "names": course.renamed}
        notes.append(Diagnostic("X005.skel-names", values=values))
    return notes


def scaled(figure: Figure, factor: float) -> Figure:
    """Return a figure with mesh, joints and bindings scaled about its origin."""
    if factor == 1.0:
        return figure
    mesh, skeleton, skin = figure.mesh, figure.skeleton, figure.skin
    if mesh is not None:
        mesh = replace(mesh, positions=mesh.positions * factor)
    if skeleton is not None:
        boxes = None if skeleton.boxes is None else skeleton.boxes * factor
        moves = skeleton.rest_translations * factor
        skeleton = replace(skeleton, rest_translations=moves, boxes=boxes)
    if skin is not None:
        inverse_bind = skin.inverse_bind.copy()
        inverse_bind[:, :3, 3] *= factor
        skin = replace(skin, inverse_bind=inverse_bind)
    return replace(figure, mesh=mesh, skeleton=skeleton, skin=skin, blend_shapes=None)


def _lost(figure: Figure) -> list[Diagnostic]:
    """Return a note that lists the data that the formats cannot store."""
    lost = []
    if figure.blend_shapes is not None:
        lost.append(Phrase("part-current-shape", n=figure.n_shapes))
    if figure.correctives is not None:
        lost.append(Phrase("part-correctives"))
    if figure.mesh is not None:
        lost += lost_parts(figure.mesh)
    if figure.up != "y":
        lost.append(Phrase("part-up", up=figure.up))
    return not_held_note(".skel and .skin", [*lost, *extra_parts(figure)])


def _error(
    actor: Actor, files: list[Source], sources: np.ndarray | None, skinning: Skinning
) -> list[Diagnostic]:
    """Read the files back and compare their pose with the posed figure."""
    figure, pose = actor.figure, actor.require_pose()
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
