"""Evaluation of transform clips: slerp, linear, step and cubic interpolation (glTF 2.0)."""

from __future__ import annotations

import numpy as np

from viewer.data_classes import dataclass
from viewer.rig.arrays import Floats, Ints
from viewer.rig.memo import Memo
from viewer.rig.motion.transform_clip import TransformClip, TransformPath
from viewer.rig.transforms.table import (
    Arcs,
    Curves,
    Timelines,
    TransformTable,
    transform_table,
)

__all__ = ["TransformSamples", "sample_transforms"]

_tables: Memo[TransformClip, TransformTable] = Memo(kept=1)


@dataclass(frozen=True, slots=True, eq=False)
class TransformSamples:
    """Values of all channels of a clip at T times.

    Attributes
    ----------
    rotated, translated, scaled : (R,), (N,), (M,) int32
        Joints with channels.
    weighted : (W,) int32
        Blend shapes with channels.
    rotations : (T, R, 4)
        Relative to the parent joint, rest rotation included: unit quaternions (x, y, z, w).
    translations : (T, N, 3)
        Relative to the parent joint, rest translation included.
    scales : (T, M, 3)
        Factors.
    weights : (T, W)
        Weights of the shapes ``weighted``.
    """

    rotated: Ints
    translated: Ints
    scaled: Ints
    weighted: Ints
    rotations: Floats
    translations: Floats
    scales: Floats
    weights: Floats


def sample_transforms(clip: TransformClip, times: Floats) -> TransformSamples:
    """Return the values of all channels at given times.

    Linear: p0 + u (p1 - p0); for rotations, spherical along the shorter arc. Step: p0. Cubic, over
    a span of h seconds (glTF 2.0, appendix C):
    (2 u^3 - 3 u^2 + 1) p0 + h (u^3 - 2 u^2 + u) b0 + (3 u^2 - 2 u^3) p1 + h (u^3 - u^2) a1, with
    incoming tangents a and outgoing tangents b; rotations are normalised afterwards. Before its
    first key and after its last key, a channel has the value of that key.

    Parameters
    ----------
    clip : TransformClip
        With any number of channels.
    times : (T,)
        Seconds.

    Returns
    -------
    TransformSamples
        At the time of a key, exactly the key's value; rotations are normalised.
    """
    table = _tables.get(clip, (), lambda: transform_table(clip.channels))
    times = np.atleast_1d(np.asarray(times, dtype=np.float64))
    spans, fractions = _places(table.timelines, times)
    arcs = _arcs(table.arcs, spans, fractions)
    lines = _lines(table.lines, spans, fractions)
    cubics = np.zeros((len(times), 0))
    if len(table.cubics.timelines):
        cubics = _cubics(table.cubics, table.timelines, spans, fractions)

    def part(path: TransformPath, width: int) -> Floats:
        targets, count = table.targets[path], len(times)
        plain = arcs if path == "rotation" else lines[:, targets.lines].reshape(count, -1, width)
        curved = cubics[:, targets.cubics].reshape(count, -1, width)
        if path == "rotation" and curved.shape[1]:
            curved = _normalised(curved)
        return np.concatenate([plain, curved], axis=1) if curved.shape[1] else plain

    indices = {path: targets.indices for path, targets in table.targets.items()}
    return TransformSamples(
        indices["rotation"], indices["translation"], indices["scale"], indices["weights"],
        part("rotation", 4), part("translation", 3), part("scale", 3), part("weights", 1)[..., 0],
    )  # fmt: skip


def _places(timelines: Timelines, times: Floats) -> tuple[Ints, Floats]:
    """Return the key before each time, and the fraction of the span elapsed since: (T, U)."""
    passed = np.searchsorted(timelines.union, times, side="right")
    keys = np.searchsorted(timelines.ranks, timelines.ends + passed[:, None], side="right") - 1
    keys = np.maximum(keys, timelines.first)
    spans = keys - timelines.first
    fractions = (times[:, None] - timelines.times.take(keys)) / timelines.durations.take(keys)
    # Before the first key the difference is negative; after the last one the duration is infinite.
    return spans, np.maximum(fractions, 0.0)


def _arcs(arcs: Arcs, spans: Ints, fractions: Floats) -> Floats:
    """Return rotations by (sin((1 - u) t) q0 + sin(u t) q1) / sin(t): (T, R, 4)."""
    rows = arcs.bases + spans.take(arcs.timelines, axis=1)
    angles, sines = arcs.angles.take(rows), arcs.sines.take(rows)
    after = fractions.take(arcs.timelines, axis=1) * arcs.slopes * angles
    first, second = np.sin(angles - after) / sines, np.sin(after) / sines
    before, following = arcs.keys.take(rows, axis=0), arcs.keys.take(rows + 1, axis=0)
    return first[..., None] * before + second[..., None] * following


def _lines(curves: Curves, spans: Ints, fractions: Floats) -> Floats:
    """Return linear and step interpolation: (T, C)."""
    rows = curves.bases + spans.take(curves.timelines, axis=1) * curves.strides
    start = curves.values.take(rows)
    rise = curves.values.take(rows + curves.strides) - start
    return start + fractions.take(curves.timelines, axis=1) * curves.slopes * rise


def _cubics(curves: Curves, timelines: Timelines, spans: Ints, fractions: Floats) -> Floats:
    """Return cubic Hermite splines: (T, C)."""
    durations = timelines.durations[timelines.first + spans]
    durations = np.where(np.isfinite(durations), durations, 0.0)[:, curves.timelines]
    rows = curves.bases + spans.take(curves.timelines, axis=1) * curves.strides
    following = rows + curves.strides
    u, start = fractions.take(curves.timelines, axis=1), curves.values.take(rows)
    rise = curves.values.take(following) - start
    leaving, arriving = curves.outgoing.take(rows), curves.incoming.take(following)
    # The basis functions of both values sum to 1, so this form gives exactly p0 at u = 0.
    bend = (u - 1.0) * (u - 1.0) * leaving + u * (u - 1.0) * arriving
    return start + u * u * (3.0 - 2.0 * u) * rise + durations * u * bend


def _normalised(quaternions: Floats) -> Floats:
    """Return unit quaternions; if a spline passes through 0, the rotation is arbitrary."""
    lengths = np.linalg.norm(quaternions, axis=-1, keepdims=True)
    still = np.array([0.0, 0.0, 0.0, 1.0])
    return np.where(lengths > 0.0, quaternions / np.where(lengths > 0.0, lengths, 1.0), still)
