"""Captured keypoints: how sure the capture was of them, gaps, and points that jump."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from viewer.errors import counted
from viewer.lint._finding import Finding, Subject
from viewer.lint.clips import missing_frames
from viewer.phrases import listed
from viewer.rig.arrays import Floats, Ints
from viewer.rig.captures.points import PointClip

__all__ = ["LOW_FRAMES", "LOW_SHARE", "check"]

Indices = NDArray[np.int64]

LOW_SHARE = 0.05
"""Of the frames that see a keypoint: so many of low confidence are usual."""

LOW_FRAMES = 2
"""So many of them there must be at least."""

_SINGLE = 6  # keypoints of low confidence that are told one by one
_SIZES = 15.0  # of the points that one may move in a second


def check(subject: Subject) -> list[Finding]:
    """Look at the clip of a figure that is captured points."""
    clip, layout = subject.actor.clip, subject.actor.figure.points
    if not isinstance(clip, PointClip) or layout is None:
        return []
    count = clip.points.shape[1]
    names = [*layout.names, *(f"point {k}" for k in range(len(layout.names), count))]
    return [
        *missing_frames(subject, clip.timing),
        *_confidence(subject, clip, names),
        *_jumps(subject, clip, names),
    ]


def _confidence(subject: Subject, clip: PointClip, names: list[str]) -> list[Finding]:
    rows = clip.timing.rows
    numbers = np.flatnonzero(rows >= 0)
    if len(numbers) == 0:
        return []
    confidence = clip.points[rows[numbers], :, 3]
    findings = []
    seen = confidence > 0.0
    never = np.flatnonzero(~seen.any(axis=0))
    if len(never):
        shown = listed([names[point] for point in never])
        text = f"{counted(len(never), 'keypoint', 'is', 'are', of=len(names))} never seen: {shown}"
        findings.append(subject.found("C012.plain", message=text, part="clip", joints=never))
    return findings + _low(subject, clip, names, numbers, confidence)


def _low(
    subject: Subject, clip: PointClip, names: list[str], numbers: Indices, confidence: Floats
) -> list[Finding]:
    """Report keypoints of low confidence one by one, the worst first; the others together.

    Parameters
    ----------
    subject, clip, names
        Whose, the motion, and what the K keypoints are called.
    numbers : (F,)
        Frames in which somebody is there, from 0.
    confidence : (F, K)
        In these frames.
    """
    seen = confidence > 0.0
    is_low = seen & (confidence < subject.options.confidence)
    counts = is_low.sum(axis=0)
    shares = counts / np.maximum(seen.sum(axis=0), 1)
    points = np.flatnonzero((shares > LOW_SHARE) & (counts >= LOW_FRAMES))
    points = points[np.argsort(-shares[points], kind="stable")]
    limit = f"a confidence below {subject.options.confidence:g}"
    findings = []
    for point in points[:_SINGLE].tolist():
        rows = np.flatnonzero(is_low[:, point])
        first = numbers[rows[0]] + clip.timing.first_frame
        words = (
            f"{names[point]} has {limit} in {100.0 * shares[point]:.0f} % of the "
            f"{int(seen[:, point].sum())} frames that see it, first in frame {first}"
        )
        findings.append(_low_finding(subject, clip, words, [point], numbers[rows]))
    rest = points[_SINGLE:]
    if len(rest):
        frames = np.flatnonzero(is_low[:, rest].any(axis=1))
        which = counted(len(rest), "more keypoint", "has", "have")
        shown = ", ".join(f"{names[k]} in {100.0 * shares[k]:.0f} %" for k in rest.tolist())
        words = f"{which} {limit}: {shown} of the frames that see them"
        findings.append(_low_finding(subject, clip, words, rest, numbers[frames]))
    return findings


def _low_finding(
    subject: Subject, clip: PointClip, text: str, points: Indices | list[int], frames: Indices
) -> Finding:
    return subject.found(
        "C011.plain",
        message=text,
        part="clip",
        joints=points,
        frames=frames + clip.timing.first_frame,
        times=_times(subject, clip, frames),
    )


def _jumps(subject: Subject, clip: PointClip, names: list[str]) -> list[Finding]:
    rows = clip.timing.rows
    both = np.flatnonzero((rows[1:] >= 0) & (rows[:-1] >= 0)) + 1
    if len(both) == 0:
        return []
    after, before = clip.points[rows[both]], clip.points[rows[both - 1]]
    steps = np.linalg.norm(after[..., :3] - before[..., :3], axis=2)
    steps[(after[..., 3] <= 0.0) | (before[..., 3] <= 0.0)] = 0.0
    speeds = steps * clip.timing.frame_rate
    limit = subject.options.max_speed
    if limit is None:
        limit = _SIZES * _size(clip)
    fastest = speeds.max(axis=1)
    wrong = np.flatnonzero(fastest > limit)
    if len(wrong) == 0:
        return []
    wrong = wrong[np.argsort(-fastest[wrong], kind="stable")]
    point = int(speeds[wrong[0]].argmax())
    frames = both[wrong]
    return [
        subject.found(
            "C003.plain",
            message=f"{counted(len(wrong), 'frame', of=_n_frames(rows))}: {names[point]} moves at "
            f"{fastest[wrong[0]]:.3g} units a second (limit {limit:.3g}) to frame "
            f"{frames[0] + clip.timing.first_frame}",
            part="clip",
            joints=[point],
            frames=frames + clip.timing.first_frame,
            times=_times(subject, clip, frames),
        )
    ]


def _n_frames(rows: Ints) -> int:
    """Return how many frames there are from the first in which somebody is there to the last."""
    there = np.flatnonzero(rows >= 0)
    return int(there[-1] - there[0]) + 1 if len(there) else 0


def _size(clip: PointClip) -> float:
    """Return the median size of the box around what is seen in a frame."""
    seen = clip.points[..., 3:] > 0.0
    low = np.where(seen, clip.points[..., :3], np.inf).min(axis=1)
    high = np.where(seen, clip.points[..., :3], -np.inf).max(axis=1)
    known = seen.any(axis=(1, 2))
    if not known.any():
        return 1.0
    return float(np.median(np.linalg.norm(high[known] - low[known], axis=1)))


def _times(subject: Subject, clip: PointClip, frames: np.ndarray) -> np.ndarray:
    return clip.timing.start + frames / clip.timing.frame_rate + subject.actor.offset
