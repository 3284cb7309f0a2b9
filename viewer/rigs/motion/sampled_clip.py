"""Sampled clips: local rotations of every joint at a fixed rate, with gaps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any, ClassVar, Literal, TypeVar

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.rigs.arrays import Floats, Ints, freeze_fields
from viewer.rigs.captures.points import PointClip
from viewer.rigs.checked_fields import checked
from viewer.rigs.geometry.quaternion import slerp
from viewer.rigs.motion.samples import Samples, joint_samples
from viewer.rigs.motion.timing import Timing

if TYPE_CHECKING:
    from viewer.rigs.skeleton import Skeleton


@checked
@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class SampledClip:
    """A motion of one skeleton as frames, as captures are stored."""

    kind: ClassVar[Literal["sampled"]] = "sampled"
    points: ClassVar[None] = None
    """Joints move."""
    name: str
    """Display name."""
    timing: Timing
    """Frame rate, and the row of each frame."""
    rotations: Floats
    """(N, J, 4). Each joint's complete rotation relative to its parent: unit quaternions (x, y, z,
    w)."""
    translations: Floats | None = None
    """(N, J, 3) or None. Offsets from the joints' rest translations."""
    figure_translations: Floats | None = None
    """(N, 3) or None. Translations of the whole figure, after skinning."""
    figure_scales: Floats | None = None
    """(N,) or None. Scales of the whole figure."""
    shape_weights: Floats | None = None
    """(N, S) or (1, S) or None. Blend shape weights; a single row applies to all frames. If None,
    the pose's values are used."""
    scales: Floats | None = None
    """(N, J, 3) or (1, J, 3) or None. Local scale factors of the joints; a single row applies to
    all frames. If None, the pose's values are used."""

    def __post_init__(self) -> None:
        freeze_fields(self, rotations=(None, None, 4))
        count = self.n_rows
        freeze_fields(self, translations=(count, self.n_joints, 3), figure_translations=(count, 3))
        freeze_fields(self, figure_scales=(count,), shape_weights=(None, None))
        freeze_fields(self, scales=(None, self.n_joints, 3))
        for name in ("shape_weights", "scales"):
            rows = getattr(self, name)
            if rows is not None and len(rows) not in (1, self.n_rows):
                raise RigError(f"{name}: expected {self.n_rows} rows, found {len(rows)}")
        if self.timing.n_frames and self.timing.rows.max() >= self.n_rows:
            raise RigError(f"rows: expected 0 to {self.n_rows - 1}, found {self.timing.rows.max()}")

    @property
    def n_rows(self) -> int:
        """Number of frames with data, N."""
        return len(self.rotations)

    @property
    def n_joints(self) -> int:
        """Number of joints, J."""
        return int(self.rotations.shape[1])

    @property
    def start(self) -> float:
        """Seconds of the first frame."""
        return self.timing.start

    @property
    def end(self) -> float:
        """Seconds of the last frame."""
        return self.timing.end

    @property
    def sets_shape(self) -> bool:
        """Whether it sets weights of blend shapes."""
        return self.shape_weights is not None

    @property
    def frame_rate(self) -> float:
        """Frames per second."""
        return self.timing.frame_rate

    def sample(
        self, skeleton: Skeleton | None, times: Floats, interpolate: bool = False
    ) -> Samples:
        """Return all joints at times (T,), across gaps if asked; frames are as stored."""
        before, after, fraction = self.timing.locate(times, interpolate)
        present = before >= 0
        before, after = np.maximum(before, 0), np.maximum(after, 0)
        if self.n_rows == 0:
            rest = np.tile([0.0, 0.0, 0.0, 1.0], (len(before), self.n_joints, 1))
            return joint_samples(skeleton, present, rest)
        rotations, between = _taken(self.rotations, before), np.flatnonzero(fraction > 0.0)
        if len(between):
            rotations = rotations.copy()
            ends = self.rotations[after[between]]
            rotations[between] = slerp(rotations[between], ends, fraction[between, None])
        every = (
            self.translations,
            self.figure_translations,
            self.figure_scales,
            self.shape_weights,
            self.scales,
        )
        lines = (None if rows is None else _line(rows, before, after, fraction) for rows in every)
        return joint_samples(skeleton, present, rotations, *lines)


def _taken(rows: Floats, places: Ints) -> Floats:
    """Return the rows at some indices; the array itself if these are all rows."""
    if len(places) == len(rows) and (places == np.arange(len(rows))).all():
        return rows
    return rows[places]


def _line(rows: Floats, before: Ints, after: Ints, fraction: Floats) -> Floats:
    if len(rows) == 1:
        return rows[np.zeros(len(before), dtype=np.int32)]
    start = _taken(rows, before)
    if not fraction.any():
        return start
    weight = fraction.reshape(-1, *[1] * (rows.ndim - 1))
    return start + weight * (rows[after] - start)


_Captured = TypeVar("_Captured", bound="SampledClip | PointClip")


def joined(clips: Sequence[_Captured], timing: Timing) -> _Captured:
    """Return one clip with the rows of several clips of the same arrays, and a new timing."""
    if len(clips) == 1:
        return replace(clips[0], timing=timing)
    names = (each.name for each in fields(clips[0]) if each.name not in ("name", "timing"))
    return replace(clips[0], timing=timing, **{name: _stacked(clips, name) for name in names})


def _stacked(clips: Sequence[_Captured], name: str) -> Any:
    """Return the rows of one array; a single row that applies to all frames is not repeated."""
    parts = [getattr(clip, name) for clip in clips]
    if parts[0] is None:
        return None
    if name in ("shape_weights", "scales"):
        if all(len(part) == 1 and (part == parts[0]).all() for part in parts):
            return parts[0]
        counts = [clip.n_rows for clip in clips]
        parts = [
            np.broadcast_to(part, (n, *part.shape[1:]))
            for part, n in zip(parts, counts, strict=True)
        ]
    return np.concatenate(parts)


def is_shared(clip: SampledClip | PointClip, name: str) -> bool:
    """Return whether an array of a clip has a single row, which applies to all frames."""
    if name not in ("shape_weights", "scales"):
        return False
    rows = getattr(clip, name)
    return rows is not None and len(rows) == 1


def with_rows(
    clip: _Captured, timing: Timing, change: Callable[[str, Floats], Floats]
) -> _Captured:
    """Return a clip with ``change(name, rows)`` of each array's rows; a shared row stays."""
    arrays: dict[str, Any] = {}
    for name in (each.name for each in fields(clip)):
        rows = getattr(clip, name)
        if isinstance(rows, np.ndarray) and not is_shared(clip, name):
            arrays[name] = change(name, rows)
    return replace(clip, timing=timing, **arrays)


def with_rate(clip: SampledClip | PointClip, rate: float) -> SampledClip | PointClip:
    """Return a clip with the same frames and start at another rate; itself if it has that rate."""
    if clip.timing.frame_rate == rate:
        return clip
    return replace(clip, timing=replace(clip.timing, frame_rate=rate))
