"""Checks of captured people: swapped IDs, and tracks that break off."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from viewer.data_classes import dataclass
from viewer.linting._finding import Finding
from viewer.linting._subject import Subject
from viewer.phrases import Remedy, counted, listed
from viewer.rigs.arrays import Bools, Floats
from viewer.rigs.captures.person import is_tracked, person_label
from viewer.rigs.captures.points import visible_size
from viewer.rigs.geometry.transform import mean_scale
from viewer.rigs.mesh import bounding_box, box_size
from viewer.rigs.motion.evaluation import frames_of, rest_translations_of
from viewer.rigs.motion.timing import Timing
from viewer.rigs.scene import Actor
from viewer.rigs.shape import rest_joints

# Lengths are relative to the size of the body.
_JUMPS = 0.15  # minimum jump of both people between two frames: 0.3 m for an adult
_BETTER = 0.5  # maximum ratio of the steps after swapping the IDs to the steps before
_NEAR = 0.25  # maximum distance between the end of one track and the start of another
_LATER = 1.0  # maximum time between them, seconds


@dataclass(frozen=True, slots=True, eq=False)
class _Path:
    """Path of one person through the scene."""

    timing: Timing
    """Frames."""
    present: Bools
    """(F,): frames with a position."""
    places: Floats
    """(F, 3): positions of the root, or the mean of the visible points, scene space."""
    size: float
    """Size of the body, scene units."""


def check(subject: Subject) -> Iterator[Finding]:
    """Compare a captured person with the others in the recording."""
    actor = subject.actor
    if actor.person is None or not is_tracked(actor.person) or len(subject.people) < 2:
        return
    own = _path(actor)
    if own is None or not own.present.any():
        return
    is_later = False
    for other in subject.people:
        if other is actor:
            is_later = True
            continue
        path = _path(other) if _are_alike(actor, other) else None
        if path is None or not path.present.any():
            continue
        if is_later:
            yield from _exchanged(subject, other, own, path)
        yield from _continued(subject, other, own, path)


def _are_alike(one: Actor, other: Actor) -> bool:
    """Return whether two people are on one timeline, both as bodies or both as points."""
    a, b = one.captured, other.captured
    if a is None or b is None or a.kind != b.kind:
        return False
    if one.offset != other.offset or one.title != other.title:
        return False
    first, second = a.timing, b.timing
    return (first.frame_rate, first.first_frame, first.n_frames) == (
        second.frame_rate,
        second.first_frame,
        second.n_frames,
    )


def _exchanged(subject: Subject, other: Actor, one: _Path, two: _Path) -> Iterator[Finding]:
    """Report frames in which two people swap positions."""
    both = np.flatnonzero(one.present & two.present)
    if len(both) < 2:
        return
    before, after = both[:-1], both[1:]
    kept = np.maximum(
        _distance(one.places[after], one.places[before]),
        _distance(two.places[after], two.places[before]),
    )
    least = np.minimum(
        _distance(one.places[after], one.places[before]),
        _distance(two.places[after], two.places[before]),
    )
    swapped = np.maximum(
        _distance(one.places[after], two.places[before]),
        _distance(two.places[after], one.places[before]),
    )
    near = after - before <= max(1.0, _LATER * one.timing.frame_rate)
    frames = after[near & (least > _JUMPS * one.size) & (swapped < _BETTER * kept)]
    if len(frames) == 0:
        return
    number = int(frames[0]) + one.timing.first_frame
    yield subject.found(
        "C015.exchanged: swaps positions with {other}, {distance} away, in {n}: {frames_text}",
        other=person_label(other.person or 0),
        n=counted(len(frames), "frame"),
        frames_text=listed([str(frame + one.timing.first_frame) for frame in frames.tolist()]),
        distance=_length(subject, float(kept[np.searchsorted(after, frames[0])])),
        frame=number,
        part="clip",
        frames=frames + one.timing.first_frame,
        times=subject.times(one.timing, frames),
    )


def _continued(subject: Subject, other: Actor, own: _Path, path: _Path) -> Iterator[Finding]:
    """Report a person who appears where another one has just disappeared permanently."""
    first, last = int(np.flatnonzero(own.present)[0]), int(np.flatnonzero(path.present)[-1])
    pause = first - last
    if not 0 < pause <= _LATER * own.timing.frame_rate:
        return
    apart = float(_distance(own.places[first], path.places[last]))
    if apart > _NEAR * own.size:
        return
    numbers = own.timing.first_frame + np.array([first])
    ids = f"{other.person},{subject.actor.person}"
    yield subject.found(
        "C015.continued: appears in frame {first}, {distance} from where {other} disappears in "
        "frame {last}: may be one person{remedy}",
        other=person_label(other.person or 0),
        first=first + own.timing.first_frame,
        last=last + own.timing.first_frame,
        distance=_length(subject, apart),
        ids=ids,
        part="clip",
        severity="note",
        frames=numbers,
        times=subject.times(own.timing, np.array([first])),
        remedy=Remedy("", f" (--merge-ids {ids} of viewer convert)"),
    )


def _path(actor: Actor) -> _Path | None:
    """Return the path of a captured person; None without a captured motion."""
    clip, figure = actor.captured, actor.figure
    turn, place = actor.placement[:3, :3], actor.placement[:3, 3]
    scale = mean_scale(turn)
    if clip is not None and clip.points is not None:
        points = clip.points[np.maximum(clip.timing.rows, 0)]
        seen = points[..., 3:] > 0.0
        present = clip.timing.present & seen.any(axis=(1, 2))
        count = np.maximum(seen.sum(axis=1), 1)
        means = np.where(seen, points[..., :3], 0.0).sum(axis=1) / count
        size = visible_size(points[present])
        return _Path(clip.timing, present, means @ turn.T + place, scale * size)
    if clip is None or figure.skeleton is None:
        return None
    times = clip.timing.times
    frames = frames_of(figure, clip, times, actor.own_pose)
    rest = rest_translations_of(figure, frames.shape_weights)[:, 0]
    roots = frames.figure_scales[:, None] * (rest + frames.translations[:, 0])
    roots = roots + frames.figure_translations
    size = box_size(bounding_box(rest_joints(figure)))
    return _Path(clip.timing, frames.present, roots @ turn.T + place, scale * size)


def _distance(one: Floats, other: Floats) -> Floats:
    return np.linalg.norm(one - other, axis=-1)


def _length(subject: Subject, length: float) -> str:
    return subject.length(length / (mean_scale(subject.actor.placement) or 1.0))
