"""Feet of bodies: whether they slide while they stand, or sink into the ground."""

from __future__ import annotations

import numpy as np

from viewer.errors import counted
from viewer.lint._finding import Finding, Subject
from viewer.lint._ground import Ground, ground_of
from viewer.lint._soles import extent
from viewer.lint._tracks import Track, track_of
from viewer.phrases import listed
from viewer.rig.arrays import Bools, Floats
from viewer.rig.figure import Figure
from viewer.rig.skeleton import joint_labels

__all__ = ["check"]

# Below the ground, in heights of the figure at rest: 17 mm for a person, 51 mm below a guess.
_SINKS, _SINKS_OF_GUESS = 0.01, 0.03
_FACTOR = 3.0  # so much deeper even a single frame counts
# Lengths in sizes of the skeleton at rest, about 1.9 m for a person with arms spread.
_TOUCHES = 0.02  # above the ground
_SLIDES = 0.15  # a second
_SWINGS = 1.0  # a second: faster is a foot that swings close above the ground
_FAR = 0.03  # in all, while one foot stands
_WINDOW = 0.1  # seconds over which a foot's speed is taken: single frames are noisy


def check(subject: Subject) -> list[Finding]:
    """Look at the feet of a body in motion: of a skeleton that has two ankles by name."""
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
        # Where the figure stands at rest, or else on the axes' origin.
        axis, placement = 2 if figure.up == "z" else 1, subject.actor.placement
        likely = (float(placement[up, axis] * sole + placement[up, 3]), 0.0)
        found = ground_of(heights.min(axis=1), track.present, step, track.scale * height, likely)
        if found.height is None:
            return [_unsure(subject, found, step)]
        ground, sinks = found.height, _SINKS_OF_GUESS if found.is_guess else _SINKS
    labels = [joint_labels(figure.skeleton)[joint] for joint in feet]
    return [
        *_sunk(subject, track, feet, labels, heights - ground, sinks * height),
        *_slipped(subject, track, feet, labels, heights - ground, up),
    ]


def _moving(subject: Subject, figure: Figure) -> Track | None:
    clip = subject.actor.clip
    if clip is None or clip.end <= clip.start or len(subject.spoiled.get("joints", ())):
        return None
    track = track_of(subject)
    return track if track is not None and track.size > 0.0 and len(track.times) > 2 else None


def _unsure(subject: Subject, found: Ground, step: float) -> Finding:
    """Say that nobody knows where the ground is, so that feet were not checked."""
    if found.levels:
        shown = listed([f"{level:.4g} for {count * step:.2g} s" for level, count in found.levels])
        why = f"feet rest at {counted(len(found.levels), 'height')}, {shown}"
    else:
        why = "feet rest at no height for long"
    text = f"{why}: it is not clear where the ground is, and they were not checked"
    return subject.found("C013.plain", message=text, part="clip")


def _sunk(
    subject: Subject,
    track: Track,
    feet: list[int],
    labels: list[str],
    heights: Floats,
    limit: float,
) -> list[Finding]:
    """Report feet that are deeper than a limit, a length of the figure's."""
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
            "C008.plain",
            message=f"{counted(len(each), 'frame', of=track.n_frames)}: {labels[worst]} is "
            f"{subject.length(deepest[frames[0]] / track.scale)} below the ground in frame "
            f"{track.numbers[frames[0]]}",
            part="clip",
            joints=[feet[worst]],
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
    """Report a foot that moves along the ground while it stays on it."""
    stands = (np.abs(heights) < _TOUCHES * track.size) & track.present[:, None]
    step = float(track.times[1] - track.times[0])
    width = max(1, round(_WINDOW / step))
    if len(track.times) <= width + 2:
        return []
    flat = [axis for axis in range(3) if axis != up]
    along = track.positions[:, feet][..., flat]
    moved = np.linalg.norm(along[width:] - along[:-width], axis=2)
    speeds = moved / (width * step)
    slides = (speeds > _SLIDES * track.size) & (speeds < _SWINGS * track.size)
    slides &= _held(stands, width)
    paths = np.array([_path(along[:, foot], slides[:, foot], width) for foot in range(len(feet))])
    if not (paths > _FAR * track.size).any():
        return []
    worst = int(paths.argmax())
    frames = np.flatnonzero(slides.any(axis=1)) + width
    fastest = int(np.where(slides[:, worst], speeds[:, worst], 0.0).argmax())
    each = track.of_each(np.concatenate([[fastest + width], frames]))
    return [
        subject.found(
            "C007.plain",
            message=f"{counted(len(each), 'frame', of=track.n_frames)}: {labels[worst]} slides by "
            f"{subject.length(paths[worst] / track.scale)} in all, at most "
            f"{subject.speed(speeds[fastest, worst] / track.scale)} to frame "
            f"{track.numbers[fastest + width]}",
            part="clip",
            joints=[feet[worst]],
            frames=track.numbers[each],
            times=track.times[each],
            at=("frames", fastest + width),
        )
    ]


def _path(along: Floats, slides: Bools, width: int) -> float:
    """Return how far a foot gets in all windows in which it slides, in steps of a window.

    Single frames are noisy: their steps would add up to more.
    """
    edges = np.diff(slides.astype(np.int8), prepend=0, append=0)
    total = 0.0
    for first, last in zip(np.flatnonzero(edges > 0), np.flatnonzero(edges < 0), strict=True):
        end = last - 1 + width  # the frame that ends the run's last window
        knots = np.append(np.arange(first, end, width), end)
        total += float(np.linalg.norm(np.diff(along[knots], axis=0), axis=1).sum())
    return total


def _held(stands: Bools, width: int) -> Bools:
    """Return where a foot stands in all frames of a window and in one more at each end."""
    sums = np.concatenate([np.zeros((1, stands.shape[1]), int), np.cumsum(stands, axis=0)])
    count = len(stands) - width
    first = np.maximum(np.arange(count) - 1, 0)
    last = np.minimum(np.arange(count) + width + 2, len(stands))
    whole = sums[last] - sums[first] == (last - first)[:, None]
    result: Bools = np.asarray(whole, dtype=np.bool_)
    return result
