"""Check of motions for jitter: noise from frame to frame, of captures and of single joints."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from viewer.linting._finding import Finding
from viewer.linting._subject import Subject, Track, track_of
from viewer.phrases import counted, rounded
from viewer.rigs.arrays import Bools, Floats, largest_first, runs_of
from viewer.rigs.captures.points import PointClip, visible_size
from viewer.rigs.geometry.vectors import lengths_of
from viewer.rigs.skeleton import Skeleton, joint_labels

_LIMIT = 0.005  # noise relative to the size at rest: 10 mm for a person with spread arms
_POINT_LIMIT = 0.02  # noise relative to the median size: triangulated points are noisier
_WHITE = -0.6  # maximum correlation of successive fourth differences: noise has -0.8
_ANGLE = np.radians(1.25)  # noise of a joint's rotation that is seen
_ALONE = 3.0  # minimum ratio to the median of all joints: a noisy recording is noisy everywhere
_FEWEST = 20  # minimum number of frames in which the noise is known
_ON_RATE = 1e-3  # tolerance of the frame rate
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
    track, skeleton = track_of(subject), subject.actor.figure.skeleton
    if track is None or skeleton is None or track.is_blocked():
        return
    yield from _rotations(subject, track, skeleton)
    if clip is None or clip.frame_rate < _SLOWEST or not track.size > 0.0:
        return
    width, limit = _width(clip.timing.frame_rate), _LIMIT * track.size
    noise = noise_of(track.positions, track.present, width)
    for joint in np.flatnonzero((noise > limit).any(axis=0)):
        # Quick swings have fourth differences, too, but no white ones.
        runs = _windows(noise[:, joint] > limit, track.present, width)
        n_frames = sum(stop - first for first, stop in runs)
        if n_frames < _FEWEST or _correlation(track.positions[:, joint], runs) > _WHITE:
            noise[:, joint] = 0.0
    labels, scale = [*joint_labels(skeleton)], track.scale

    def shown(length: float) -> str:
        return subject.length(length / scale)

    yield from _found(subject, noise, limit, labels, shown, track.numbers, track.times)


def _rotations(subject: Subject, track: Track, skeleton: Skeleton) -> Iterator[Finding]:
    """Report joints whose rotations are much noisier than those of the others."""
    rows = track.on_frames()
    if len(rows) < 2:
        return
    rate = 1.0 / float(track.times[rows[1]] - track.times[rows[0]])
    turns = track.turns(rows)
    moves = np.flatnonzero((turns != turns[0]).any(axis=(0, 2)))
    if rate < _SLOWEST * (1.0 - _ON_RATE) or len(moves) == 0:
        return
    # Close to each other, unit quaternions are half the angle of their rotation apart.
    noise = noise_of(2.0 * turns[:, moves], track.present[rows], _width(rate))
    is_measured = noise.any(axis=1)
    if is_measured.sum() < _FEWEST:
        return
    # Hand-made legs twitch for some frames; noise stays.
    most = np.median(noise[is_measured], axis=0)
    usual = float(np.median(np.concatenate([most, np.zeros(skeleton.n_joints - len(most))])))
    limit = max(_ANGLE, _ALONE * usual)
    columns = np.flatnonzero(most > limit)
    runs = runs_of(track.present[rows])
    is_white = [_correlation(turns[:, moves[column]], runs) < _WHITE for column in columns]
    columns = columns[is_white]
    if len(columns) == 0:
        return
    columns = largest_first(columns, most)
    highest = noise[:, columns].max(axis=1)
    frames = np.flatnonzero(highest > limit)
    frames = rows[largest_first(frames, highest)]
    yield subject.found(
        "C014.rotation: {n}: {joint} jitters by {noise} from frame to frame, most around frame "
        "{frame}; the median of all joints is {usual}",
        n=counted(len(frames), "frame", of=track.n_frames),
        all=track.n_frames,
        joint=joint_labels(skeleton)[moves[columns[0]]],
        noise=f"{np.degrees(most[columns[0]]):.1f}°",
        usual=f"{np.degrees(usual):.1f}°",
        frame=int(track.numbers[frames[0]]),
        part="clip",
        joints=moves[columns],
        frames=track.numbers[frames],
        times=track.times[frames],
        at=("frames", int(frames[0])),
    )


def _correlation(values: Floats, runs: list[tuple[int, int]]) -> float:
    """Return the correlation of successive fourth differences of values (F, C) within runs."""
    # For independent errors, sum_i c_i c_i+1 / sum_i c_i^2 = -56 / 70 = -0.8; for a swing of w
    # radians per frame, cos w, which is positive unless it takes less than four frames.
    parts = [_fourth(values[first:stop]) for first, stop in runs if stop - first > 4]
    products = sum(float((part[1:] * part[:-1]).sum()) for part in parts)
    return products / max(sum(float((part * part).sum()) for part in parts), 1e-300)


def _windows(is_noisy: Bools, present: Bools, width: int) -> list[tuple[int, int]]:
    """Return the runs of frames that the windows around noisy ones are made of."""
    half = width // 2 + 2
    near = np.convolve(is_noisy, np.ones(2 * half + 1), mode="same") > 0.5
    return runs_of(near & present)


def _fourth(values: Floats) -> Floats:
    """Return the fourth differences of values (F, ...): (F - 4, ...)."""
    count = len(values) - 4
    return np.asarray(sum(c * values[k : k + count] for k, c in enumerate(_STENCIL.tolist())))


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
    frames = largest_first(frames, highest)
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
            lengths = lengths_of(_fourth(positions[start:end]))
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
