"""Check of captured motions for jitter: noise from frame to frame."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from viewer.lint._finding import Finding
from viewer.lint._subject import Subject, track_of
from viewer.phrases import counted, rounded
from viewer.rig.arrays import Bools, Floats
from viewer.rig.captures.points import PointClip, visible_size
from viewer.rig.cleanup.frames import runs_of
from viewer.rig.skeleton import joint_labels

_LIMIT = 0.005  # noise relative to the size at rest: 10 mm for a person with spread arms
_POINT_LIMIT = 0.02  # noise relative to the median size: triangulated points are noisier
_WINDOW = 0.5  # seconds over which noise is averaged: a jump is not jitter
_SLOWEST = 24.0  # minimum frame rate: with less, people move too far between frames
# A fourth difference is 0 for any cubic in time, so that a motion whose acceleration changes
# steadily over five frames leaves almost nothing, while noise, which has no memory, stays. Lower
# orders would still contain the acceleration of quick limbs, higher ones need longer runs.
_STENCIL = np.array([1.0, -4.0, 6.0, -4.0, 1.0])
_FRACTION = 0.3  # quantile in a window, low enough to ignore steps and other events
# From a quantile of fourth differences to the quadratic mean of the noise. Independent errors of
# deviation s add up in squares, so the fourth difference has the variance
# (1 + 16 + 36 + 16 + 1) s^2 = 70 s^2 per coordinate. Its length divided by sqrt(70) s has the chi
# distribution of three coordinates: 30 % are below 1.1932, and the quadratic mean is sqrt(3).
_RMS = np.sqrt(3.0) / (np.sqrt(70.0) * 1.1932)
_TOGETHER = 2000  # frames per batch


def check(subject: Subject) -> Iterator[Finding]:
    """Check the joints or points of a captured motion."""
    clip = subject.actor.captured
    if clip is not None and clip.points is not None:
        yield from _points(subject, clip)
        return
    if clip is None or clip.frame_rate < _SLOWEST:
        return
    track = track_of(subject)
    skeleton = subject.actor.figure.skeleton
    if track is None or skeleton is None or not track.size > 0.0:
        return
    noise = noise_of(track.positions, track.present, _width(clip.timing.frame_rate))
    limit = _LIMIT * track.size
    labels, scale = [*joint_labels(skeleton)], track.scale

    def shown(length: float) -> str:
        return subject.length(length / scale)

    yield from _found(subject, noise, limit, labels, shown, track.numbers, track.times)


def _points(subject: Subject, clip: PointClip) -> Iterator[Finding]:
    timing, layout = clip.timing, subject.actor.figure.points
    if timing.frame_rate < _SLOWEST or layout is None or not timing.present.any():
        return
    rows = clip.points[np.maximum(timing.rows, 0)]
    seen = (rows[..., 3] > 0.0) & timing.present[:, None]
    limit = _POINT_LIMIT * visible_size(rows[timing.present])
    width = _width(timing.frame_rate)
    noise = np.zeros(seen.shape)
    for point in range(seen.shape[1]):
        noise[:, point] = noise_of(rows[:, point, None, :3], seen[:, point], width)[:, 0]
    names = [*layout.names, *(f"point {k}" for k in range(len(layout.names), seen.shape[1]))]
    frames = np.arange(timing.n_frames)
    numbers = frames + timing.first_frame

    def shown(length: float) -> str:
        return f"{rounded(length)} units"

    yield from _found(subject, noise, limit, names, shown, numbers, subject.times(timing, frames))


def _found(
    subject: Subject,
    noise: Floats,
    limit: float,
    labels: list[str],
    shown: Callable[[float], str],
    numbers: np.ndarray,
    times: Floats,
) -> Iterator[Finding]:
    """Report the joints whose noise (F, J) exceeds a limit."""
    highest = noise.max(axis=1, initial=0.0)
    frames = np.flatnonzero(highest > limit)
    if limit <= 0.0 or len(frames) == 0:
        return
    frames = frames[np.argsort(-highest[frames], kind="stable")]
    order = np.argsort(-noise.max(axis=0), kind="stable")
    joints = order[noise[:, order].max(axis=0) > limit]
    yield subject.found(
        "C014.jitter: {n}: {joint} jitters by {noise} from frame to frame, most around "
        "frame {frame} (limit {limit})",
        n=counted(len(frames), "frame", of=int((~np.isnan(highest)).sum())),
        all=int((~np.isnan(highest)).sum()),
        joint=labels[joints[0]],
        noise=shown(float(noise.max())),
        limit=shown(limit),
        frame=int(numbers[frames[0]]),
        part="clip",
        joints=joints,
        frames=numbers[frames],
        times=times[frames],
        at=("frames", int(frames[0])),
    )


def noise_of(positions: Floats, present: Bools, width: int) -> Floats:
    """Return the quadratic mean of the noise (F, J); 0 in runs shorter than ``width``."""
    noise = np.zeros(positions.shape[:2])
    for first, stop in runs_of(present):
        for start in range(first, stop, _TOGETHER):
            end = min(start + _TOGETHER + width + 4, stop)
            if end - start < width + 4:
                continue
            part = positions[start:end]
            count = end - start - 4
            fourth = sum(c * part[k : k + count] for k, c in enumerate(_STENCIL.tolist()))
            lengths = np.linalg.norm(np.asarray(fourth), axis=-1)
            # A step or a jump makes up to five large differences per window. A low quantile of the
            # window does not see them; the mean would.
            windows = np.lib.stride_tricks.sliding_window_view(lengths, width, axis=0)
            middle = start + 2 + width // 2
            place = round(_FRACTION * (width - 1))
            smaller = np.partition(windows, place, axis=-1)[..., place]
            noise[middle : middle + len(windows)] = _RMS * smaller
    return noise


def _width(rate: float) -> int:
    return 2 * round(0.5 * _WINDOW * rate) + 1
