"""Checks of a body's feet: sliding during ground contact, sinking into the ground, and floating."""

from __future__ import annotations

import numpy as np

from viewer.diagnostics import Phrase
from viewer.lint._finding import Finding
from viewer.lint._subject import Subject, Track, track_of
from viewer.rig.arrays import Bools, Floats
from viewer.rig.cleanup.frames import runs_of
from viewer.rig.feet.ground import Ground, ground_of, resting_frames
from viewer.rig.feet.soles import extent
from viewer.rig.figure import Figure
from viewer.rig.skeleton import joint_labels

# Depth below the ground relative to the height at rest: 17 mm for a person, 51 mm if it is a guess.
_SINKS, _SINKS_OF_GUESS = 0.01, 0.03
_FLOATS = 0.03  # height above the ground relative to the height at rest: 51 mm for a person
# 100 mm for a person: above this, the foot may be on a step unless the ground is given.
_STEPS = 0.06
_RESTS = 0.3  # minimum seconds for which the lower foot rests: at the top of a jump, it is 0.1
_FACTOR = 3.0  # multiple of the limit above which even a single frame is reported
# Lengths are relative to the size of the skeleton at rest: 1.9 m for a person with spread arms.
_TOUCHES = 0.02  # maximum height of a foot that touches the ground
_SLIDES = 0.15  # minimum speed that counts as sliding, per second
_DRIFTS = 0.5  # per second: a foot that stood still and then moves faster starts to swing
_LASTS = 0.2  # seconds for which a foot slides; starting and landing take less
_SWINGS = 1.0  # maximum speed, per second: a faster foot swings just above the ground
_DRAGS = 1.0  # seconds for which only a dragged foot stays low and moves: swings are shorter
_FAR = 0.03  # minimum total distance during one contact
_WINDOW = 0.1  # seconds over which a foot's speed is averaged: single frames are noisy


def check(subject: Subject) -> list[Finding]:
    """Check the feet of a moving body: a skeleton whose joint names include two ankles."""
    figure = subject.actor.figure
    track = None if figure.skeleton is None else _moving(subject, figure)
    if track is None or figure.skeleton is None or subject.options.ground == "none":
        return []
    feet = track.feet.tolist()
    if len(feet) < 2:
        return []
    up = 2 if subject.up == "z" else 1
    sole, height = extent(figure)
    heights = track.soles
    given = subject.options.ground
    ground, sinks = 0.0, _SINKS
    if isinstance(given, float | int):
        ground = float(given)
    else:
        step = float(track.times[1] - track.times[0])
        # The height of the figure at rest, or else the origin.
        axis, placement = 2 if figure.up == "z" else 1, subject.actor.placement
        likely = (float(placement[up, axis] * sole + placement[up, 3]), 0.0)
        found = ground_of(heights.min(axis=1), track.present, step, track.scale * height, likely)
        if found.height is None:
            return [_unsure(subject, found, step)]
        ground, sinks = found.height, _SINKS_OF_GUESS if found.is_guess else _SINKS
    labels = [joint_labels(figure.skeleton)[joint] for joint in feet]
    return [
        *_sunk(subject, track, feet, labels, heights - ground, sinks * height),
        *_floating(subject, track, feet, heights - ground, height, given == "auto"),
        *_slipped(subject, track, feet, labels, heights - ground, up),
    ]


def _moving(subject: Subject, figure: Figure) -> Track | None:
    clip = subject.actor.clip
    if clip is None or clip.end <= clip.start or len(subject.invalid.get("joints", ())):
        return None
    track = track_of(subject)
    return track if track is not None and track.size > 0.0 and len(track.times) > 2 else None


def _unsure(subject: Subject, found: Ground, step: float) -> Finding:
    """Report that the ground is unknown, and feet were therefore not checked."""
    if not found.levels:
        return subject.found("C013.no-height", part="clip")
    levels = [
        Phrase("resting-height", height=height, seconds=count * step)
        for height, count in found.levels
    ]
    return subject.found("C013.heights", n=len(levels), levels=levels, part="clip")


def _sunk(
    subject: Subject,
    track: Track,
    feet: list[int],
    labels: list[str],
    heights: Floats,
    limit: float,
) -> list[Finding]:
    """Report feet that sink deeper than a limit in figure units."""
    depths = np.where(track.present[:, None], -heights, 0.0)
    deepest = depths.max(axis=1)
    is_deep = np.pad(deepest > limit * track.scale, 1)
    # A single frame may be noise, unless it is far too deep.
    lasts = is_deep[1:-1] & (is_deep[:-2] | is_deep[2:])
    frames = np.flatnonzero(lasts | (deepest > _FACTOR * limit * track.scale))
    if len(frames) == 0:
        return []
    frames = frames[np.argsort(-deepest[frames], kind="stable")]
    worst = int(depths[frames[0]].argmax())
    each = track.of_each(frames)
    return [
        subject.found(
            "C008.foot",
            n=len(each),
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
    ]


def _floating(
    subject: Subject,
    track: Track,
    feet: list[int],
    heights: Floats,
    height: float,
    may_step: bool,
) -> list[Finding]:
    """Report a body whose lower foot rests above the ground.

    ``height``: height of the figure.
    ``may_step``: whether it may rest on something that is as high as a step.
    """
    lowest, size = heights.min(axis=1), track.scale * height
    step = float(track.times[1] - track.times[0])
    rests = resting_frames(lowest, track.present, step, size, _RESTS)
    most = _STEPS * size if may_step else np.inf
    frames = np.flatnonzero(rests & (lowest > _FLOATS * size) & (lowest < most))
    if len(frames) == 0:
        return []
    frames = frames[np.argsort(-lowest[frames], kind="stable")]
    each = track.of_each(frames)
    return [
        subject.found(
            "C016.foot",
            n=len(each),
            all=track.n_frames,
            height=subject.length(float(lowest[frames[0]] / track.scale)),
            frame=int(track.numbers[frames[0]]),
            part="clip",
            joints=feet,
            frames=track.numbers[each],
            times=track.times[each],
            at=("frames", int(frames[0])),
        )
    ]


def _slipped(
    subject: Subject,
    track: Track,
    feet: list[int],
    labels: list[str],
    heights: Floats,
    up: int,
) -> list[Finding]:
    """Report a foot that slides along the ground during contact."""
    stands = (np.abs(heights) < _TOUCHES * track.size) & track.present[:, None]
    step = float(track.times[1] - track.times[0])
    width = max(1, round(_WINDOW / step))
    if len(track.times) <= width + 2:
        return []
    flat = [axis for axis in range(3) if axis != up]
    along = track.positions[:, feet][..., flat]
    moved = np.linalg.norm(along[width:] - along[:-width], axis=2)
    speeds = moved / (width * step)
    low = _held(stands, width)
    shortest, longest = (max(1, round(seconds / step)) for seconds in (_LASTS, _DRAGS))
    slides = _sliding(speeds / track.size, low, shortest, longest)
    paths = np.array([_path(along[:, foot], slides[:, foot], width) for foot in range(len(feet))])
    if not (paths > _FAR * track.size).any():
        return []
    worst = int(paths.argmax())
    frames = np.flatnonzero(slides.any(axis=1)) + width
    fastest = int(np.where(slides[:, worst], speeds[:, worst], 0.0).argmax())
    each = track.of_each(np.concatenate([[fastest + width], frames]))
    return [
        subject.found(
            "C007.foot",
            n=len(each),
            all=track.n_frames,
            joint=labels[worst],
            distance=subject.length(float(paths[worst] / track.scale)),
            speed=subject.speed(float(speeds[fastest, worst] / track.scale)),
            frame=int(track.numbers[fastest + width]),
            part="clip",
            joints=[feet[worst]],
            frames=track.numbers[each],
            times=track.times[each],
            at=("frames", fastest + width),
        )
    ]


def _sliding(speeds: Floats, low: Bools, shortest: int, longest: int) -> Bools:
    """Return the windows in which low feet slide: (W, N).

    A foot swings close to the ground as well, but while another foot stands still and only after
    speeding up. So a foot slides if it stood still before and does not speed up much, or if no
    other foot stands still. Starting and landing feet slide only for short times. A foot that stays
    low and moves for longer than any swing is dragged.

    ``speeds``: (W, N), horizontal speeds relative to the size of the skeleton. ``low``: (W, N),
    Windows in which feet touch the ground. ``shortest``: number of windows that sliding lasts at
    least. ``longest``: number of windows that a swing lasts at most.
    """
    rests = low & (speeds < _SLIDES)
    drifts = low & (speeds < _DRIFTS)
    stands = np.zeros_like(low)
    for foot in range(low.shape[1]):
        for first, last in runs_of(drifts[:, foot]):
            stands[first:last, foot] = rests[first:last, foot].any()
    moves = low & (speeds > _SLIDES) & (speeds < _SWINGS)
    result = moves & (stands | (stands.sum(axis=1) == 0)[:, None])
    for foot in range(low.shape[1]):
        for first, last in runs_of(moves[:, foot]):
            result[first:last, foot] |= last - first > longest
    for foot in range(low.shape[1]):
        for first, last in runs_of(result[:, foot]):
            result[first:last, foot] &= last - first >= shortest
    return result


def _path(along: Floats, slides: Bools, width: int) -> float:
    """Return the distance that a foot slides in all windows, in steps of one window.

    Single frames are noisy: their steps would add up to a longer distance.
    """
    edges = np.diff(slides.astype(np.int8), prepend=0, append=0)
    total = 0.0
    for first, last in zip(np.flatnonzero(edges > 0), np.flatnonzero(edges < 0), strict=True):
        end = last - 1 + width  # the last frame of the run's last window
        knots = np.append(np.arange(first, end, width), end)
        total += float(np.linalg.norm(np.diff(along[knots], axis=0), axis=1).sum())
    return total


def _held(stands: Bools, width: int) -> Bools:
    """Return the frames around which a foot is in contact for a window plus a frame at each end."""
    sums = np.concatenate([np.zeros((1, stands.shape[1]), int), np.cumsum(stands, axis=0)])
    count = len(stands) - width
    first = np.maximum(np.arange(count) - 1, 0)
    last = np.minimum(np.arange(count) + width + 2, len(stands))
    whole = sums[last] - sums[first] == (last - first)[:, None]
    result: Bools = np.asarray(whole, dtype=np.bool_)
    return result
