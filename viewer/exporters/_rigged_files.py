"""Files of a newly rigged mesh: a .skel-style rig with mesh and pose, ``.npz``, glTF or VRM."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from viewer.autorig.rigged import Rigged
from viewer.diagnostics import Diagnostic, wording
from viewer.errors import UnsupportedFormatError
from viewer.exporters import VrmMeta, export, files_written
from viewer.exporters._losses.pose_errors import PoseLosses
from viewer.exporters.rig import course_pose, course_skeleton
from viewer.formats import Source, all_or_none, keeping_written
from viewer.phrases import Remedy, counted
from viewer.rigs.arrays import Arrays
from viewer.rigs.figure import Figure, figure_pose
from viewer.rigs.mesh import vertex_normals
from viewer.rigs.placed_figure import bound_in
from viewer.rigs.pose import Pose
from viewer.rigs.scene import Actor
from viewer.rigs.shape import pose_weights
from viewer.rigs.skin import influence_counts, limit_influences
from viewer.rigs.skinning import Skinning, deform, joint_matrices

RIGGED_SUFFIXES = (".npz", ".skel", ".skin", ".glb", ".gltf")
"""Suffixes that ``files_of`` accepts without further data; ``.vrm`` needs an author."""

_RIG = (".skel", ".skin", ".obj", ".json")
_SAME = 1e-6  # distance below which a figure at rest is the mesh, relative to its size
_NODES = (".glb", ".gltf", ".vrm")
USUAL_INFLUENCES = 4
"""Influences per vertex that game engines and web viewers read of such files."""


def files_of(output: Path) -> list[Path]:
    """Return all files that belong to one output, or raise UnsupportedFormatError."""
    suffix = output.suffix.lower()
    if suffix == ".npz":
        return [output]
    if suffix in (".skel", ".skin"):
        return [output.with_suffix(each) for each in _RIG]
    if suffix in _NODES:
        return files_written(output)
    raise UnsupportedFormatError(
        f'a rigged mesh cannot be written as "{suffix}"; supported: .skel (with .skin, .obj and '
        "the target's pose as .json), .npz, .glb, .gltf, .vrm"
    )


def write_rigged(rigged: Rigged, output: Path, meta: VrmMeta | None = None) -> list[Diagnostic]:
    """Write all files of a rigged mesh, or none; return notes about them and what they omit."""
    files = files_of(output)
    if output.suffix.lower() == ".npz":
        from viewer.formats.rigged import read, save

        losses, pose = PoseLosses(rigged.figure, Skinning()), rigged.pose
        with keeping_written() as saved, all_or_none(files):
            save(rigged.figure, output, _arrays(rigged))
            again = read(Source(output, saved[output]))
            joints = joint_matrices(again, pose.copy())[:, :3, 3]
            losses.look(pose, deform(again, pose.copy())[0], joints)
        return [
            Diagnostic(
                "X001.rigged: the figure with its rig, the target's pose and the confidence", output
            ),
            *losses.notes(output),
        ]
    figure = without_correctives(rigged)
    notes: list[Diagnostic] = []
    if output.suffix.lower() in _NODES:
        is_vrm = output.suffix.lower() == ".vrm"
        if not is_vrm:
            figure = bound_in(figure, rigged.pose)
        figure, limited = _limited(figure, rigged.max_influences)
        notes += export(Actor(figure, figure_pose(figure)), output, meta=meta)
        if is_vrm and _is_moved(figure, rigged.pose):
            notes.append(
                Diagnostic(
                    "X003.rigged-vrm-place: the figure is at the origin, not where the mesh is, as "
                    "it is in .glb and .gltf"
                )
            )
        notes += limited
        if rigged.figure.correctives is not None:
            notes.append(Diagnostic(wording.RIGGED_CORRECTIVES))
        return notes
    skel, _, obj, json = files
    with all_or_none(files):
        notes += export(Actor(figure, figure_pose(figure)), skel)
        mesh = Figure(figure.name, figure.mesh, up=figure.up, unit=figure.unit)
        notes += export(Actor(mesh), obj)
        written, *lost = export(Actor(*_posed_skeleton(figure, rigged.pose)), json)
    message = "X001.target-pose: {n}, the target's pose"
    values = {"n": counted(written.values["n"], "DOF")}
    notes += [replace(written, key=message, values=values), *lost]
    if rigged.figure.correctives is not None:
        notes.append(Diagnostic(wording.RIGGED_CORRECTIVES))
    return notes


def _is_moved(figure: Figure, pose: Pose) -> bool:
    """Return whether a figure without correctives is elsewhere in a pose than at rest."""
    target = deform(figure, pose)[0]
    moved = np.abs(deform(figure)[0] - target).max()
    return bool(moved > _SAME * np.ptp(target, axis=0).max())


def _limited(figure: Figure, requested: int | None) -> tuple[Figure, list[Diagnostic]]:
    """Return the figure with the usual influences per vertex, unless a limit was requested."""
    skin = figure.require_skin()
    over = int((influence_counts(skin) > USUAL_INFLUENCES).sum())
    if requested is not None or not over:
        return figure, []
    said = Diagnostic(
        "X003.influences: {n} limited to the {most} strongest influences: {remedy}",
        values={
            "n": counted(over, "vertex"),
            "most": USUAL_INFLUENCES,
            "remedy": Remedy(
                "Max. influences keeps more, and .npz and .skel all",
                "--max-influences N keeps more, and .npz and .skel all",
            ),
        },
    )
    return replace(figure, skin=limit_influences(skin, USUAL_INFLUENCES)), [said]


def _posed_skeleton(figure: Figure, pose: Pose) -> tuple[Figure, Pose]:
    """Return a figure and pose whose angles are those of the written ``.skel``."""
    course = course_skeleton(figure.require_skeleton(), figure_pose(figure))
    return course_pose(figure, pose) if course.turned else (figure, pose)


def without_correctives(rigged: Rigged) -> Figure:
    """Return the figure with its correctives of the target's pose added to the rest mesh."""
    figure = rigged.figure
    correctives, mesh, skeleton = figure.correctives, figure.mesh, figure.skeleton
    if correctives is None or mesh is None or skeleton is None:
        return figure
    weights = pose_weights(correctives, skeleton, rigged.pose)
    rest = mesh.positions + correctives.displacement(weights)
    plain = replace(mesh, positions=rest, normals=vertex_normals(rest, mesh.triangles))
    return replace(figure, mesh=plain, correctives=None)


def _arrays(rigged: Rigged) -> Arrays:
    """Return the data about the rig transfer that accompanies the figure."""
    pose = rigged.pose
    found = rigged.alignment
    placed = found.similarity.matrix if found else np.linalg.inv(rigged.placement)
    return {
        "target_dofs": pose.dofs,
        "target_translations": pose.translations,
        "target_rotations": pose.rotations,
        "target_scales": pose.scales,
        "target_place": np.append(pose.figure_translation, pose.figure_scale),
        "placement": rigged.placement,
        "alignment": placed,
    }
