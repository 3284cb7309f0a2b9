"""Checks of clips: keys in time order and within limits, missing frames, and jumping joints."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import Phrase
from viewer.formats._frame_gaps import frame_spans
from viewer.linting._finding import Finding
from viewer.linting._subject import (
    Indices,
    Subject,
    Track,
    frame_numbers,
    key_times,
    track_of,
    travelling_joints,
)
from viewer.linting.pops import shifts
from viewer.phrases import counted, listed
from viewer.rigs.arrays import Bools, Floats, Ints, largest_first
from viewer.rigs.geometry.quaternion import angles_between
from viewer.rigs.geometry.vectors import lengths_of
from viewer.rigs.motion.clip import SHORTEST, Clip, evaluate_all
from viewer.rigs.motion.timing import Timing
from viewer.rigs.posing.dof_text import beyond_text
from viewer.rigs.skeleton import Skeleton, joint_labels

_SIZES = 15.0  # maximum speed of a joint, in figure sizes per second: about 30 m/s for a person
_LEAPS = 5.0  # the same for a root that moves slowly before and after, horizontally: 10 m/s
_SLOWLY = 0.2  # maximum speed before and after, relative to the speed in between
_BESIDE = 4  # number of steps before and after for which a pose is held
# A body that is displaced keeps its pose; one that takes another pose between two that are held is
# blocked, even where the rest of the motion is not.
_OTHER_POSE = math.radians(2.0)  # smallest rotation of a joint that takes another pose
_MANY = 0.25  # minimum fraction of these among the joints that ever rotate
_ALIKE = 1e-9  # relative tolerance for equal speeds of joints that move together
_ROUNDING = 1e-6  # tolerance beyond a limit, radians or lengths
_MOST = 20_000  # maximum number of times at which curves are compared with their limits


def check(subject: Subject) -> Iterator[Finding]:
    """Check the clip of an actor with a skeleton."""
    clip, skeleton = subject.actor.joint_motion, subject.actor.figure.skeleton
    if clip is None or skeleton is None:
        return
    if clip.timing is not None:
        yield from missing_frames(subject, clip.timing)
    elif clip.kind == "curves":
        yield from _keys(subject, clip)
        yield from _outside(subject, clip, skeleton)
    if clip.end - clip.start <= SHORTEST:
        yield subject.found(
            "C010.one-time: starts and ends at {time:zg} s", time=float(clip.start), part="clip"
        )
        return
    track = track_of(subject)
    assert track is not None  # the actor has a clip and a skeleton
    yield from _jumps(subject, track, skeleton)
    yield from _fast_rotations(subject, track, skeleton)


def missing_frames(subject: Subject, timing: Timing) -> Iterator[Finding]:
    """Report gaps between the first and the last frame in which the person is present."""
    present = timing.present
    there = np.flatnonzero(present)
    if len(there) == 0:
        return
    # People may appear later or leave earlier than others.
    gaps = np.flatnonzero(~present[there[0] : there[-1]]) + there[0]
    if len(gaps) == 0:
        return
    first = timing.first_frame
    spans = frame_spans(gaps + first)
    times = subject.times(timing, gaps)
    yield subject.found(
        "C005.gaps: {n} missing in {n_gaps}: {gaps}",
        n=counted(len(gaps), "frame", "is", "are", of=int(there[-1] - there[0]) + 1),
        all=int(there[-1] - there[0]) + 1,
        n_gaps=counted(len(spans), "gap"),
        gaps=listed(spans),
        part="clip",
        frames=gaps + first,
        times=times,
        # In the gap itself the person is not visible.
        seek=float(times[0]) - 1.0 / timing.frame_rate,
    )


def _keys(subject: Subject, clip: Clip) -> Iterator[Finding]:
    """Report keys at the same time as the previous one."""
    times = [channel.times[1:][np.diff(channel.times) <= SHORTEST] for channel in clip.channels]
    count = sum(map(len, times))
    if count == 0:
        return
    channel = next(index for index, found in enumerate(times) if len(found))
    yield subject.found(
        "C002.keys: {n} the same time as the previous key (first: channel {channel} at "
        "{time:zg} s)",
        n=counted(count, "key", "has", "have"),
        channel=channel,
        time=float(times[channel][0]),
        part="clip",
        times=np.unique(np.concatenate(times)) + subject.actor.offset,
        at=("channels", channel),
    )


def _outside(subject: Subject, clip: Clip, skeleton: Skeleton) -> Iterator[Finding]:
    """Report curves that exceed the limits, to which they are clamped during playback."""
    times = np.append(key_times(subject, clip)[:_MOST], clip.end)
    targets, values = evaluate_all(clip, times)
    low, high = skeleton.dof_limits[targets].T
    beyond = np.maximum(low - values, values - high)
    outside = np.flatnonzero(beyond.max(axis=0) > _ROUNDING)
    if len(outside) == 0:
        return
    worst = int(outside[beyond[:, outside].max(axis=0).argmax()])
    row = int(beyond[:, worst].argmax())
    number = int(frame_numbers(subject, times[row : row + 1])[0])
    when = Phrase(
        " in frame {frame} at {time:z.3f} s",
        frame=number,
        time=float(times[row] + subject.actor.offset),
    )
    order = np.flatnonzero((beyond > _ROUNDING).any(axis=1))
    yield subject.found(
        "C006.curves: {n} limits: {dof}",
        n=counted(len(outside), "curve", "exceeds its", "exceed their"),
        dof=beyond_text(skeleton, int(targets[worst]), float(values[row, worst]), when),
        part="clip",
        joints=np.unique(skeleton.dof_joints[targets[outside]]),
        times=times[order] + subject.actor.offset,
        seek=float(times[row] + subject.actor.offset),
        at=("channels", int(targets[worst])),
    )


def _jumps(subject: Subject, track: Track, skeleton: Skeleton) -> Iterator[Finding]:
    given = subject.options.max_speed
    limit = _SIZES * track.size if given is None else given * track.scale
    if limit == 0.0:  # a single joint without a mesh has no size
        return
    speeds = np.zeros((len(track.times), skeleton.n_joints))
    steps = lengths_of(np.diff(track.positions, axis=0))
    speeds[1:] = steps / np.diff(track.times)[:, None]
    speeds[track.stepped] = 0.0
    fast = _too_fast(track, speeds, limit)
    if fast is None and given is None:
        if track.is_blocked():
            return
        limit = _LEAPS * track.size
        rows = track.on_frames()
        flat = [axis for axis in range(3) if axis != (2 if subject.up == "z" else 1)]
        # Between frames, a keyed clip would show one jump as several steps.
        steps = lengths_of(np.diff(track.positions[rows][..., flat], axis=0))
        leaps = _leaps(
            steps / np.diff(track.times[rows])[:, None], travelling_joints(track, skeleton)
        )
        leaps[_poses(track, rows)] = 0.0
        speeds[:] = 0.0
        speeds[rows[1:]] = np.where(track.stepped[rows[1:]], 0.0, leaps)
        fast = _too_fast(track, speeds, limit)
    if fast is None:
        yield from _steps(subject, track, skeleton) if given is None else ()
        return
    yield subject.found(
        "C003.joint: {n}: {joint} moves at {speed} at frame {frame}, {time:z.3f} s (limit {limit})",
        n=counted(len(fast.rows), "frame", of=track.n_frames),
        all=track.n_frames,
        joint=joint_labels(skeleton)[fast.joints[0]],
        speed=subject.speed(fast.rate / track.scale),
        limit=subject.speed(limit / track.scale, is_limit=True),
        frame=int(track.numbers[fast.worst]),
        time=float(track.times[fast.worst]),
        part="clip",
        joints=fast.joints,
        frames=track.numbers[fast.rows],
        times=track.times[fast.rows],
        at=("frames", fast.worst),
    )


def _steps(subject: Subject, track: Track, skeleton: Skeleton) -> Iterator[Finding]:
    """Report a body that shifts within a frame, and moves on from there as before."""
    rows, carriers = track.on_frames(), travelling_joints(track, skeleton)
    found = shifts(track, rows, carriers, ~_poses(track, rows))
    if found is None:
        return
    first, each = int(found.frames[0][0]), track.of_each(np.concatenate(found.frames))
    yield subject.found(
        "C003.step: {n}: {joint} shifts by {distance} at frame {frame}, {time:z.3f} s, unlike "
        "before and after",
        n=counted(len(each), "frame", of=track.n_frames),
        all=track.n_frames,
        joint=joint_labels(skeleton)[int(found.columns[0])],
        distance=subject.length(found.size / track.scale),
        frame=int(track.numbers[first]),
        time=float(track.times[first]),
        part="clip",
        joints=np.unique(found.columns),
        frames=track.numbers[each],
        times=track.times[each],
        at=("frames", first),
    )


def _poses(track: Track, rows: Indices) -> Bools:
    """Return which steps between rows lead from one held pose to another: (N - 1,)."""
    moves = lengths_of(np.diff(track.positions[rows], axis=0)).max(axis=1)
    angles = angles_between(track.rotations[rows[1:]], track.rotations[rows[:-1]])
    changes = (moves > _ROUNDING * track.size) | (angles > _ROUNDING).any(axis=1)
    around = [k for k in range(-_BESIDE, _BESIDE + 1) if k != 0]
    is_held = largest_around(changes[:, None].astype(float), around)[:, 0] == 0.0
    turned = angles > _OTHER_POSE
    fractions = turned.sum(axis=1) / max(1, np.count_nonzero(turned.any(axis=0)))
    result: Bools = is_held & (fractions >= _MANY)
    return result


def _leaps(speeds: Floats, carriers: Ints) -> Floats:
    """Return speeds (F - 1, J) of carriers much slower two steps before and after; else 0."""
    is_carrier = np.zeros(speeds.shape[1], dtype=np.bool_)
    is_carrier[carriers] = True
    others = largest_around(speeds, (-2, -1, 1, 2))
    return np.where((others < _SLOWLY * speeds) & is_carrier, speeds, 0.0)


def largest_around(values: Floats, shifts: Sequence[int]) -> Floats:
    """Return the largest of the values (F, N) some rows away from each row, 0 outside: (F, N)."""
    most, count = max(map(abs, shifts)), len(values)
    padded = np.pad(values, ((most, most), (0, 0)))
    return np.max([padded[most + k : most + k + count] for k in shifts], axis=0)


def _fast_rotations(subject: Subject, track: Track, skeleton: Skeleton) -> Iterator[Finding]:
    rates = np.zeros((len(track.times), skeleton.n_joints))
    steps = angles_between(track.rotations[1:], track.rotations[:-1])
    rates[1:] = steps / np.diff(track.times)[:, None]
    rates[track.stepped] = 0.0
    fast = _too_fast(track, rates, subject.options.max_rotation)
    if fast is None:
        return
    yield subject.found(
        "C004.joint: {n}: {joint} rotates at {rate:.0f} degrees per second at frame "
        "{frame}, {time:z.3f} s (limit {limit:.0f})",
        n=counted(len(fast.rows), "frame", of=track.n_frames),
        all=track.n_frames,
        joint=joint_labels(skeleton)[fast.joints[0]],
        rate=math.degrees(fast.rate),
        limit=math.degrees(subject.options.max_rotation),
        frame=int(track.numbers[fast.worst]),
        time=float(track.times[fast.worst]),
        part="clip",
        joints=fast.joints,
        frames=track.numbers[fast.rows],
        times=track.times[fast.rows],
        at=("frames", fast.worst),
    )


@dataclass(frozen=True, slots=True, eq=False)
class _TooFast:
    """Joints that are faster than a limit between two frames."""

    rate: float
    """The highest rate, per second."""
    worst: int
    """Row of the track at the end of the fastest movement."""
    rows: Indices
    """(N,): one row for each frame with a joint above the limit, worst first."""
    joints: Indices
    """(J,): indices of the joints, fastest first."""


def _too_fast(track: Track, rates: Floats, limit: float) -> _TooFast | None:
    """Return the joints that are faster than a limit; rates (F, J) are per second."""
    rates[1:][~(track.present[1:] & track.present[:-1])] = 0.0
    fastest = rates.max(axis=1)
    rows = np.flatnonzero(fastest > limit)
    if len(rows) == 0:
        return None
    rows = largest_first(rows, fastest)
    rate = float(fastest[rows[0]])
    # Of joints with equal speed, up to rounding, the topmost in the hierarchy is reported.
    joint = int((rates[rows[0]] >= (1.0 - _ALIKE) * rate).argmax())
    joints = np.flatnonzero((rates > limit).any(axis=0))
    first_then_others = np.concatenate([[joint], joints[joints != joint]])
    return _TooFast(rate, int(rows[0]), track.of_each(rows), first_then_others)
