"""Check of motions for frozen frames: the whole body stops within a frame, and goes on."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from viewer.diagnostics import frame_range
from viewer.linting._finding import Finding
from viewer.linting._subject import Subject, Track, track_of
from viewer.phrases import counted, listed
from viewer.rigs.cleanup.frames import runs_of
from viewer.rigs.geometry.quaternion import angles_between

# A body that holds a pose slows down before, and speeds up again. Frames that were written twice do
# not: the steps beside them are those of the moving body, compared with the median of the clip.
_STILL = 0.01  # maximum step of a frozen frame, relative to that median
_MOVING = 0.5  # minimum step beside them
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
    moves = np.linalg.norm(np.diff(track.positions[rows], axis=0), axis=2) / track.size
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
    found = [
        (first, last)
        for first, last in runs_of(still)
        if last - first >= least
        and first > 0
        and last < len(steps)
        and steps[first - 1] > _MOVING * usual
        and steps[last] > _MOVING * usual
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


def _is_keyed(subject: Subject, first: int, last: int, track: Track) -> bool:
    """Return whether the frames between two rows have keys: without them, a hold is intended."""
    clip = subject.actor.joint_motion
    if clip is None or clip.kind == "sampled":
        return True
    start, end = track.times[[first, last]] - subject.actor.offset
    count = (last - first) // track.per_frame - 1
    return any(
        ((channel.times > start) & (channel.times < end)).sum() >= _KEYED * count
        for channel in clip.channels
    )
