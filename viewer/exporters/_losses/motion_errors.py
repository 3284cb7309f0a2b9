"""Notes about a motion that was read back: largest errors of joints and vertices.

Errors are found at the frames of the file, and at times between them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, Phrase
from viewer.exporters._losses.largest_distances import (
    REGULAR,
    Apart,
    Farthest,
    apart,
    apart_notes,
    evenly,
    followed_vertices,
    heights,
    negligible,
    reach_of,
    sampling,
    tolerance,
    with_values,
)
from viewer.exporters._losses.posed_bodies import (
    Rows,
    Side,
    changing,
    figure_side,
    linear_as_opened,
)
from viewer.phrases import Shown, counted, optional
from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure
from viewer.rigs.motion.clip import SHORTEST, Channel, Clip
from viewer.rigs.motion.evaluation import Frames, frames_between, frames_of
from viewer.rigs.motion.sampled_animation import SampledAnimation, clip_of, frames_at
from viewer.rigs.motion.transform_clip import TransformClip
from viewer.rigs.skinning import Skinning


def shape_changes(frames: Frames) -> bool:
    """Return whether the shape of a figure changes over its present frames."""
    weights = frames.shape_weights
    weights = weights if len(weights) == 1 else weights[frames.present]
    return bool(np.ptp(weights, axis=0).any())


class PartLosses:
    """Largest errors of a file without a mesh, found part by part; ``n_frames`` are compared."""

    def __init__(self, how: Skinning, n_frames: int) -> None:
        self._how, self._n_frames = linear_as_opened(how), n_frames
        self._n_seen, self._n_compared, self._reach = 0, 0, 0.0
        self._joints: Farthest | None = None
        self._vertices: Farthest | None = None

    def look(self, part: SampledAnimation, written: Side, shape: Floats) -> None:
        """Compare the next part with the file's poses of its frames, for shape weights (S,)."""
        figure, frames = part.figure, part.frames
        rows = np.flatnonzero(frames.present)
        found = apart(figure_side(figure, frames, self._how, shape), written, rows, 0.0)
        self._joints = self._farther(self._joints, found.joints)
        self._vertices = self._farther(self._vertices, found.vertices)
        # Every k-th of all compared frames, as ``negligible`` would choose if all parts were one.
        places = np.arange(len(rows)) + self._n_compared
        sized = rows[places % sampling(self._n_frames) == 0]
        if len(sized):
            self._reach = max(self._reach, reach_of(figure, frames_between(frames, sized)))
        self._n_seen += frames.n_frames
        self._n_compared += len(rows)

    def _farther(self, known: Farthest | None, found: Farthest | None) -> Farthest | None:
        if found is None or (known is not None and known.distance >= found.distance):
            return known
        return replace(found, frame=found.frame + self._n_seen)

    def notes(self, path: Path, figure: Figure, first_frame: int) -> list[Diagnostic]:
        """Return a note with the largest errors, if there are any."""
        least = tolerance(figure, self._reach)
        joints, vertices = (
            None if each is None or each.distance <= least else each
            for each in (self._joints, self._vertices)
        )
        found = Apart(joints, vertices, self._n_compared, self._n_compared)
        return apart_notes(
            path, figure, found, first_frame, vertices="vertices of a skin driven by it"
        )


def frames_losses(
    path: Path,
    animation: SampledAnimation,
    written: Frames,
    how: Skinning,
    span: tuple[int, int] | None = None,
    is_between: bool = False,
) -> list[Diagnostic]:
    """Return a note with the largest errors of poses that were read back, if there are any.

    ``path``: the written file.
    ``animation``: the original; missing frames are not compared.
    ``written``: contents of the file: poses of the animation's figure, one per frame of the span.
    ``how``: skinning of the mesh; both motions are compared with LBS (linear blend skinning)
      instead of its method, which the file of a motion does not store.
    ``span``: half-open range of frames in the file; all if omitted.
    ``is_between``: whether the times of these poses are between the frames.
    """
    figure, frames = animation.figure, animation.frames
    first, stop = (0, frames.n_frames) if span is None else span
    rows = first + np.flatnonzero(frames.present[first:stop])
    # The shape of the file's first frame is added to the mesh once; ``columns`` are the blend
    # shapes whose weights differ from it in a frame of either motion, and are added in every frame.
    # Any shape would do; with this one, a constant shape has no columns.
    still = written.shape_weights[0]
    columns = np.union1d(changing(frames, still), changing(written, still))
    linear = linear_as_opened(how)
    expected = figure_side(figure, frames, linear, still, columns)
    found_side = figure_side(figure, written, linear, still, columns)
    least = negligible(figure, frames, rows)
    found = apart(expected, found_side, rows, least, rows - first)
    if is_between:
        return apart_notes(path, figure, found, None, original="the motion between frames")
    return apart_notes(path, figure, found, animation.first_frame)


# Errors of an exported motion at times between its frames.
#
# A motion given as curves is compared with the file at the times where the two are likely to
# differ most; a capture, which has no curves, at the times of its own frames.
#
# Both motions are smooth in a span between neighbouring keys or frames: mostly a cubic and the
# line, or arc, that interpolates it. Their difference is 0 at both ends if the file has poses at
# these times, and has at most two extrema in between. It is sampled in each span, and the highest
# samples are refined (``_refined``). Whatever the curves are, a reported distance exists at a time
# of the motion: a missed maximum makes the result too small, never too large. If there are too many
# spans to sample, the note calls the result an estimate.

_ON_FRAME = 1e-6  # tolerance in frames for a time to be on a frame

# A cubic that is 0 at both ends, u (1 - u) (u - z) with any z, has a sample of at least 91 % of its
# maximum among five evenly spaced ones, and of 98 % among seventeen (found by trying all z). The
# distance of a joint is the length of a vector of three such cubics, for which random coefficients
# give the same limits; the largest distance of all joints has them, too, because that joint's
# distance has.
_MOST = 8192  # steps of all spans before refinement; each step, and each span, adds a sample
_STEPS = 16  # steps of a span at most: more improve the best sample by less than 2 %
_FEWEST = 4  # steps of a span; if there are fewer, only likely spans are sampled
_LIKELY = 256  # number of likely spans, for joints and vertices each: 2 x 256 x 16 steps = _MOST
_MOST_ROUNDS = 8192  # repetitions of a curve whose keys count; evenly spaced if there are more
_INSET = 1e-6  # fraction of a span that is excluded near its keys, where curves may jump
_SHORT = 1e-6  # spans shorter than this, in frames, are ignored
_BLOCK = 1024  # poses per block, which limits the memory
_PEAKS = 64  # maximum number of refined peaks
# Samples lower than this fraction of the highest one are not refined. The largest distance of all
# has a sample above 91 % of the highest one; the margin is for curves that are not cubics.
_HOPEFUL = 0.75
_NEAR, _ROUNDS = 8, 4  # steps around a peak, and how often they are narrowed: see ``_refined``
_Sampler = Callable[[Floats], Frames]


def resampling_losses(path: Path, animation: SampledAnimation, how: Skinning) -> list[Diagnostic]:
    """Return a note about the error of interpolating between the written frames, if any."""
    rate, first = animation.frame_rate, animation.frames.times[0]
    clip = clip_of(animation.motion.name, animation)

    def written(times: Floats) -> Frames:
        # Rounding could place the first frame before the clip.
        return frames_of(animation.figure, clip, np.maximum(times - first, 0.0))

    return with_values(
        between_losses(path, animation, written, how),
        rate=Shown(f": written at {rate:g} fps", rate),
    )


def between_losses(
    path: Path,
    animation: SampledAnimation,
    written: _Sampler,
    how: Skinning,
    also: Floats | None = None,
) -> list[Diagnostic]:
    """Return a note with the largest errors of a file between an animation's frames, if any.

    ``written``: returns the file's poses at times in seconds. ``also``: further times at which a
    sampled motion is compared, such as the middles between frames.
    """
    estimate: Phrase | str = ""
    if animation.motion.kind != "sampled":
        edges = np.union1d(
            animation.frames.times,
            key_times(animation.motion, *animation.frames.times[[0, -1]].tolist()),
        )
        worst = _worst_times(
            animation.figure,
            lambda times: frames_at(animation, times),
            written,
            edges,
            animation.frame_rate,
            how,
        )
        times = worst.times
        if worst.is_estimate:
            estimate = Phrase("an estimate from {n}", n=counted(worst.looked, "time"))
    else:
        motion = animation.motion
        own = motion.timing.times
        place = (own - animation.frames.times[0]) * animation.frame_rate
        is_between = np.abs(place - np.round(place)) > _ON_FRAME
        times = own[is_between & (place > 0.0) & (place < animation.frames.n_frames - 1)]
        times = times if also is None else np.union1d(times, also)
    if len(times) == 0:
        return []
    read, wanted = written(times), frames_at(animation, times)
    wanted = replace(wanted, present=wanted.present & read.present)
    if not wanted.present.any():
        return []
    notes = frames_losses(path, replace(animation, frames=wanted), read, how, is_between=True)
    return with_values(notes, estimate=optional(" ({})", estimate))


@dataclass(frozen=True, slots=True, eq=False)
class _WorstTimes:
    """Candidate times of the largest distance."""

    times: Floats
    """(T,): candidate times, seconds."""
    looked: int
    """Number of sampled times."""
    is_estimate: bool
    """Whether there were too few samples to be certain."""


def key_times(clip: Clip | TransformClip, start: float, stop: float) -> Floats:
    """Return the times of all keys within a range, including repetitions of curves, seconds."""
    if clip.kind == "curves":
        every = [_repeated(channel, start, stop) for channel in clip.channels if len(channel.times)]
    else:
        every = [channel.times for channel in clip.channels]
    times = np.unique(np.concatenate([np.zeros(0), *every]))
    return times[(times > start) & (times < stop)]


def _repeated(channel: Channel, start: float, stop: float) -> Floats:
    """Return the times of a channel's keys, and of their repetitions from start to stop."""
    times = channel.times
    first, span = times[0], times[-1] - times[0]
    if span <= SHORTEST:
        return times
    # Round k is the curve moved by k spans; k is negative before the first key, 0 for the keys
    # themselves. Constant and linear extrapolation have no keys. Every odd round of a bouncing
    # curve is played backwards. If keys are left out because a curve repeats too often, so many
    # spans between the others remain that the result is called an estimate.
    low, high = np.floor((start - first) / span), np.ceil((stop - first) / span) - 1.0
    before, after = (mode not in ("constant", "linear") for mode in channel.extrapolation)
    low, high = low if before else max(low, 0.0), high if after else min(high, 0.0)
    count = int(min(max(high - low + 1.0, 0.0), _MOST_ROUNDS))
    rounds = np.linspace(low, high, count).round()
    is_back = (rounds % 2 == 1) & np.where(
        rounds < 0, channel.extrapolation[0] == "bounce", channel.extrapolation[1] == "bounce"
    )
    within = np.where(is_back[:, None], times[-1] - times, times - first)
    again = first + rounds[:, None] * span + within
    return np.concatenate([times, again.ravel()])


def _worst_times(
    figure: Figure, one: _Sampler, other: _Sampler, edges: Floats, rate: float, how: Skinning
) -> _WorstTimes:
    """Return times of the largest distance of motions that are smooth between ``edges`` (E,), s."""
    spans = np.column_stack([edges[:-1], edges[1:]])
    spans = spans[spans[:, 1] - spans[:, 0] > _SHORT / rate]
    if len(spans) == 0:
        return _WorstTimes(np.zeros(0), 0, False)
    pair, looked = _Pair(figure, one, other, linear_as_opened(how)), 0
    is_estimate = len(spans) * _FEWEST > _MOST
    if is_estimate:
        looked = min(len(spans), _MOST)
        spans = _likely(pair, spans)
    steps = min(_STEPS, _MOST // len(spans))  # at least _FEWEST
    times = _within(spans, np.linspace(_INSET, 1.0 - _INSET, steps + 1))
    pair = pair.watching(times)
    sampled = pair.heights(times)
    looked += len(times)
    limits = _neighbours(spans, times, _SHORT / rate)
    refined = []
    for kind in range(len(sampled)):
        peaks = _peaks(sampled[kind])
        refined.append(_refined(pair, kind, times[peaks], limits[:, peaks]))
        looked += _ROUNDS * (_NEAR + 1) * len(peaks)
    return _WorstTimes(np.unique(np.concatenate(refined)), looked, is_estimate)


def _within(spans: Floats, places: Floats) -> Floats:
    """Return times at relative positions, 0 to 1, within all spans."""
    return np.asarray(spans[:, :1] + np.diff(spans, axis=1) * places).ravel()


def _likely(pair: _Pair, spans: Floats) -> Floats:
    """Return the spans with the largest distances at their centres, in time order."""
    if len(spans) > _MOST:
        spans = spans[np.linspace(0, len(spans) - 1, _MOST).astype(int)]
    middles = _within(spans, np.array([0.5]))
    order = np.argsort(-pair.watching(middles).heights(middles), axis=1, kind="stable")
    return spans[np.unique(order[:, :_LIKELY])]


def _peaks(heights: Floats) -> Rows:
    """Return the indices of the highest local maxima among the samples."""
    padded = np.concatenate([[-np.inf], heights, [-np.inf]])
    is_peak = (heights >= padded[:-2]) & (heights >= padded[2:]) & (heights > 0.0)
    rows = np.flatnonzero(is_peak & (heights >= _HOPEFUL * heights.max(initial=0.0)))
    return rows[np.argsort(-heights[rows], kind="stable")[:_PEAKS]]


def _neighbours(spans: Floats, times: Floats, gap: float) -> Floats:
    """Return the samples before and after each sample, itself where no span adjoins: (2, T)."""
    before, after = (np.tile(times, (2, 1))).reshape(2, len(spans), -1)
    own = times.reshape(len(spans), -1)
    before[:, 1:], after[:, :-1] = own[:, :-1], own[:, 1:]
    adjoins = spans[1:, 0] - spans[:-1, 1] <= gap
    before[1:, 0] = np.where(adjoins, own[:-1, -1], own[1:, 0])
    after[:-1, -1] = np.where(adjoins, own[1:, 0], own[:-1, -1])
    return np.stack([before.ravel(), after.ravel()])


def _refined(pair: _Pair, kind: int, peaks: Floats, limits: Floats) -> Floats:
    """Return refined times of peaks (P,) of the distance of joints (0) or vertices (1).

    ``limits`` (2, P): the samples before and after.
    """
    # A peak is at least as high as the samples before and after it. If the distance has a single
    # maximum between these two, it rises before and falls after it. Of nine evenly spaced times,
    # the highest then has the maximum within one step on either side: beyond its neighbours there
    # would have to be a second one. So each round keeps two of eight steps, and four rounds narrow
    # the two sampling steps by 4^4 = 256. Near a smooth maximum the height lost is quadratic in
    # the time that is missed: 1 / 256^2 of what the samples missed.
    best, low, high = peaks[:, None], limits[0][:, None], limits[1][:, None]
    reach = np.maximum(best - low, high - best)
    for _ in range(_ROUNDS):
        near = np.clip(best + reach * np.linspace(-1.0, 1.0, _NEAR + 1), low, high)
        top = pair.heights(near.ravel())[kind].reshape(near.shape).argmax(axis=1)
        best = np.take_along_axis(near, top[:, None], axis=1)
        reach = reach * 2.0 / _NEAR
    return best.ravel()


@dataclass(frozen=True, slots=True, eq=False)
class _Pair:
    """Two motions of a figure, and the few compared vertices."""

    figure: Figure
    one: _Sampler
    other: _Sampler
    how: Skinning
    followed: Rows | None = None

    def _sides(self, times: Floats) -> tuple[Side, Side]:
        first, second = self.one(times), self.other(times)
        still = second.shape_weights[0]
        columns = np.union1d(changing(first, still), changing(second, still))
        return (
            figure_side(self.figure, first, self.how, still, columns),
            figure_side(self.figure, second, self.how, still, columns),
        )

    def watching(self, times: Floats) -> _Pair:
        """Return the pair restricted to the vertices that are farthest apart at some times."""
        if self.figure.mesh is None or not self.figure.mesh.n_vertices:
            return self
        times = times[evenly(len(times), REGULAR)]
        rows = np.arange(len(times))
        return replace(self, followed=followed_vertices(*self._sides(times), rows))

    def heights(self, times: Floats) -> Floats:
        """Return the largest distance at each time, of joints and any vertices: (1 or 2, T)."""
        blocks = [np.zeros((1 if self.followed is None else 2, 0))]
        for start in range(0, len(times), _BLOCK):
            first, second = self._sides(times[start : start + _BLOCK])
            rows = np.arange(len(times[start : start + _BLOCK]))
            blocks.append(heights(first, second, rows, rows, self.followed))
        return np.concatenate(blocks, axis=1)
