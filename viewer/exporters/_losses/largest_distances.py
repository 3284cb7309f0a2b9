"""Largest distances between a figure and the file written from it, over many poses.

Joints are compared in all of them. Skinning every vertex in every pose would take longer than the
export itself, so all vertices are compared in evenly spaced poses, and in those that look worst.
Distances of joints are thus the largest there are; those of vertices exist, and the largest may be
missed only where neither joints nor vertices that are far apart elsewhere show it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, Phrase, note
from viewer.exporters._losses.posed_bodies import Rows, Side, body_rows, vertices
from viewer.phrases import Shown, brief, optional
from viewer.progress import report
from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure
from viewer.rigs.mesh import bounding_box, box_size
from viewer.rigs.motion.evaluation import Frames, frames_between, world_frames
from viewer.rigs.scalars import length_text
from viewer.rigs.skeleton import joint_label

_BLOCK = 512  # poses per block
_SKINNED = 16  # poses per block of all vertices: 38 MB of positions for 100,000 vertices
REGULAR = 64  # evenly spaced poses in which all vertices are compared, with linear skinning
_MOST = 512  # the same with nonlinear skinning, where few vertices cannot be followed alone
_WORST = 16  # further poses in which all vertices are compared, for joints and vertices each
# Numbers of single precision are rounded by 2^-24 = 6e-8 of their value. Along a chain of joints
# down to the fingers some thirty roundings add up to this fraction of the figure's size.
_ROUNDING = 2e-6
# Neighbouring numbers of single precision differ by up to 2^-23 of their value. Far from the
# origin, where this exceeds the above, two of them count, up to a factor: a figure a thousand
# times its size away is spoiled by rounding, and its errors must be reported.
_EPSILON, _FAR = 2.0**-22, 5.0
_SIZED = 256  # frames used to measure the distance of a motion from the origin
_NO_REASONS: dict[str, object] = {
    "causes": Shown("", []),
    "estimate": "",
    "rate": Shown("", 0.0),
}


@dataclass(frozen=True, slots=True)
class Farthest:
    """The largest distance, with the joint or vertex and the frame."""

    distance: float
    index: int
    frame: int


@dataclass(frozen=True, slots=True)
class Apart:
    """Distances above the rounding error."""

    joints: Farthest | None
    vertices: Farthest | None
    """The largest distances; None if negligible or if there are no joints or vertices."""
    looked: int
    """Number of compared frames; limited with nonlinear skinning, to keep the time short."""
    frames: int
    """Number of all frames."""


def negligible(figure: Figure, frames: Frames, rows: Rows) -> float:
    """Return the distance in figure units that rounding explains; it grows far from the origin."""
    some = frames_between(frames, rows[:: sampling(len(rows))])
    return tolerance(figure, reach_of(figure, some))


def sampling(count: int) -> int:
    """Return the step between the frames whose distance from the origin is measured."""
    return max(1, count // _SIZED)


def reach_of(figure: Figure, frames: Frames) -> float:
    """Return the largest coordinate of a joint in frames; 0 without joints."""
    if figure.skeleton is None:
        return 0.0
    return float(np.abs(world_frames(figure, frames)[..., :3, 3]).max(initial=0.0))


def tolerance(figure: Figure, reach: float) -> float:
    """Return ``negligible`` for the largest coordinate of the joints."""
    size = 0.0
    if figure.mesh is not None and figure.mesh.n_vertices:
        size = box_size(bounding_box(figure.mesh.positions))
    elif figure.skeleton is not None:
        size = float(np.linalg.norm(figure.skeleton.rest_translations, axis=1).sum())
    return min(_FAR * _ROUNDING * size, max(_ROUNDING * size, _EPSILON * reach))


def apart(first: Side, second: Side, rows: Rows, least: float, frames: Rows | None = None) -> Apart:
    """Return the largest distances above ``least``; ``frames`` are the second side's rows."""
    others = rows if frames is None else frames
    if first.body is None or second.body is None:
        far = heights(first, second, rows, others)
        return Apart(_joint(first, second, rows, others, far[0], least), None, len(rows), len(rows))
    is_linear = first.exact is None and second.exact is None
    chosen = evenly(len(rows), REGULAR if is_linear else _MOST)
    found = _vertices(first, second, rows, others, chosen)
    # The vertices that are farthest apart in some of these poses are followed through all others.
    # Their distances, and those of the joints, show where other vertices may be farther apart: a
    # wrong rotation moves all vertices of its limb, most those at its end, and a wrong weight or
    # shape the same vertices in every pose.
    followed = np.unique(found[:, 1]) if is_linear and len(chosen) < len(rows) else None
    far = heights(first, second, rows, others, followed)
    if followed is not None:
        worst = np.unique(np.argsort(-far, axis=1, kind="stable")[:, :_WORST])
        worst = np.setdiff1d(worst, chosen)
        found = np.concatenate([found, _vertices(first, second, rows, others, worst)])
        chosen = np.concatenate([chosen, worst])
    best = int(found[:, 0].argmax()) if len(found) else -1
    vertex = None
    if best >= 0 and found[best, 0] > least:
        frame = int(rows[chosen[best]])
        vertex = Farthest(float(found[best, 0]), int(found[best, 1]), frame)
    looked = len(rows) if is_linear else len(chosen)
    return Apart(_joint(first, second, rows, others, far[0], least), vertex, looked, len(rows))


def largest(first: Side, second: Side, rows: Rows) -> Floats:
    """Return the largest distance of vertices, or of joints without a mesh, in each pose: (F,)."""
    if first.body is None or second.body is None:
        return heights(first, second, rows, rows)[0]
    return _vertices(first, second, rows, rows, np.arange(len(rows)))[:, 0]


def evenly(count: int, most: int) -> Rows:
    """Return at most ``most`` evenly spaced indices of ``count`` items, with both ends."""
    return np.linspace(0, count - 1, min(count, most)).round().astype(np.intp)


def followed_vertices(first: Side, second: Side, rows: Rows) -> Rows:
    """Return the vertices that are farthest apart in evenly spaced poses, one of each."""
    return np.unique(_vertices(first, second, rows, rows, evenly(len(rows), REGULAR))[:, 1])


def heights(
    first: Side, second: Side, rows: Rows, others: Rows, followed: NDArray[np.generic] | None = None
) -> Floats:
    """Return the largest distance of joints, and of some vertices, in each pose: (1 or 2, F)."""
    bodies = None
    if followed is not None and first.body is not None and second.body is not None:
        few = followed.astype(np.int32)
        bodies = body_rows(first.body, few), body_rows(second.body, few)
    found = np.zeros((1 if bodies is None else 2, len(rows)))
    for start in range(0, len(rows), _BLOCK):
        report(start, len(rows), "frames", "comparing with the original")
        part = slice(start, start + _BLOCK)
        one, other = first.poses(rows[part]), second.poses(others[part])
        found[0, part] = _lengths(one.places - other.places).max(axis=1, initial=0.0)
        if bodies is not None:
            off = _lengths(vertices(bodies[0], one) - vertices(bodies[1], other))
            found[1, part] = off.max(axis=1, initial=0.0)
    return found


def _joint(
    first: Side, second: Side, rows: Rows, others: Rows, far: Floats, least: float
) -> Farthest | None:
    """Return the farthest joint, given the largest distance in each pose (F,)."""
    if not len(far) or far.max() <= least:
        return None
    row = int(far.argmax())
    at = slice(row, row + 1)
    off = _lengths(first.poses(rows[at]).places - second.poses(others[at]).places)[0]
    return Farthest(float(off.max()), int(off.argmax()), int(rows[row]))


def _vertices(first: Side, second: Side, rows: Rows, others: Rows, chosen: Rows) -> Floats:
    """Return the largest distance of a vertex in some poses, and its index: (N, 2)."""
    assert first.body is not None and second.body is not None  # the caller has checked it
    found = np.zeros((len(chosen), 2))
    if not len(first.body.positions):
        return found
    for start in range(0, len(chosen), _SKINNED):
        part = slice(start, start + _SKINNED)
        off = _lengths(_skinned(first, rows[chosen[part]]) - _skinned(second, others[chosen[part]]))
        found[part, 0], found[part, 1] = off.max(axis=1), off.argmax(axis=1)
    return found


def _skinned(side: Side, rows: Rows) -> Floats:
    """Return all vertices in some poses: (N, V, 3)."""
    if side.exact is not None:
        return np.stack([side.exact(int(row)) for row in rows])
    assert side.body is not None  # the caller has checked it
    return vertices(side.body, side.poses(rows))


def _lengths(vectors: Floats) -> Floats:
    # Three times as fast as np.linalg.norm.
    return np.sqrt(np.einsum("...a,...a->...", vectors, vectors))


def extent_of(found: Apart) -> Phrase | str:
    """Return the number of compared frames; empty if all were compared."""
    if found.looked == found.frames:
        return ""
    return Phrase("vertices compared in {n} of {all} frames", n=found.looked, all=found.frames)


def apart_notes(
    path: Path,
    figure: Figure,
    found: Apart,
    first_frame: int | None,
    sources: Sequence[int] | NDArray[np.integer] | None = None,
    vertices: str = "vertices",
    original: str = "",
) -> list[Diagnostic]:
    """Return a note about the errors of a file, or an empty list if there are none.

    ``path``: the file.
    ``figure``: original figure.
    ``found``: the measured distances.
    ``first_frame``: number of the first frame; None for a single pose.
    ``sources`` (V,): vertex of the figure for each compared vertex.
    ``vertices``: phrase for these vertices.
    ``original``: phrase for the original; the motion or pose if empty.
    """

    def farthest(what: str, far: Farthest, **place: object) -> Phrase:
        values = {"distance": far.distance, "unit": figure.unit, **place}
        if first_frame is not None:
            what, values = f"{what}, frame {{frame}}", values | {"frame": first_frame + far.frame}
        return Phrase(
            f"up to {{length}} ({what})", length=length_text(figure, far.distance), **values
        )

    parts: dict[str, object] = {}
    if found.joints is not None and figure.skeleton is not None:
        name = joint_label(figure.skeleton, found.joints.index)
        parts["joint"] = farthest("{joint}", found.joints, joint=brief(name))
    if found.vertices is not None:
        index = found.vertices.index
        vertex = index if sources is None else int(sources[index])
        parts["vertices"] = Phrase(vertices)
        parts["vertex"] = farthest("vertex {vertex}", found.vertices, vertex=vertex)
    if not parts:
        return []
    whole = "the pose" if first_frame is None else "the motion"
    key = (
        "X002.both: joints differ from {original} by {joint}; {vertices} by {vertex}"
        if len(parts) == 3
        else "X002.joints: joints differ from {original} by {joint}"
        if "joint" in parts
        else "X002.vertices: {vertices} differ from {original} by {vertex}"
    )
    values = {
        "original": Phrase(original or whole),
        **parts,
        "extent": optional(" ({})", extent_of(found)),
    }
    key += "{extent}{causes}{estimate}{rate}"
    return [note(key, path, **values, **_NO_REASONS)]


def with_values(notes: list[Diagnostic], **values: object) -> list[Diagnostic]:
    """Return copies of notes with different values."""
    return [replace(note, values={**note.values, **values}) for note in notes]
