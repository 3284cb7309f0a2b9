"""Largest distances between a figure and the file written from it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, Phrase
from viewer.export._losses.bounds import Bounds
from viewer.export._losses.estimates import Estimator
from viewer.export._losses.skinned import Body, Poses, Rows, Side, body_rows, poses_of, vertices
from viewer.progress import report
from viewer.rig.arrays import Floats
from viewer.rig.figure import Figure
from viewer.rig.mesh import bounding_box, box_size
from viewer.rig.motion.evaluation import Frames, frames_between, world_frames
from viewer.rig.scalars import length_text
from viewer.rig.skeleton import joint_label

_BLOCK = 128  # poses per block, whose matrices fit into the processor's cache
_BARE_BLOCK = 512  # poses per block of skeletons without a mesh
_CHUNK = 128  # poses per single-precision estimate
_LIKELY = 4  # poses per chunk whose farthest vertex is measured first
_SMALL = 0.05  # if joints add less than this fraction of the rest meshes' distance, skip skinning
_MOST = 512  # maximum number of poses compared one by one, with nonlinear skinning
_ROUNDING = 2e-6  # fraction of the size: rounding in single precision along a chain of joints
_EPSILON = 2.0**-22  # two steps of single precision, relative to a coordinate
_SIZED = 256  # frames used to measure the distance of a motion from the origin
_FAR = 5.0  # maximum factor on the tolerance far from the origin
_NO_REASONS: dict[str, object] = {"causes": [], "estimate": "", "rate": 0.0}


@dataclass(frozen=True, slots=True)
class Farthest:
    """The largest distance, with the joint or vertex and the frame."""

    distance: float
    index: int
    frame: int


@dataclass(frozen=True, slots=True)
class Apart:
    """Distances above the rounding error.

    Attributes
    ----------
    joints, vertices : Farthest or None
        The largest distances; None if negligible or if there are no joints or vertices.
    looked : int
        Number of frames whose vertices were compared; limited to keep the time short.
    frames : int
        Number of all frames.
    """

    joints: Farthest | None
    vertices: Farthest | None
    looked: int
    frames: int


def negligible(figure: Figure, frames: Frames, rows: Rows) -> float:
    """Return the distance, in figure units, up to which rounding errors are not reported.

    ``figure``: figure that defines the size.
    ``frames``: frames that define the distance of the joints from the origin. The tolerance grows
    with this
      distance, since numbers have larger rounding errors there, up to five times the usual one.
    ``rows`` (F,): the frames to use.
    """
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
    """Return the largest distances between joints and vertices of two sides over all poses.

    Poses and vertices that cannot have the largest distance are skipped: the result is exact,
    although only a few vertices are skinned in double precision.

    ``first``, ``second``: sides with the same joints and vertices, in the same space.
    ``rows`` (F,): frames of the first side.
    ``least``: threshold below which distances are ignored.
    ``frames`` (F,): frames of the second side; the same if omitted.
    """
    others = rows if frames is None else frames
    if first.exact is not None or second.exact is not None:
        return _apart_one_by_one(first, second, rows, others, least)
    joints, search = Farthest(least, -1, -1), None
    if first.body is not None and second.body is not None:
        search = _Search(first.body, second.body, least)
    size = _BARE_BLOCK if search is None else _BLOCK
    for start in range(0, len(rows), size):
        report(start, len(rows), "frames", "comparing with the original")
        part = rows[start : start + size]
        one, other = first.poses(part), second.poses(others[start : start + size])
        off = one.places - other.places
        # Three times as fast as np.linalg.norm.
        joints = _farther(joints, np.sqrt(np.einsum("fja,fja->fj", off, off)), part)
        if search is not None:
            search.look(one, other, part)
    worst = None if search is None else _if_found(search.worst)
    return Apart(_if_found(joints), worst, len(rows), len(rows))


def _farther(known: Farthest, off: NDArray[np.floating], frames: Rows) -> Farthest:
    """Return the larger of a known distance and the largest one in rows (F, N) of frames."""
    if off.size == 0 or not off.max() > known.distance:
        return known
    row, index = np.unravel_index(int(off.argmax()), off.shape)
    return Farthest(float(off[row, index]), int(index), int(frames[row]))


def _if_found(found: Farthest) -> Farthest | None:
    return found if found.index >= 0 else None


class _Search:
    """Exact search for the farthest vertex with little work.

    Upper bounds select candidate poses, and single-precision estimates their candidate vertices.
    """

    def __init__(self, first: Body, second: Body, least: float) -> None:
        self.worst = Farthest(least, -1, -1)
        self._bodies = first, second
        self._bounds = Bounds(first, second)
        self._estimator: Estimator | None = None

    def look(self, first: Poses, second: Poses, frames: Rows) -> None:
        """Search poses of both sides; ``frames`` are their indices."""
        bounds = self._bounds.of(first, second)
        order = np.argsort(-bounds, kind="stable")
        for start in range(0, len(order), _CHUNK):
            rows = order[start : start + _CHUNK]
            rows = rows[bounds[rows] > self.worst.distance]
            if len(rows) == 0:
                return
            self._estimate(poses_of(first, rows), poses_of(second, rows), frames[rows])

    def _estimate(self, first: Poses, second: Poses, frames: Rows) -> None:
        """Search a chunk of poses: first the most likely candidates, then the others."""
        most = self._most(first, second)
        likely = np.argsort(-most.max(axis=1), kind="stable")[:_LIKELY]
        self._measure(first, second, frames, likely, np.unique(most[likely].argmax(axis=1)))
        hopeful = most > self.worst.distance
        rows, chosen = (np.flatnonzero(hopeful.any(axis=axis)) for axis in (1, 0))
        if len(rows):
            self._measure(first, second, frames, rows, chosen)

    def _most(self, first: Poses, second: Poses) -> NDArray[np.float32]:
        """Return upper bounds of the distances of vertices: (F, V)."""
        if self._estimator is None:
            self._estimator = Estimator(*self._bodies)
        by_joints = self._bounds.by_joints(first, second)
        most = self._estimator.of_rest(first, second)
        if by_joints.max() > _SMALL * float(most.max(initial=0.0)):
            return self._estimator.of_skinned(first, second)
        bound = self._bounds.stretches(first)[:, None] * most + by_joints[:, None]
        return np.asarray(bound, dtype=np.float32)

    def _measure(self, first: Poses, second: Poses, frames: Rows, rows: Rows, chosen: Rows) -> None:
        """Measure some vertices of some poses in double precision."""
        moved = [
            vertices(body_rows(body, chosen.astype(np.int32)), poses_of(poses, rows))
            for body, poses in zip(self._bodies, (first, second), strict=True)
        ]
        off = np.linalg.norm(moved[0] - moved[1], axis=2)
        worst = _farther(self.worst, off, frames[rows])
        if worst is not self.worst:
            self.worst = replace(worst, index=int(chosen[worst.index]))


def _apart_one_by_one(first: Side, second: Side, rows: Rows, others: Rows, least: float) -> Apart:
    """Compare sides with nonlinear skinning, for which no bound is known."""
    count = min(len(rows), _MOST)
    chosen = np.linspace(0, len(rows) - 1, count).round().astype(int)
    plain = [replace(side, body=None, exact=None) for side in (first, second)]
    joints = apart(plain[0], plain[1], rows, least, others).joints
    worst = Farthest(least, -1, -1)
    for row, other in zip(rows[chosen].tolist(), others[chosen].tolist(), strict=True):
        off = np.linalg.norm(_vertices(first, row) - _vertices(second, other), axis=1)
        worst = _farther(worst, off[None], np.array([row]))
    return Apart(joints, _if_found(worst), count, len(rows))


def _vertices(side: Side, row: int) -> Floats:
    if side.exact is not None:
        return side.exact(row)
    assert side.body is not None  # only bodies with meshes are compared this way
    poses = side.poses(np.array([row]))
    return vertices(side.body, poses)[0]


def extent_of(found: Apart) -> Phrase | str:
    """Return the number of compared frames; empty if all were compared."""
    if found.looked == found.frames:
        return ""
    return Phrase("compared-frames", n=found.looked, all=found.frames)


def apart_notes(
    path: Path,
    figure: Figure,
    found: Apart,
    first_frame: int | None,
    sources: Sequence[int] | NDArray[np.integer] | None = None,
    vertices: str = "mesh-vertices",
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

    def farthest(kind: str, far: Farthest, **place: object) -> Phrase:
        values = {"distance": far.distance, "unit": figure.unit, **place}
        if first_frame is not None:
            kind, values = f"{kind}-in-frame", values | {"frame": first_frame + far.frame}
        return Phrase(kind, length=length_text(figure, far.distance), **values)

    parts: dict[str, object] = {}
    if found.joints is not None and figure.skeleton is not None:
        name = joint_label(figure.skeleton, found.joints.index)
        parts["joint"] = farthest("farthest-joint", found.joints, joint=name)
    if found.vertices is not None:
        index = found.vertices.index
        vertex = index if sources is None else int(sources[index])
        parts["vertices"] = Phrase(vertices)
        parts["vertex"] = farthest("farthest-vertex", found.vertices, vertex=vertex)
    if not parts:
        return []
    whole = "the-original-pose" if first_frame is None else "the-original-motion"
    key = "both" if len(parts) == 3 else "joints" if "joint" in parts else "vertices"
    values = {"original": Phrase(original or whole), **parts, "extent": extent_of(found)}
    return [Diagnostic("X002." + key, path, values={**values, **_NO_REASONS})]


def with_values(notes: list[Diagnostic], **values: object) -> list[Diagnostic]:
    """Return copies of notes with different values."""
    return [replace(note, values={**note.values, **values}) for note in notes]
