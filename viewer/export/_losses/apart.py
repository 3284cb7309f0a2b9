"""Largest distances between a figure and the file written from it, over many poses.

Skinning every vertex in every pose would take longer than the export itself. ``Bounds`` excludes
poses that cannot matter, by a bound per joint; ``Estimator`` finds the farthest vertices of the
others in single precision; only these candidates are skinned in double precision.
"""

from __future__ import annotations

import weakref
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, Phrase
from viewer.export._losses.skinned import Body, Poses, Rows, Side, body_rows, poses_of, vertices
from viewer.progress import report
from viewer.rig.arrays import Floats
from viewer.rig.figure import Figure
from viewer.rig.mesh import bounding_box, box_size
from viewer.rig.motion.evaluation import Frames, frames_between, world_frames
from viewer.rig.scalars import length_text
from viewer.rig.skeleton import joint_label
from viewer.rig.skin import Skin, merged, owners, skin_from_entries
from viewer.rig.skinning.lbs import blocks_of

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
# Upper bounds, without which most poses would be skinned in vain
_NUMBERS = 9  # entries of a joint's rotation matrix, which drive the correctives
# Cached bounds of the correctives used last: a batch writes many motions of the same body.
_known: tuple[weakref.ref[Floats] | None, Floats] = (None, np.zeros(0))
# Estimates in single precision
Single = NDArray[np.float32]
_STEPS = 2.0**-18  # error bound of single-precision sums, relative to the largest term


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
    """Number of frames whose vertices were compared; limited to keep the time short."""
    frames: int
    """Number of all frames."""


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


# Inexpensive upper bounds of the distance between the vertices of two bodies, one per pose.
#
# With palettes M and N, rest meshes a and b, weights v and w, and T = max sum_j |v_j|::
#
#     |sum v_j M_j a - sum w_j N_j b| <= T max_j |(M_j - N_j) b| + T max_j |M_j| max |a - b|
#                                      + max_v sum_j |v_j - w_j| max_j |N_j b|
#
# The vertices of each joint are bounded by a sphere, so a bound takes only a few operations per
# joint. Poses whose bound is below the tolerance, or below the largest distance so far, are
# skipped.
class Bounds:
    """Bounds for two bodies with the same vertices and joints.

    ``first``, ``second``: the bodies; the second has the same correctives as the first, or none.
    """

    def __init__(self, first: Body, second: Body) -> None:
        same = _are_equal(first.skin, second.skin)
        both = first.skin if same else _joined(first.skin, second.skin, 1.0)
        self._centers, self._radii = _spheres(second, both)
        self._most = float(_sums(first.skin).max(initial=0.0))
        self._change = 0.0
        if not same:
            self._change = float(_sums(_joined(first.skin, second.skin, -1.0)).max(initial=0.0))
        off = np.linalg.norm(first.positions - second.positions, axis=1)
        self._apart = float(off.max(initial=0.0))
        self._shapes, self._other_shapes = first.shapes, second.shapes
        self._lengths = _lengths(first.shapes)
        self._strayed = np.zeros(0)
        if first.shapes is not None and second.shapes is not None:
            self._strayed = _lengths(first.shapes - second.shapes)
        self._stretches = _stretches(first.correctives)

    def of(self, first: Poses, second: Poses) -> Floats:
        """Return an upper bound of the vertex distance for each pose: (F,)."""
        rest = self.stretches(first) * self._rest(first, second)
        return self.by_joints(first, second) + rest

    def stretches(self, first: Poses) -> Floats:
        """Return the largest factor by which skinning can enlarge |a - b|: (F,)."""
        return self._most * _largest_stretch(first.palette)

    def by_joints(self, first: Poses, second: Poses) -> Floats:
        """Return the part of the bound that is due to joints and weights: (F,)."""
        shift = first.shifts - second.shifts
        other = second.palette.copy()
        other[..., :3, 3] -= shift[:, None]
        reach = self._radii + self._moved(second)[:, None]
        found = self._most * self._farthest(first.palette - other, reach)
        if self._change > 0.0:
            far = self._farthest(other, reach) + np.linalg.norm(shift, axis=1)
            found += self._change * far
        return found

    def _farthest(self, palette: Floats, reach: Floats) -> Floats:
        """Return the largest length to which matrices map vertices of their joints: (F,)."""
        at_center = np.einsum("fjab,jb->fja", palette[..., :3, :3], self._centers)
        at_center += palette[..., :3, 3]
        sizes = np.linalg.norm(palette[..., :3, :3], axis=(2, 3))
        far = np.linalg.norm(at_center, axis=2) + sizes * reach
        return np.asarray(far.max(axis=1))

    def _moved(self, poses: Poses) -> Floats:
        """Return the largest displacement by shapes and correctives of the second body: (F,)."""
        far = np.zeros(len(poses.palette))
        if self._other_shapes is not None:
            far = far + np.abs(poses.weights) @ _lengths(self._other_shapes)
        if poses.corrective_weights.shape[1]:
            far = far + _norms(poses.corrective_weights) @ self._stretches
        return far

    def _rest(self, first: Poses, second: Poses) -> Floats:
        """Return the upper bound of |a - b|: (F,)."""
        found = np.full(len(first.palette), self._apart)
        if self._shapes is not None:
            both = self._other_shapes is not None
            change = first.weights - second.weights if both else first.weights
            found = found + np.abs(change) @ self._lengths
            if both:
                found = found + np.abs(second.weights) @ self._strayed
        if first.corrective_weights.shape[1]:
            change = first.corrective_weights
            if second.corrective_weights.shape[1]:
                change = change - second.corrective_weights
            found = found + _norms(change) @ self._stretches
        return found


def _are_equal(first: Skin, second: Skin) -> bool:
    """Return whether two skins have the same influences."""
    return first is second or (
        np.array_equal(first.starts, second.starts)
        and np.array_equal(first.joints, second.joints)
        and np.array_equal(first.weights, second.weights)
    )


def _spheres(body: Body, skin: Skin) -> tuple[Floats, Floats]:
    """Return bounding spheres of each joint's vertices: centres (J, 3) and radii (J,)."""
    order = np.argsort(skin.joints, kind="stable")
    joints, points = skin.joints[order], body.positions[owners(skin)[order]]
    found, starts = np.unique(joints, return_index=True)
    centers, radii = np.zeros((skin.n_joints, 3)), np.zeros(skin.n_joints)
    if len(found):
        low, high = np.minimum.reduceat(points, starts), np.maximum.reduceat(points, starts)
        centers[found] = 0.5 * (low + high)
        off = np.linalg.norm(points - centers[joints], axis=1)
        radii[found] = np.maximum.reduceat(off, starts)
    return centers, radii


def _joined(first: Skin, second: Skin, factor: float) -> Skin:
    """Return the sum of the first skin's weights and ``factor`` times the second's."""
    return merged(
        skin_from_entries(
            first.n_vertices,
            np.concatenate([owners(first), owners(second)]),
            np.concatenate([first.joints, second.joints]),
            np.concatenate([first.weights, factor * second.weights]),
            first.inverse_bind,
        )
    )


def _sums(skin: Skin) -> Floats:
    """Return the sum of absolute weights of each vertex: (V,)."""
    return np.bincount(owners(skin), np.abs(skin.weights), skin.n_vertices).astype(np.float64)


def _lengths(directions: Floats | None) -> Floats:
    """Return the largest displacement of a vertex by each blend shape: (S,)."""
    if directions is None:
        return np.zeros(0)
    return np.sqrt(np.einsum("sva,sva->sv", directions, directions).max(axis=1, initial=0.0))


def _norms(weights: Floats) -> Floats:
    """Return the norm of the nine corrective weights of each joint: (F, J)."""
    return np.asarray(np.linalg.norm(weights.reshape(len(weights), -1, _NUMBERS), axis=2))


def _stretches(correctives: Floats | None) -> Floats:
    """Return upper bounds of the displacement by nine corrective weights of norm 1: (J,)."""
    global _known
    if correctives is None:
        return np.zeros(0)
    known, found = _known
    if known is None or known() is not correctives:
        squares = np.einsum("pva,pva->pv", correctives, correctives)
        of_joints = squares.reshape(len(squares) // _NUMBERS, _NUMBERS, -1).sum(axis=1)
        found = np.sqrt(of_joints.max(axis=1, initial=0.0))
        if not correctives.flags.writeable:
            _known = weakref.ref(correctives), found
    return found


def _largest_stretch(palette: Floats) -> Floats:
    """Return upper bounds of the palettes' spectral norms: (F,), exact for rotations."""
    linear = palette[..., :3, :3]
    squares = np.swapaxes(linear, -1, -2) @ linear
    return np.asarray(np.sqrt(np.abs(squares).sum(axis=-1).max(axis=(1, 2))))


# Single-precision estimates of vertex distances, which select candidates for exact measurement.
#
# Many frames are skinned together, a few hundred vertices at a time, so that their matrices stay
# in the CPU cache. Candidates are then measured in double precision.
class Estimator:
    """Estimator for two bodies with the same vertices.

    ``first``, ``second``: the bodies, stored in single precision.
    """

    def __init__(self, first: Body, second: Body) -> None:
        self._first, self._second = _Rest(first), _Rest(second)
        self._gap = (first.positions - second.positions).T.ravel().astype(np.float32)
        self._strayed = None
        if first.shapes is not None and second.shapes is not None:
            self._strayed = _rows(first.shapes - second.shapes)
        self._skins = first.skin, second.skin
        self._excess = _weighted_sums(first) - _weighted_sums(second)
        self._left = 1.0 - _weighted_sums(second)

    def of_rest(self, first: Poses, second: Poses) -> Single:
        """Return upper bounds of the distances between the rest meshes: (F, V)."""
        corrective_weights = first.corrective_weights
        if second.corrective_weights.shape[1]:
            corrective_weights = corrective_weights - second.corrective_weights
        change = first.weights
        if self._second.shapes is not None:
            change = change - second.weights
        gap = replace(first, corrective_weights=corrective_weights, weights=change)
        off = self._first.moves(gap) + self._gap
        if self._strayed is not None:
            off = off + second.weights.astype(np.float32) @ self._strayed
        found = _estimated_lengths(off.reshape(len(off), 3, -1))
        return np.broadcast_to(found * (1.0 + _STEPS), (len(first.palette), found.shape[1]))

    def of_skinned(self, first: Poses, second: Poses) -> Single:
        """Return upper bounds of the distances between the skinned vertices: (F, V)."""
        # Move both palettes near the origin, where single precision is more accurate.
        shift = first.shifts - second.shifts
        away = first.palette[:, 0, :3, 3]
        palettes = first.palette.copy(), second.palette.copy()
        palettes[0][..., :3, 3] -= away[:, None]
        palettes[1][..., :3, 3] -= (away + shift)[:, None]
        rests = self._first.of(first), self._second.of(second)
        off = np.zeros((len(away), 3, rests[0].shape[2]), np.float32)
        for sign, rest, skin, palette in zip((1, -1), rests, self._skins, palettes, strict=True):
            rows = palette[:, :, :3].transpose(0, 2, 3, 1).reshape(len(palette), 12, -1)
            rows = rows.astype(np.float32)
            for block in blocks_of(skin):
                blended = np.take(rows, block.joints, axis=2) @ block.weights.astype(np.float32)
                blended = blended.reshape(len(rows), 3, 4, -1)
                moved = blended[:, :, 3]
                for axis in range(3):
                    moved += blended[:, :, axis] * rest[:, axis, None, block.rows]
                off[..., block.rows] += np.float32(sign) * moved
        for vectors, amounts in ((away, self._excess), (shift, self._left)):
            if amounts.any():
                off += (vectors[:, :, None] * amounts).astype(np.float32)
        found = _estimated_lengths(off)
        return np.asarray(found + _doubts(palettes, rests)[:, None].astype(np.float32))


class _Rest:
    """Rest meshes of a body in many poses."""

    def __init__(self, body: Body) -> None:
        self.positions = body.positions.T.astype(np.float32)
        self.shapes = _rows(body.shapes)
        self.correctives = _rows(body.correctives)

    def moves(self, poses: Poses) -> Single:
        """Return displacements by shapes and correctives: (F, 3 V), or (1, 3 V) if constant."""
        found = np.zeros((1, self.positions.size), np.float32)
        for directions, weights in (
            (self.shapes, poses.weights),
            (self.correctives, poses.corrective_weights),
        ):
            if directions is not None and weights.any():
                found = found + weights.astype(np.float32) @ directions
        return found

    def of(self, poses: Poses) -> Single:
        """Return the rest mesh of each pose: (F, 3, V)."""
        moved = self.moves(poses)
        rest = moved.reshape(len(moved), 3, -1) + self.positions
        return np.broadcast_to(rest, (len(poses.palette), *self.positions.shape))


def _rows(directions: Floats | None) -> Single | None:
    """Return directions (S, V, 3) as rows of all x, then y, then z: (S, 3 V)."""
    if directions is None:
        return None
    turned = directions.transpose(0, 2, 1).astype(np.float32, order="C")
    return turned.reshape(len(directions), -1)


def _estimated_lengths(vectors: Single) -> Single:
    """Return the lengths of vectors (F, 3, V): (F, V)."""
    squares = vectors[:, 0] * vectors[:, 0]
    squares += vectors[:, 1] * vectors[:, 1]
    squares += vectors[:, 2] * vectors[:, 2]
    return np.sqrt(squares, out=squares)


def _weighted_sums(body: Body) -> Floats:
    """Return the sum of weights of each vertex in double precision: (V,)."""
    skin = body.skin
    owners = np.repeat(np.arange(skin.n_vertices), np.diff(skin.starts))
    return np.bincount(owners, skin.weights, skin.n_vertices).astype(np.float64)


def _doubts(palettes: tuple[Floats, Floats], rests: tuple[Single, Single]) -> Floats:
    """Return error bounds of single precision: (F,)."""
    found = np.zeros(len(palettes[0]))
    for palette, rest in zip(palettes, rests, strict=True):
        linear = np.abs(palette[..., :3, :3]).sum(axis=3).max(axis=(1, 2))
        far = np.abs(palette[..., :3, 3]).max(axis=(1, 2))
        found += _STEPS * (far + linear * np.abs(rest).max(axis=(1, 2), initial=0.0))
    return found
