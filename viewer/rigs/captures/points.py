"""Captured 3D keypoints: their layout of names and limbs, and their motion."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.rigs.arrays import Floats, Ints, freeze_fields
from viewer.rigs.checked_fields import checked
from viewer.rigs.motion.samples import Samples
from viewer.rigs.motion.timing import Timing

if TYPE_CHECKING:
    from viewer.rigs.skeleton import Skeleton


@dataclass(frozen=True, slots=True, eq=False)
class PointLayout:
    """Names and limbs of a set of keypoints."""

    title: str
    """``"body25"``, ``"coco"`` …."""
    names: tuple[str, ...]
    """Standard names: ``left_knee``."""
    limbs: Ints
    """(L, 2) int32. Pairs of keypoints, drawn as lines."""
    sides: Ints
    """(K,) int32. -1 for right, 0 for the middle, 1 for left."""

    def __post_init__(self) -> None:
        count = len(self.names)
        freeze_fields(self, np.int32, limbs=(None, 2), sides=(count,))
        if self.limbs.size and not 0 <= self.limbs.min() <= self.limbs.max() < count:
            raise RigError(f"limbs: expected 0 to {count - 1}, found {self.limbs.max()}")


@checked
@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class PointClip:
    """A motion of points."""

    kind: ClassVar[Literal["points"]] = "points"
    name: str
    """Display name."""
    timing: Timing
    """Frame rate, and the row of each frame."""
    points: Floats
    """(N, K, 4). x, y, z and confidence; confidence 0 means "not visible", and x, y, z are then
    undefined."""

    def __post_init__(self) -> None:
        freeze_fields(self, points=(None, None, 4))

    @property
    def start(self) -> float:
        """Seconds of the first frame."""
        return self.timing.start

    @property
    def end(self) -> float:
        """Seconds of the last frame."""
        return self.timing.end

    @property
    def frame_rate(self) -> float:
        """Frames per second."""
        return self.timing.frame_rate

    @property
    def n_rows(self) -> int:
        """Number of frames with data, N."""
        return len(self.points)

    def sample(
        self, skeleton: Skeleton | None, times: Floats, interpolate: bool = False
    ) -> Samples:
        """Return the points at times (T,), in seconds; ``interpolate``: also across gaps."""
        before, after, fraction = self.timing.locate(times, interpolate)
        present = before >= 0
        if not self.n_rows:
            return Samples(present, points=np.zeros((len(present), *self.points.shape[1:])))
        start, end = self.points[np.maximum(before, 0)], self.points[np.maximum(after, 0)]
        mixed = start + fraction[:, None, None] * (end - start)
        both = (start[..., 3] > 0.0) & (end[..., 3] > 0.0)
        return Samples(present, points=np.where(both[..., None], mixed, start))


def visible_size(points: Floats) -> float:
    """Return the median diagonal of the boxes of visible points (F, K, 4); 0 if there are none."""
    seen = points[..., 3:] > 0.0
    low = np.where(seen, points[..., :3], np.inf).min(axis=1)
    high = np.where(seen, points[..., :3], -np.inf).max(axis=1)
    known = seen.any(axis=(1, 2))
    sizes = np.linalg.norm(high[known] - low[known], axis=1)
    return float(np.median(sizes)) if len(sizes) else 0.0
