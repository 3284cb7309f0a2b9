"""Feet of bodies: whether they slide while they stand, or sink into the ground."""

from __future__ import annotations

import numpy as np

from viewer.lint._finding import Finding, Subject
from viewer.lint._tracks import Track, track_of
from viewer.rig.arrays import Bools, Floats
from viewer.rig.figure import Figure
from viewer.rig.joint_names import canonical_names
from viewer.rig.shape import rest_joints
from viewer.rig.skeleton import joint_labels

__all__ = ["check"]

# Lengths in sizes of the skeleton at rest, about 1.9 m for a person with arms spread.
_TOUCHES = 0.02  # above the ground
_SINKS = 0.03  # below the ground
_SLIDES = 0.15  # a second
_SWINGS = 1.0  # a second: faster is a foot that swings close above the ground
_FAR = 0.03  # in all, while one foot stands
_WINDOW = 0.1  # seconds over which a foot's speed is taken: single frames are noisy
_STANDS = 0.3  # share of the frames in which a foot is on the ground, or there is none


def check(subject: Subject) -> list[Finding]:
    """Look at the feet of a body in motion: of a skeleton that has two ankles by name."""
    figure = subject.actor.figure
    track = None if figure.skeleton is None else _moving(subject, figure)
    if track is None or figure.skeleton is None:
        return []
    feet = _feet(figure)
    if len(feet) < 2:
        return []
    up = 2 if subject.up == "z" else 1
    heights = track.positions[:, feet, up] - track.scale * _rest_heights(figure)[feet]
    lowest = np.where(track.present, heights.min(axis=1), np.inf)
    ground = _ground(lowest[track.present], track.size)
    if ground is None:
        return []
    labels = [joint_labels(figure.skeleton)[joint] for joint in feet]
    return [
        *_sunk(subject, track, feet, labels, heights - ground),
        *_slipped(subject, track, feet, labels, heights - ground, up),
    ]


def _moving(subject: Subject, figure: Figure) -> Track | None:
    clip = subject.actor.clip
    if clip is None or clip.end <= clip.start or len(subject.spoiled.get("joints", ())):
        return None
    track = track_of(subject)
    return track if track is not None and track.size > 0.0 and len(track.times) > 2 else None


def _feet(figure: Figure) -> list[int]:
    """Return the joint nearest to the ground of each leg: the ball of the foot, or the ankle."""
    assert figure.skeleton is not None  # the caller looked
    names = canonical_names(figure.skeleton.names, figure.skeleton.parents)
    feet = []
    for side in ("left", "right"):
        found = [names.index(name) for name in (f"{side}_foot", f"{side}_ankle") if name in names]
        feet += found[:1]
    return feet


def _rest_heights(figure: Figure) -> Floats:
    """Return how high each joint is above the sole while the figure stands at rest: (J,)."""
    axis = 2 if figure.up == "z" else 1
    joints = rest_joints(figure)[:, axis]
    lowest = joints.min() if figure.mesh is None else figure.mesh.positions[:, axis].min()
    return joints - lowest


def _ground(lowest: Floats, size: float) -> float | None:
    """Return the height on which the lower foot mostly is; 0 if that is near; None if on none."""
    if len(lowest) == 0:
        return None
    middle = float(np.median(lowest))
    ground = 0.0 if abs(middle) < _SINKS * size else middle
    share = float((np.abs(lowest - ground) < _SINKS * size).mean())
    return ground if share >= _STANDS else None


def _sunk(
    subject: Subject, track: Track, feet: list[int], labels: list[str], heights: Floats
) -> list[Finding]:
    depths = np.where(track.present[:, None], -heights, 0.0)
    deepest = depths.max(axis=1)
    frames = np.flatnonzero(deepest > _SINKS * track.size)
    if len(frames) == 0:
        return []
    frames = frames[np.argsort(-deepest[frames], kind="stable")]
    worst = int(depths[frames[0]].argmax())
    return [
        subject.found(
            "C008",
            f"{len(frames)} of {len(track.times)} frames: {labels[worst]} is "
            f"{subject.length(deepest[frames[0]] / track.scale)} below the ground in frame "
            f"{track.numbers[frames[0]]}",
            part="clip",
            joints=[feet[worst]],
            frames=track.numbers[frames],
            times=track.times[frames],
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
    return [
        subject.found(
            "C007",
            f"{len(frames)} of {len(track.times)} frames: {labels[worst]} slides by "
            f"{subject.length(paths[worst] / track.scale)} in all, at most "
            f"{subject.speed(speeds[fastest, worst] / track.scale)} to frame "
            f"{track.numbers[fastest + width]}",
            part="clip",
            joints=[feet[worst]],
            frames=np.concatenate([[track.numbers[fastest + width]], track.numbers[frames]]),
            times=np.concatenate([[track.times[fastest + width]], track.times[frames]]),
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
