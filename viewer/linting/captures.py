"""Checks of captured keypoints: low confidence, gaps, and jumping points."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from viewer.diagnostics import Phrase
from viewer.linting._finding import Finding
from viewer.linting._subject import Subject
from viewer.linting.clips import missing_frames
from viewer.phrases import all_of, counted, listed, rounded
from viewer.rigs.arrays import Ints, largest_first
from viewer.rigs.captures.points import PointClip, visible_size

LOW_FRACTION = 0.05
"""Fraction of a keypoint's visible frames: this much low confidence is normal."""
LOW_FRAMES = 2
"""Minimum number of frames with low confidence."""
_SINGLE = 6  # maximum number of low-confidence keypoints listed individually
_SIZES = 15.0  # maximum speed of a point, in bounding box diagonals of the points per second


def check(subject: Subject) -> Iterator[Finding]:
    """Check the clip of a figure that consists of captured points."""
    clip, layout = subject.actor.captured, subject.actor.figure.points
    if clip is None or clip.points is None or layout is None:
        return
    count = clip.points.shape[1]
    names = [*layout.names, *(f"point {k}" for k in range(len(layout.names), count))]
    yield from missing_frames(subject, clip.timing)
    yield from _confidence(subject, clip, names)
    yield from _jumps(subject, clip, names)


def _confidence(subject: Subject, clip: PointClip, names: list[str]) -> Iterator[Finding]:
    """Report keypoints that are never visible, and those whose confidence is often low."""
    rows, first_frame = clip.timing.rows, clip.timing.first_frame
    numbers = np.flatnonzero(rows >= 0)
    if len(numbers) == 0:
        return
    confidence = clip.points[rows[numbers], :, 3]
    seen = confidence > 0.0
    never = np.flatnonzero(~seen.any(axis=0))
    if len(never):
        yield subject.found(
            "C012.points: {n} never visible: {names}",
            n=counted(len(never), "keypoint", "is", "are", of=len(names)),
            all=len(names),
            names=listed([names[point] for point in never]),
            part="clip",
            joints=never,
        )
    limit = subject.options.confidence
    is_low = seen & (confidence < limit)
    counts = is_low.sum(axis=0)
    fractions = counts / np.maximum(seen.sum(axis=0), 1)
    points = np.flatnonzero((fractions > LOW_FRACTION) & (counts >= LOW_FRAMES))
    points = largest_first(points, fractions)
    for point in points[:_SINGLE].tolist():
        frames = numbers[is_low[:, point]]
        yield subject.found(
            "C011.point: {name} has a confidence below {limit:g} in {percent:.0f} % of the {n} "
            "frames in which it is visible (first: frame {frame})",
            name=names[point],
            limit=limit,
            percent=100.0 * float(fractions[point]),
            n=int(seen[:, point].sum()),
            frame=int(frames[0]) + first_frame,
            part="clip",
            joints=[point],
            frames=frames + first_frame,
            times=subject.times(clip.timing, frames),
        )
    others = points[_SINGLE:]
    if len(others):
        frames = numbers[is_low[:, others].any(axis=1)]
        shown = [
            Phrase(
                "{name} in {percent:.0f} %",
                name=names[point],
                percent=100.0 * float(fractions[point]),
            )
            for point in others.tolist()
        ]
        yield subject.found(
            "C011.more-points: {n} a confidence below {limit:g} in some of the frames in which "
            "they are visible: {points}",
            n=counted(len(others), "more keypoint", "has", "have"),
            limit=limit,
            points=all_of(shown),
            part="clip",
            joints=others,
            frames=frames + first_frame,
            times=subject.times(clip.timing, frames),
        )


def _jumps(subject: Subject, clip: PointClip, names: list[str]) -> Iterator[Finding]:
    rows = clip.timing.rows
    both = np.flatnonzero((rows[1:] >= 0) & (rows[:-1] >= 0)) + 1
    if len(both) == 0:
        return
    after, before = clip.points[rows[both]], clip.points[rows[both - 1]]
    steps = np.linalg.norm(after[..., :3] - before[..., :3], axis=2)
    steps[(after[..., 3] <= 0.0) | (before[..., 3] <= 0.0)] = 0.0
    speeds = steps * clip.timing.frame_rate
    limit = subject.options.max_speed
    if limit is None:
        limit = _SIZES * visible_size(clip.points)
    fastest = speeds.max(axis=1)
    wrong = np.flatnonzero(fastest > limit)
    if len(wrong) == 0:
        return
    wrong = largest_first(wrong, fastest)
    point = int(speeds[wrong[0]].argmax())
    frames = both[wrong]
    yield subject.found(
        "C003.point: {n}: {name} moves at {speed} units per second at frame {frame} (limit "
        "{limit})",
        n=counted(len(wrong), "frame", of=_n_frames(rows)),
        all=_n_frames(rows),
        name=names[point],
        speed=rounded(float(fastest[wrong[0]])),
        limit=rounded(float(limit)),
        frame=int(frames[0]) + clip.timing.first_frame,
        part="clip",
        joints=[point],
        frames=frames + clip.timing.first_frame,
        times=subject.times(clip.timing, frames),
    )


def _n_frames(rows: Ints) -> int:
    """Return the number of frames from the first to the last in which the person is present."""
    there = np.flatnonzero(rows >= 0)
    return int(there[-1] - there[0]) + 1 if len(there) else 0
