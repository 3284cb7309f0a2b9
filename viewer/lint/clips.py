"""Clips: keys in time order and within limits, frames that are there, joints that do not jump."""

from __future__ import annotations

import numpy as np

from viewer.errors import counted
from viewer.lint._finding import Finding, Subject
from viewer.lint._tracks import Indices, Track, frame_numbers, key_times, track_of
from viewer.phrases import listed
from viewer.rig.arrays import Floats
from viewer.rig.captures.points import PointClip
from viewer.rig.motion.clip import SHORTEST, Clip
from viewer.rig.motion.clip_table import evaluate_all
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.motion.timing import Timing
from viewer.rig.number_text import number_text
from viewer.rig.posing.dof_text import beyond_text
from viewer.rig.skeleton import Skeleton, joint_labels

__all__ = ["check", "missing_frames"]

_SIZES = 15.0  # of a figure that a joint may move in a second: some 30 m/s for a person
_ALIKE = 1e-9  # share by which speeds of joints that move together differ
_ROUNDING = 1e-6  # radians or lengths beyond a limit
_MOST = 20_000  # times at which curves are held to their limits


def check(subject: Subject) -> list[Finding]:
    """Look at the clip of an actor with a skeleton."""
    clip, skeleton = subject.actor.clip, subject.actor.figure.skeleton
    if clip is None or skeleton is None or isinstance(clip, PointClip):
        return []
    findings = []
    if isinstance(clip, SampledClip):
        findings += missing_frames(subject, clip.timing)
    else:
        findings += _keys(subject, clip)
        findings += _outside(subject, clip, skeleton)
    if clip.end - clip.start <= SHORTEST:
        text = f"it begins and ends at {number_text(clip.start)} s"
        return [*findings, subject.found("C010.plain", message=text, part="clip")]
    track = track_of(subject)
    assert track is not None  # there is a clip and a skeleton
    return findings + _jumps(subject, track, skeleton) + _turns(subject, track, skeleton)


def missing_frames(subject: Subject, timing: Timing) -> list[Finding]:
    """Report gaps between the first and the last frame in which somebody is there."""
    present = timing.present
    there = np.flatnonzero(present)
    if len(there) == 0:
        return []
    # Who comes later or leaves earlier than others is no fault.
    gaps = np.flatnonzero(~present[there[0] : there[-1]]) + there[0]
    if len(gaps) == 0:
        return []
    runs = np.split(gaps, np.flatnonzero(np.diff(gaps) > 1) + 1)
    numbers = gaps + timing.first_frame
    missing = counted(len(gaps), "frame", "is", "are", of=int(there[-1] - there[0]) + 1)
    shown = listed([_run_text(run + timing.first_frame) for run in runs])
    times = timing.start + gaps / timing.frame_rate + subject.actor.offset
    return [
        subject.found(
            "C005.plain",
            message=f"{missing} missing in {counted(len(runs), 'gap')}: {shown}",
            part="clip",
            frames=numbers,
            times=times,
            # In the gap nobody is there to be seen.
            seek=float(times[0]) - 1.0 / timing.frame_rate,
        )
    ]


def _run_text(numbers: Indices) -> str:
    if len(numbers) == 1:
        return f"frame {numbers[0]}"
    return f"frames {numbers[0]} to {numbers[-1]}"


def _keys(subject: Subject, clip: Clip) -> list[Finding]:
    """Report keys that share their time with the one before."""
    times = [channel.times[1:][np.diff(channel.times) <= SHORTEST] for channel in clip.channels]
    count = sum(map(len, times))
    if count == 0:
        return []
    channel = next(index for index, found in enumerate(times) if len(found))
    return [
        subject.found(
            "C002.plain",
            message=f"{counted(count, 'key', 'lies', 'lie')} at the time of the one before, first in "
            f"channel {channel} at {number_text(float(times[channel][0]))} s",
            part="clip",
            times=np.unique(np.concatenate(times)) + subject.actor.offset,
            at=("channels", channel),
        )
    ]


def _outside(subject: Subject, clip: Clip, skeleton: Skeleton) -> list[Finding]:
    """Report curves that leave the limits: they are held there while playing."""
    times = np.append(key_times(subject, clip)[:_MOST], clip.end)
    targets, values = evaluate_all(clip, times)
    low, high = skeleton.dof_limits[targets].T
    beyond = np.maximum(low - values, values - high)
    outside = np.flatnonzero(beyond.max(axis=0) > _ROUNDING)
    if len(outside) == 0:
        return []
    worst = int(outside[beyond[:, outside].max(axis=0).argmax()])
    row = int(beyond[:, worst].argmax())
    number = int(frame_numbers(subject, times[row : row + 1])[0])
    text = beyond_text(
        skeleton,
        int(targets[worst]),
        float(values[row, worst]),
        f" in frame {number} at {number_text(times[row] + subject.actor.offset, '.3f')} s",
    )
    order = np.flatnonzero((beyond > _ROUNDING).any(axis=1))
    return [
        subject.found(
            "C006.plain",
            message=f"{counted(len(outside), 'curve', 'leaves its', 'leave their')} limits: {text}",
            part="clip",
            joints=np.unique(skeleton.dof_joints[targets[outside]]),
            times=times[order] + subject.actor.offset,
            seek=float(times[row] + subject.actor.offset),
            at=("channels", int(targets[worst])),
        )
    ]


def _jumps(subject: Subject, track: Track, skeleton: Skeleton) -> list[Finding]:
    limit = subject.options.max_speed
    limit = _SIZES * track.size if limit is None else limit * track.scale
    speeds = np.zeros((len(track.times), skeleton.n_joints))
    steps = np.linalg.norm(np.diff(track.positions, axis=0), axis=2)
    speeds[1:] = steps / np.diff(track.times)[:, None]
    return _too_fast(subject, track, skeleton, speeds, limit, "C003")


def _turns(subject: Subject, track: Track, skeleton: Skeleton) -> list[Finding]:
    rates = np.zeros((len(track.times), skeleton.n_joints))
    cosines = np.abs(np.einsum("fjq,fjq->fj", track.rotations[1:], track.rotations[:-1]))
    rates[1:] = 2.0 * np.arccos(np.minimum(cosines, 1.0)) / np.diff(track.times)[:, None]
    return _too_fast(subject, track, skeleton, rates, subject.options.max_turn, "C004")


def _too_fast(
    subject: Subject, track: Track, skeleton: Skeleton, rates: Floats, limit: float, code: str
) -> list[Finding]:
    """Report frames in which a joint came from the frame before faster than the limit."""
    rates[1:][~(track.present[1:] & track.present[:-1])] = 0.0
    fastest = rates.max(axis=1)
    frames = np.flatnonzero(fastest > limit)
    if len(frames) == 0:
        return []
    frames = frames[np.argsort(-fastest[frames], kind="stable")]
    rate = float(fastest[frames[0]])
    # Of joints that move as one, up to rounding, the parent of the others is named.
    joint = int((rates[frames[0]] >= (1.0 - _ALIKE) * rate).argmax())
    label = joint_labels(skeleton)[joint]
    if code == "C003":
        speed, most = (subject.speed(value / track.scale) for value in (rate, limit))
        how = f"moves at {speed} (limit {most})"
    else:
        how = f"turns by {np.degrees(rate):.0f} degrees a second (limit {np.degrees(limit):.0f})"
    joints = np.flatnonzero((rates > limit).any(axis=0))
    each = track.of_each(frames)
    return [
        subject.found(
            f"{code}.plain",
            message=f"{counted(len(each), 'frame', of=track.n_frames)}: {label} {how} to frame "
            f"{track.numbers[frames[0]]} at {number_text(track.times[frames[0]], '.3f')} s",
            part="clip",
            joints=np.concatenate([[joint], joints[joints != joint]]),
            frames=track.numbers[each],
            times=track.times[each],
            at=("frames", int(frames[0])),
        )
    ]
