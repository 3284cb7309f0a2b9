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
# for n frames, and returns, adds a pattern to it, and nothing around:
_PATTERNS = {1: (-0.5, 1.0, -0.5), 2: (-0.5, 0.5, 0.5, -0.5)}
# Of 120 clips of artists, blows and landings come near it, but with steps around that are half as
# long, with d beside that is a quarter as large (for two frames, a fifth), or without returning.
_SHAPE = 0.25  # maximum distance of d from the pattern, relative to the pattern's largest value
_RETURNS = 1.5  # minimum ratio of a to the distance between the frames before and after
_STEPS, _OTHERS = 0.5, (4.0, 6.0)  # maximum step around, relative to a; minimum ratio to other d
# A joint that is fast and steady pops by less than two of its steps, and meanwhile goes on.
_FAST_STEPS, _FAST_OTHERS = 0.7, 10.0
# In quick motions of limbs, d is as large as that of a pop. Their fourth differences are smaller:
# of a swing of w radians a frame, they are (2 - 2 cos w)^2, which is 0.07 for a period of 12
# frames, while those of a pop reach 6. Of the same clips, blows that end in a hold come near its
# pattern, but the steps before and after it are unlike.
_FOURTH = {1: (1.0, -4.0, 6.0, -4.0, 1.0), 2: (1.0, -3.0, 2.0, 2.0, -3.0, 1.0)}
_QUICK_STEPS, _QUICK_OTHERS = 1.0, 6.0
_ALIKE = 0.5  # minimum ratio of the steps before and after, unless both are much shorter than a
_SHORT = 0.1  # length of such steps, relative to a
_NEAR = 4  # number of steps before and after
_AROUND = 8  # frames before and after that are compared
_SEEN = 2  # of these, the minimum number on each side
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
    columns = np.flatnonzero((np.linalg.norm(off, axis=2) > 0.5 * least).any(axis=0))
    if len(columns) == 0:
        return None
    off, values = off[:, columns], values[:, columns]
    known = _known(track, rows)[:, joints[columns]]
    each = [_matches(values, off, known[1:-1], n_frames, least) for n_frames in _PATTERNS]
    each += [_quick_matches(values, known, n_frames, least) for n_frames in _FOURTH]
    _, frame, place = np.nonzero(each)
    size = np.stack(each)[np.nonzero(each)]
    if len(size) == 0:
        return None
    order = np.argsort(-size, kind="stable")
    size, frame, place = size[order], frame[order], place[order]
    found_joints = np.asarray(joints, dtype=np.int64)[columns[place]]
    return _Pops(float(size[0]), rows[frame], found_joints)


def _matches(values: Floats, off: Floats, known: Bools, n_frames: int, least: float) -> Floats:
    """Return the size of pops of ``n_frames`` that begin in a frame, else 0: (F, N)."""
    pattern = np.array(_PATTERNS[n_frames])
    result, width = np.zeros(values.shape[:2]), len(pattern)
    count = len(off) - width + 1
    # Row r of a window is about the pop that begins in frame r + 2.
    windows = np.lib.stride_tricks.sliding_window_view(off, width, axis=0)
    fit = _fitted(windows, pattern, least)
    if fit is None:
        return result
    size, errors = fit
    peak = size * pattern.max()
    lengths = np.linalg.norm(off, axis=2)
    around = [*range(-_AROUND, 0), *range(width, width + _AROUND)]
    others = largest_around(lengths, around)[:count]
    steps = np.linalg.norm(np.diff(values, axis=0), axis=2)
    # Two steps lead away and back; those before and after are the usual ones.
    nearby = [*range(1 - _NEAR, 1), *range(2 + n_frames, 2 + n_frames + _NEAR)]
    usual = largest_around(steps, nearby)[:count]
    across = np.linalg.norm(values[n_frames + 2 :] - values[1 : -n_frames - 1], axis=2)[:count]
    is_pop = (size > least) & (errors < _SHAPE * peak)
    at_rest = (usual < _STEPS * size) & (peak > _OTHERS[n_frames - 1] * others)
    is_pop &= (at_rest & (size > _RETURNS * across)) | (
        (usual < _FAST_STEPS * size) & (peak > _FAST_OTHERS * others)
    )
    is_pop &= np.lib.stride_tricks.sliding_window_view(known, width, axis=0).all(axis=2)
    is_pop[:_SEEN] = is_pop[max(count - _SEEN, 0) :] = False
    result[2 : 2 + count] = np.where(is_pop, size, 0.0)
    return result


def _fitted(windows: Floats, pattern: Floats, least: float) -> tuple[Floats, Floats] | None:
    """Return the size of a pattern in windows (F, N, 3, P) by least squares, and the error left.

    (F, N) each; None if no size exceeds ``least``.
    """
    factors = windows @ pattern / (pattern @ pattern)
    size = np.linalg.norm(factors, axis=2)
    if not (size > least).any():
        return None
    return size, np.linalg.norm(windows - factors[..., None] * pattern, axis=2).max(axis=2)


def _quick_matches(values: Floats, known: Bools, n_frames: int, least: float) -> Floats:
    """Return the size of pops of ``n_frames`` by fourth differences, else 0: (F, N)."""
    pattern, result = np.array(_FOURTH[n_frames]), np.zeros(values.shape[:2])
    width, fourth = len(pattern), np.diff(values, n=4, axis=0)
    count = len(fourth) - width + 1
    if count <= 0:
        return result
    # Row r of a window is about the pop that begins in frame r + 4.
    windows = np.lib.stride_tricks.sliding_window_view(fourth, width, axis=0)
    fit = _fitted(windows, pattern, least)
    if fit is None:
        return result
    size, errors = fit
    peak = size * np.abs(pattern).max()
    around = [*range(-_AROUND, 0), *range(width, width + _AROUND)]
    others = largest_around(np.linalg.norm(fourth, axis=2), around)[:count]
    steps = np.linalg.norm(np.diff(values, axis=0), axis=2)
    usual = largest_around(steps, [*range(-1, 3), *range(4 + n_frames, 8 + n_frames)])[:count]
    beside = np.stack([steps[2 : 2 + count], steps[4 + n_frames :][:count]])
    alike = beside.min(axis=0) > _ALIKE * beside.max(axis=0)
    is_pop = (size > least) & (errors < _SHAPE * peak) & (peak > _QUICK_OTHERS * others)
    is_pop &= (usual < _QUICK_STEPS * size) & (alike | (beside.max(axis=0) < _SHORT * size))
    is_pop &= np.lib.stride_tricks.sliding_window_view(known, width + 4, axis=0).all(axis=2)
    result[4 : 4 + count] = np.where(is_pop, size, 0.0)
    return result


def _known(track: Track, rows: Indices) -> Bools:
    """Return where frames and their neighbours are defined and no jump is intended: (F, J)."""
    known = track.present[rows]
    known[1:-1] &= known[:-2] & known[2:]
    stepped = track.stepped[rows]
    for k in range(1, track.per_frame):
        stepped[1:] |= track.stepped[rows[1:] - k]
    stepped[:-1] |= stepped[1:]
    return known[:, None] & ~stepped
