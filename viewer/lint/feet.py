"""Checks of a body's feet: sliding during ground contact, sinking into the ground, and floating."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from viewer.diagnostics import Phrase
from viewer.lint._finding import Finding
from viewer.lint._subject import Subject, Track, track_of
from viewer.phrases import counted, listed, rounded
from viewer.rig.arrays import Bools, Floats
from viewer.rig.cleanup.frames import runs_of
from viewer.rig.feet import limits
from viewer.rig.feet.contacts import (
    foot_contacts,
    ground_velocity,
    half_window,
    on_moving_ground,
    slowest_points,
)
from viewer.rig.feet.ground import Ground, ground_under, resting_frames
from viewer.rig.feet.soles import extent
from viewer.rig.figure import Figure
from viewer.rig.geometry.vectors import axis_vector
from viewer.rig.skeleton import joint_labels


def check(subject: Subject) -> Iterator[Finding]:
    """Check the feet of a moving body: a skeleton whose joint names include two ankles."""
    figure = subject.actor.figure
    track = None if figure.skeleton is None else _moving(subject, figure)
    if track is None or figure.skeleton is None or subject.options.ground == "none":
        return
    feet = track.feet.tolist()
    if len(feet) < 2:
        return
    height, heights = extent(figure)[1], track.soles
    given = subject.options.ground
    ground, sinks = 0.0, limits.SINKS
    if isinstance(given, float | int):
        ground = float(given)
    else:
        step = float(track.times[1] - track.times[0])
        found = ground_under(subject.actor, subject.up, heights, track.present, step)
        if found.height is None:
            yield _unsure(subject, found, step)
            return
        ground, sinks = found.height, limits.SINKS_OF_GUESS if found.is_guess else limits.SINKS
    labels = [joint_labels(figure.skeleton)[joint] for joint in feet]
    yield from _sunk(subject, track, feet, labels, heights - ground, sinks * height)
    yield from _floating(subject, track, feet, heights - ground, height, given == "auto")
    yield from _slipped(subject, track, feet, labels, heights - ground)


def _moving(subject: Subject, figure: Figure) -> Track | None:
    clip = subject.actor.clip
    if clip is None or clip.end <= clip.start or len(subject.invalid.get("joints", ())):
        return None
    track = track_of(subject)
    return track if track is not None and track.size > 0.0 and len(track.times) > 2 else None


def _unsure(subject: Subject, found: Ground, step: float) -> Finding:
    """Report that the ground is unknown, and feet were therefore not checked."""
    if not found.levels:
        return subject.found(
            "C013.no-height: feet never rest long enough at one height: ground height unclear, "
            "feet not checked",
            part="clip",
        )
    levels = [
        Phrase("{height} for {seconds} s", height=rounded(height), seconds=rounded(count * step, 2))
        for height, count in found.levels
    ]
    return subject.found(
        "C013.heights: feet rest at {n} ({levels}): ground height unclear, feet not checked",
        n=counted(len(levels), "height"),
        levels=listed(levels),
        part="clip",
    )


def _sunk(
    subject: Subject,
    track: Track,
    feet: list[int],
    labels: list[str],
    heights: Floats,
    limit: float,
) -> Iterator[Finding]:
    """Report feet that sink deeper than a limit in figure units."""
    depths = np.where(track.present[:, None], -heights, 0.0)
    deepest = depths.max(axis=1)
    is_deep = np.pad(deepest > limit * track.scale, 1)
    # A single frame may be noise, unless it is far too deep.
    lasts = is_deep[1:-1] & (is_deep[:-2] | is_deep[2:])
    frames = np.flatnonzero(lasts | (deepest > limits.FAR_TOO_DEEP * limit * track.scale))
    if len(frames) == 0:
        return
    frames = frames[np.argsort(-deepest[frames], kind="stable")]
    worst = int(depths[frames[0]].argmax())
    each = track.of_each(frames)
    yield subject.found(
        "C008.foot: {n}: {joint} is {depth} below the ground at frame {frame}",
        n=counted(len(each), "frame", of=track.n_frames),
        all=track.n_frames,
        joint=labels[worst],
        depth=subject.length(float(deepest[frames[0]] / track.scale)),
        frame=int(track.numbers[frames[0]]),
        part="clip",
        joints=[feet[worst]],
        frames=track.numbers[each],
        times=track.times[each],
        at=("frames", int(frames[0])),
    )


def _floating(
    subject: Subject,
    track: Track,
    feet: list[int],
    heights: Floats,
    height: float,
    may_step: bool,
) -> Iterator[Finding]:
    """Report a body whose lower foot rests above the ground; ``may_step``: by less than a step."""
    lowest, size = heights.min(axis=1), track.scale * height
    step = float(track.times[1] - track.times[0])
    rests = resting_frames(lowest, track.present, step, size, limits.RESTS_FOR)
    most = limits.STEPS * size if may_step else np.inf
    frames = np.flatnonzero(rests & (lowest > limits.FLOATS * size) & (lowest < most))
    if len(frames) == 0:
        return
    frames = frames[np.argsort(-lowest[frames], kind="stable")]
    each = track.of_each(frames)
    yield subject.found(
        "C016.foot: {n}: both feet rest up to {height} above the ground, highest at frame {frame}",
        n=counted(len(each), "frame", of=track.n_frames),
        all=track.n_frames,
        height=subject.length(float(lowest[frames[0]] / track.scale)),
        frame=int(track.numbers[frames[0]]),
        part="clip",
        joints=feet,
        frames=track.numbers[each],
        times=track.times[each],
        at=("frames", int(frames[0])),
    )


def _slipped(
    subject: Subject,
    track: Track,
    feet: list[int],
    labels: list[str],
    heights: Floats,
) -> Iterator[Finding]:
    """Report a foot that slides along the ground, where feet do not stand."""
    if track.body <= 0.0:  # legs without a length
        return
    step = float(track.times[1] - track.times[0])
    paths = list(track.paths)
    how = runs_of(track.present), 1.0 / step, track.body, axis_vector(subject.up)
    velocity = ground_velocity(paths, *how)
    if velocity is not None:  # a motion in place: standing feet move with the ground
        paths = on_moving_ground(paths, (track.times[0] - track.times)[:, None] * velocity)
    speeds = np.stack([slowest_points(path, *how) for path in paths], axis=1)
    stands = np.zeros(speeds.shape, dtype=np.bool_)
    for foot, contacts in enumerate(foot_contacts(paths, *how)):
        for contact in contacts:
            stands[contact.start : contact.stop, foot] = True
    touches = (np.abs(heights) < limits.TOUCHES * track.body) & track.present[:, None]
    # Speeds are averaged over a window, so a foot must touch the ground in all of it.
    half, n_frames = half_window(1.0 / step) + 1, len(touches)
    for foot in range(len(feet)):
        for first, last in runs_of(touches[:, foot]):
            touches[first : first + half * (first > 0), foot] = False
            touches[max(last - half * (last < n_frames), 0) : last, foot] = False
    slides = _sliding(speeds / track.body, touches & ~stands, stands, step)
    # Distances by the trapezoidal rule; averaged speeds contain less noise than single steps.
    both = slides[1:] & slides[:-1]
    distances = (both * 0.5 * (speeds[1:] + speeds[:-1])).sum(axis=0) * step
    if not (distances > limits.FAR * track.body).any():
        return
    worst = int(distances.argmax())
    fastest = int(np.where(slides[:, worst], speeds[:, worst], 0.0).argmax())
    each = track.of_each(np.concatenate([[fastest], np.flatnonzero(slides.any(axis=1))]))
    yield subject.found(
        "C007.foot: {n}: {joint} slides by {distance} in total, at up to {speed} (frame {frame})",
        n=counted(len(each), "frame", of=track.n_frames),
        all=track.n_frames,
        joint=labels[worst],
        distance=subject.length(float(distances[worst] / track.scale)),
        speed=subject.speed(float(speeds[fastest, worst] / track.scale)),
        frame=int(track.numbers[fastest]),
        part="clip",
        joints=[feet[worst]],
        frames=track.numbers[each],
        times=track.times[each],
        at=("frames", fastest),
    )


def _sliding(speeds: Floats, low: Bools, stands: Bools, step: float) -> Bools:
    """Return the frames (F, N) in which low feet slide; ``speeds`` are body sizes per second."""
    # A foot also swings close to the ground, but while another foot stands, and only after speeding
    # up. So a foot slides if it stood before or stands afterwards and does not speed up much, or if
    # no other foot stands. Starting and landing feet slide only for short times. A foot that stays
    # low and moves for longer than any swing is dragged.
    moves = low & (speeds > limits.FAST) & (speeds < limits.SWINGS)
    result = np.zeros_like(moves)
    for foot in range(moves.shape[1]):
        is_alone = np.delete(stands, foot, axis=1).sum(axis=1) == 0
        for first, last in runs_of(moves[:, foot]):
            stood = bool(stands[max(first - 1, 0) : last + 1, foot].any())
            drifts = stood and bool(speeds[first:last, foot].max() < limits.DRIFTS)
            is_dragged = (last - first) * step > limits.DRAGS_FOR
            result[first:last, foot] = is_alone[first:last] | drifts | is_dragged
        for first, last in runs_of(result[:, foot]):
            result[first:last, foot] = last - first >= max(1, round(limits.SLIDES_FOR / step))
    return result
