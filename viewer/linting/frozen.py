"""Check of motions for frozen frames: the whole body stops within a frame, and goes on."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from viewer.diagnostics import frame_range
from viewer.linting._finding import Finding
from viewer.linting._subject import Subject, Track, track_of
from viewer.phrases import counted, listed
from viewer.rigs.arrays import Floats, runs_of
from viewer.rigs.geometry.quaternion import angles_between
from viewer.rigs.geometry.vectors import lengths_of

# A body that holds a pose slows down before, and speeds up again, one joint after another. Frames
# that were written twice do not: most joints that move at all then stop within a frame, whether the
# motion is quick or an idle.
_STILL = 0.01  # maximum step of a frozen frame, relative to the median of the clip
# A joint that slows down evenly moves by 9, 7, 5, 3 and 1 units, so that its last step is 0.2 of
# their median; one that stops within a frame moves by about that median.
_ABRUPT, _BESIDE = 0.5, 5  # minimum ratio of that step, and the number of steps
_MOVING = 0.5  # minimum step beside them that no slowing body makes, relative to that median
_MOST_JOINTS = 0.5  # minimum fraction of the moving joints that stop and go on so
# Frames that were replaced by copies of one hide the movement, which the body catches up within a
# frame: most joints move by more than in any frame around, and together about as far as they move
# elsewhere in that time. A pose that snaps into the next one is not that close.
_JUMP = 3.0  # minimum ratio of that step to those around
_CATCHES_UP = 0.3, 2.0  # its ratio to the median step times the number of frames
_FOR = 0.1  # seconds; a recording that was written at a higher rate repeats frames for less
_ROUNDING = 1e-6  # maximum step, radians or relative to the size, of a body that rests
_MOSTLY = 0.5  # minimum fraction of frames in which the body moves
_KEYED = 0.5  # minimum fraction of these frames with keys, in a clip of keys
_FEWEST = 3  # minimum number of frames


def check(subject: Subject) -> Iterator[Finding]:
    """Check the steps of all joints together."""
    track = track_of(subject)
    if track is None or not track.size > 0.0:
        return
    rows = track.on_frames()
    if len(rows) < 2 * _FEWEST:
        return
    turns = angles_between(track.rotations[rows[1:]], track.rotations[rows[:-1]])
    moves = lengths_of(np.diff(track.positions[rows], axis=0)) / track.size
    known = track.present[rows[1:]] & track.present[rows[:-1]]
    # A root that travels with a held pose is not frozen, and one that lands stops within a frame.
    steps = np.where(known, turns.mean(axis=1), np.nan)
    moving = steps[steps > _ROUNDING]
    if len(moving) < _MOSTLY * len(steps):
        return  # a body that mostly rests stops and goes on
    usual = float(np.median(moving))
    still = (steps < _STILL * usual) & (moves.mean(axis=1) < _STILL * usual)
    step = float(track.times[rows[1]] - track.times[rows[0]])
    least = max(_FEWEST, round(_FOR / step))
    turning = np.where(known[:, None], turns, 0.0)
    found = [
        (first, last)
        for first, last in runs_of(still)
        if last - first >= least
        and first > 0
        and last < len(steps)
        and _is_frozen(turning, first, last, usual)
        and _is_keyed(subject, rows[first], rows[last], track)
    ]
    if not found:
        return
    frames = np.concatenate([rows[first + 1 : last + 1] for first, last in found])
    numbers = track.numbers
    yield subject.found(
        "C021.frames: {n} the frame before, in the middle of a movement: {ranges}",
        n=counted(len(frames), "frame", "repeats", "repeat", of=track.n_frames),
        all=track.n_frames,
        ranges=listed(
            [
                frame_range(int(numbers[rows[first + 1]]), int(numbers[rows[last]]))
                for first, last in found
            ]
        ),
        part="clip",
        frames=numbers[frames],
        times=track.times[frames],
        at=("frames", int(frames[0])),
    )


def _is_frozen(turns: Floats, first: int, last: int, usual: float) -> bool:
    """Return whether still steps are no hold; turns (F, J) of all steps, and their median."""
    moving = turns[:, (turns > _ROUNDING).mean(axis=0) > _MOSTLY]
    before, after = moving[max(first - _BESIDE, 0) : first], moving[last : last + _BESIDE]
    if min(turns[first - 1].mean(), turns[last].mean()) > _MOVING * usual:
        return True
    if moving.shape[1] == 0:
        return False
    if _is_abrupt(before[::-1]) and _is_abrupt(after):
        return True
    for step, around in (
        (first - 1, np.concatenate([before[:-1], after])),
        (last, np.concatenate([before, after[1:]])),
    ):
        jumps = (moving[step] > _JUMP * around.max(axis=0)).mean() > _MOST_JOINTS
        hidden, caught = (last - first) * usual, float(turns[step].mean())
        if jumps and _CATCHES_UP[0] * hidden < caught < _CATCHES_UP[1] * hidden:
            return True
    return False


def _is_abrupt(steps: Floats) -> bool:
    """Return whether most joints move beside a hold at once; steps (N, J), the nearest first."""
    abrupt = (steps[0] > _ROUNDING) & (steps[0] > _ABRUPT * np.median(steps, axis=0))
    return bool(abrupt.mean() > _MOST_JOINTS)


def _is_keyed(subject: Subject, first: int, last: int, track: Track) -> bool:
    """Return whether the frames between two rows have keys: without them, a hold is intended."""
    clip = subject.actor.joint_motion
    if clip is None or clip.kind == "sampled":
        return True
    start, end = track.times[[first, last]] - subject.actor.offset
    count = (last - first) // track.per_frame - 1
    every = (
        [channel.own_times for channel in clip.channels]
        if clip.kind == "transforms"
        else [channel.times for channel in clip.channels]
    )
    return any(((times > start) & (times < end)).sum() >= _KEYED * count for times in every)
