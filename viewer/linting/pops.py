"""Check of motions for pops: a joint that leaves its path for a frame or a few, and returns."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from viewer.data_classes import dataclass
from viewer.linting._finding import Finding
from viewer.linting._subject import Indices, Subject, Track, track_of, travelling_joints
from viewer.linting.clips import largest_around
from viewer.phrases import counted
from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.inspection.faults import distinct
from viewer.rigs.skeleton import Skeleton, joint_labels

# Frame f is off the path by d_f = x_f - (x_f-1 + x_f+1) / 2. A value that leaves a smooth path by a
# and returns in the next frame gives d = -a / 2, a, -a / 2 in three frames, and nothing around.
# Where a motion starts or stops in one frame, by a step of v, the neighbours are v apart and d is
# v / 2: one that returns is farther from their middle than they are from each other.
_RETURNS = 1.25  # minimum ratio of |d| to half the distance of the neighbours
_OTHERS = 5.0  # minimum ratio of |d| to those of the frames around, which show the usual motion
_STEPS = 0.5  # maximum step around, relative to |d|: the end of a blow is no pop
_SHAPE = 0.25  # maximum distance of d beside the pop from -d / 2, relative to |d|
_NEAR = 4  # number of steps before and after
_AROUND = 8  # frames before and after that are compared
_SEEN = 3  # of these, the minimum number on each side
_ANGLE = math.radians(6.0)  # smallest rotation that is seen as a pop
_DISTANCE = 0.04  # the same of a travelling joint, relative to its size: 70 mm for a person


def check(subject: Subject) -> Iterator[Finding]:
    """Check the rotations of all joints, and the paths of those that carry the body."""
    track, skeleton = track_of(subject), subject.actor.figure.skeleton
    if track is None or skeleton is None or not track.size > 0.0:
        return
    rows = track.on_frames()
    if len(rows) < 2 * _AROUND:
        return
    # Close to each other, unit quaternions are half the angle of their rotation apart.
    found = _pops(track, rows, 2.0 * track.turns(rows), np.arange(skeleton.n_joints), _ANGLE)
    if found is not None:
        yield _finding(
            subject,
            track,
            skeleton,
            found,
            "C020.rotation: {n}: {joint} rotates away by {size} at frame {frame}, {time:z.3f} s, "
            "and back",
            f"{math.degrees(found.size):.0f}°",
        )
    carriers = travelling_joints(track, skeleton)
    places = track.positions[rows][:, carriers]
    found = _pops(track, rows, places, carriers, _DISTANCE * track.size)
    if found is not None:
        yield _finding(
            subject,
            track,
            skeleton,
            found,
            "C020.position: {n}: {joint} jumps away by {size} at frame {frame}, {time:z.3f} s, and "
            "back",
            subject.length(found.size / track.scale),
        )


@dataclass(frozen=True, slots=True, eq=False)
class _Pops:
    """Values that leave their path and return."""

    size: float
    """The largest distance from the path."""
    rows: Indices
    """(N,): rows of the first frames off the path, the largest distance first."""
    joints: Indices
    """(N,): their joints."""


def _finding(
    subject: Subject,
    track: Track,
    skeleton: Skeleton,
    pops: _Pops,
    message: str,
    size: str,
) -> Finding:
    each, first = track.of_each(pops.rows), int(pops.rows[0])
    return subject.found(
        message,
        n=counted(len(each), "frame", of=track.n_frames),
        all=track.n_frames,
        joint=joint_labels(skeleton)[int(pops.joints[0])],
        size=size,
        frame=int(track.numbers[first]),
        time=float(track.times[first]),
        part="clip",
        joints=distinct(pops.joints),
        frames=track.numbers[each],
        times=track.times[each],
        at=("frames", first),
    )


def _pops(
    track: Track, rows: Indices, values: Floats, joints: Indices | Ints, least: float
) -> _Pops | None:
    """Return pops of the values (F, N, C) of joints (N,) that exceed a size."""
    off = values[1:-1] - 0.5 * (values[:-2] + values[2:])
    columns = np.flatnonzero((np.linalg.norm(off, axis=2) > least).any(axis=0))
    if len(columns) == 0:
        return None
    off, values = off[:, columns], values[:, columns]
    known = _known(track, rows)[1:-1, joints[columns]]
    size = np.where(known, np.linalg.norm(off, axis=2), 0.0)
    count, steps = len(size), np.linalg.norm(np.diff(values, axis=0), axis=2)
    others = largest_around(size, [*range(-_AROUND, -1), *range(2, _AROUND + 1)])
    # Two steps lead to each frame and away from it; those before and after are the usual ones.
    before = largest_around(steps[:-1], range(-_NEAR, 0))
    after = largest_around(steps[1:], range(1, _NEAR + 1))
    usual = np.maximum(before, after)
    across = 0.5 * np.linalg.norm(values[2:] - values[:-2], axis=2)
    is_pop = (size > least) & (size > _RETURNS * across) & (size > _OTHERS * others)
    is_pop &= usual < _STEPS * size
    beside = np.linalg.norm(off[1:] + 0.5 * off[:-1], axis=2) < _SHAPE * size[:-1]
    is_pop[:-1] &= beside
    beside = np.linalg.norm(off[:-1] + 0.5 * off[1:], axis=2) < _SHAPE * size[1:]
    is_pop[1:] &= beside
    is_pop[: _SEEN - 1] = is_pop[count - _SEEN + 1 :] = False
    frames, places = np.nonzero(is_pop)
    if len(frames) == 0:
        return None
    order = np.argsort(-size[frames, places], kind="stable")
    frames, places = frames[order], places[order]
    found = np.asarray(joints, dtype=np.int64)[columns[places]]
    return _Pops(float(size[frames[0], places[0]]), rows[frames + 1], found)


def _known(track: Track, rows: Indices) -> Bools:
    """Return where frames and their neighbours are defined and no jump is intended: (F, J)."""
    known = track.present[rows]
    known[1:-1] &= known[:-2] & known[2:]
    stepped = track.stepped[rows]
    for k in range(1, track.per_frame):
        stepped[1:] |= track.stepped[rows[1:] - k]
    stepped[:-1] |= stepped[1:]
    return known[:, None] & ~stepped
