"""Errors of written poses: vertices and joints of a file, compared with the figure as opened."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from viewer.diagnostics import Diagnostic, Phrase, note
from viewer.exporters._losses.largest_distances import (
    Apart,
    Farthest,
    apart_notes,
    negligible,
    with_values,
)
from viewer.formats import Source, read
from viewer.phrases import agree, counted, optional
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.figure import Figure
from viewer.rigs.motion.evaluation import still_frames
from viewer.rigs.pose import Pose
from viewer.rigs.scene import Actor
from viewer.rigs.skinning import Skinning, deform, joint_matrices


def requested_causes(figure: Figure, how: Skinning) -> list[Phrase]:
    """Return the requested changes of a figure, which are causes of errors of its vertices."""
    found = []
    if figure.is_attached and how.max_influences:
        n = how.max_influences
        found.append(
            Phrase(
                "only the {influences} of each vertex {are} written, as requested",
                n=n,
                influences=agree(n, "strongest influence", f"{n} strongest influences"),
                are=agree(n, "is", "are"),
            )
        )
    elif figure.is_attached and how.normalize:
        found.append(Phrase("weights are scaled to a sum of 1, as requested"))
    if figure.correctives is not None and not how.correctives:
        found.append(Phrase("pose correctives are left out, as requested"))
    return found


class PoseLosses:
    """The largest errors of the poses of a figure, unshaped, that one or several files contain."""

    def __init__(self, figure: Figure, how: Skinning) -> None:
        self._figure, self._how = figure, how
        self._looked = self._skinned = 0
        self._joints: Farthest | None = None
        self._vertices: Farthest | None = None

    def look(
        self,
        pose: Pose | None,
        vertices: Floats | None = None,
        joints: Floats | None = None,
        sources: Ints | None = None,
        frame: int = 0,
    ) -> None:
        """Compare a file's vertices (N, 3) and joints (J, 3) with the figure in the original pose.

        ``sources`` (N,): vertex of the figure for each vertex of the file; the same if omitted.
        """
        self._looked += 1
        figure = self._figure
        first = still_frames(figure, pose)
        least = negligible(figure, first, np.zeros(1, dtype=np.intp))
        if joints is not None and pose is not None:
            wanted = joint_matrices(figure, pose)[:, :3, 3]
            self._joints = _farther(self._joints, joints - wanted, least, frame)
        if vertices is not None:
            self._skinned += 1
            wanted = deform(figure, pose, self._how.unreduced())[0]
            wanted = wanted if sources is None else wanted[sources]
            found = _farther(self._vertices, vertices - wanted, least, frame)
            if found is not None and found is not self._vertices and sources is not None:
                found = replace(found, index=int(sources[found.index]))
            self._vertices = found

    def notes(
        self, path: Path, first_frame: int | None = None, causes: list[Phrase] | None = None
    ) -> list[Diagnostic]:
        """Return a note with the largest errors, and ``causes`` of those of vertices, if any."""
        looked = self._looked if self._vertices is None else self._skinned
        found = Apart(self._joints, self._vertices, looked, self._looked)
        notes = apart_notes(path, self._figure, found, first_frame)
        if self._vertices is None:
            return notes
        requested = requested_causes(self._figure, self._how)
        return with_values(notes, causes=optional(": {}", requested + (causes or [])))


def look_at_mesh(
    losses: PoseLosses, actor: Actor, source: Source, frame: int = 0
) -> list[Diagnostic]:
    """Read a file of a posed mesh back, add its errors, and return a note if triangles differ."""
    mesh = actor.figure.require_mesh()
    if mesh.n_vertices == 0:
        return []  # readers refuse files without vertices
    again = read(source)
    assert isinstance(again, Figure)
    found = again.require_mesh()
    is_same = found.n_vertices == mesh.n_vertices
    if is_same:
        losses.look(actor.own_pose, found.positions, frame=frame)
    if is_same and np.array_equal(found.triangles, mesh.triangles):
        return []
    return [
        note(
            "X002.topology: {n} on {vertices} were read back instead of the {all} of the figure",
            source.path,
            n=counted(found.n_triangles, "triangle"),
            all=counted(mesh.n_triangles, "triangle"),
            vertices=counted(found.n_vertices, "vertex"),
        )
    ]


def mesh_losses(actor: Actor, how: Skinning, source: Source) -> list[Diagnostic]:
    """Read a file of a posed mesh back, and return notes about its errors."""
    losses = PoseLosses(actor.figure, how)
    odd = look_at_mesh(losses, actor, source)
    return odd + losses.notes(source.path)


def _farther(known: Farthest | None, off: Floats, least: float, frame: int) -> Farthest | None:
    """Return the longest of the vectors ``off`` (N, 3) if it is longer than all before."""
    if len(off) == 0:
        return known
    lengths = np.linalg.norm(off, axis=1)
    index = int(lengths.argmax())
    most = least if known is None else known.distance
    return Farthest(float(lengths[index]), index, frame) if lengths[index] > most else known
