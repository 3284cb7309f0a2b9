"""Captured keypoints: how sure the capture was of them, gaps, and points that jump."""

from __future__ import annotations

import numpy as np

from viewer.lint._finding import Finding, Subject, listed
from viewer.lint.clips import missing_frames
from viewer.rig.points import PointClip

__all__ = ["check"]

_SHARE = 0.05  # of all that was seen: fewer points of low confidence are usual
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
        text = f"{len(never)} of {len(names)} keypoints are never seen: {shown}"
        findings.append(subject.found("C012", text, part="clip", joints=never))
    low = seen & (confidence < subject.options.confidence)
    if low.sum() > _SHARE * seen.sum():
        shares = low.sum(axis=0)
        points = np.flatnonzero(shares)
        points = points[np.argsort(-shares[points], kind="stable")]
        per_frame = low.sum(axis=1)
        frames = np.flatnonzero(per_frame)
        frames = frames[np.argsort(-per_frame[frames], kind="stable")]
        findings.append(
            subject.found(
                "C011",
                f"{100.0 * low.sum() / seen.sum():.0f} % of what is seen has a confidence below "
                f"{subject.options.confidence:g}, most often {names[points[0]]}, in "
                f"{shares[points[0]]} of {len(numbers)} frames",
                part="clip",
                joints=points,
                frames=numbers[frames] + clip.timing.first_frame,
                times=_times(subject, clip, numbers[frames]),
            )
        )
    return findings


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
            "C003",
            f"{len(wrong)} of {clip.timing.n_frames} frames: {names[point]} moves at "
            f"{fastest[wrong[0]]:.3g} units a second (limit {limit:.3g}) to frame "
            f"{frames[0] + clip.timing.first_frame}",
            part="clip",
            joints=[point],
            frames=frames + clip.timing.first_frame,
            times=_times(subject, clip, frames),
        )
    ]


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
