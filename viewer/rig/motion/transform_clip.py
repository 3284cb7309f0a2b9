"""Keyed transforms: keys of translation, rotation, scale and shape weights, as in glTF and FBX.

An ``Animation`` names such a clip before its keys are read, on first playback.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Literal, get_args

import numpy as np

from viewer.data_classes import dataclass
from viewer.errors import RigError
from viewer.rig.arrays import Floats, Ints, frozen

TransformPath = Literal["translation", "rotation", "scale", "weights"]
TRANSFORM_PATHS: tuple[TransformPath, ...] = get_args(TransformPath)
"""Properties that keys can change."""
Interpolation = Literal["step", "linear", "cubic"]
INTERPOLATIONS: tuple[Interpolation, ...] = get_args(Interpolation)
"""Values between keys: the earlier value, a line (slerp for rotations), or a cubic Hermite
spline."""
_COMPONENTS = {"translation": 3, "rotation": 4, "scale": 3}


@dataclass(frozen=True, slots=True, eq=False)
class TransformChannel:
    """The keys of one property of one joint, or of the weights of blend shapes.

    Before its first key and after its last key, a channel has the value of that key (glTF 2.0,
    section 3.11).
    """

    joint: int
    """Joint that moves; -1 for ``"weights"``."""
    path: TransformPath
    """Entry of ``TRANSFORM_PATHS``."""
    times: Floats
    """(N,). Seconds, increasing; N > 0."""
    values: Floats
    """(N, C). Translation relative to the parent joint (rest translation included), quaternion (x,
    y, z, w) including the rest rotation, scale factors, or shape weights."""
    interpolation: Interpolation = "linear"
    """Entry of ``INTERPOLATIONS``. Linear rotations follow the shorter arc; cubic ones are
    normalised after interpolation."""
    tangents: Floats | None = None
    """(N, 2, C) or None. Incoming and outgoing slopes, per second; only for ``"cubic"``."""
    shapes: Ints | None = None
    """(C,) int32 or None. Blend shape of each component; only for ``"weights"``."""

    def __post_init__(self) -> None:
        def put(name: str, shape: tuple[int | None, ...], dtype: type = np.float64) -> None:
            object.__setattr__(self, name, frozen(name, getattr(self, name), shape, dtype))

        if self.path not in TRANSFORM_PATHS or self.interpolation not in INTERPOLATIONS:
            raise RigError(f"channel: found {self.path!r} with {self.interpolation!r}")
        put("times", (None,))
        count = len(self.times)
        put("values", (count, _COMPONENTS.get(self.path)))
        if count == 0 or (self.times[1:] <= self.times[:-1]).any():
            raise RigError("times: expected increasing seconds of at least one key")
        if (self.tangents is not None) != (self.interpolation == "cubic"):
            raise RigError("tangents: expected for cubic interpolation, and only there")
        if self.tangents is not None:
            put("tangents", (count, 2, self.n_components))
        if (self.shapes is not None) != (self.path == "weights"):
            raise RigError("shapes: expected for weights, and only there")
        if self.shapes is not None:
            put("shapes", (self.n_components,), np.int32)
        if self.path == "rotation" and not self.values.any(axis=1).all():
            key = int(np.argmin(self.values.any(axis=1)))
            raise RigError(f"values of key {key}: expected a quaternion, found 0 0 0 0")

    @property
    def n_components(self) -> int:
        """Number of values per key, C."""
        return int(self.values.shape[1])


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class TransformClip:
    """A motion of one figure, as keys of joint transforms and shape weights."""

    name: str
    """Display name."""
    channels: tuple[TransformChannel, ...]
    """At most one per joint and path; properties without a channel have their values in the
    pose."""
    start: float
    end: float
    """Playback range in seconds."""
    extras: Any = None
    """Application data of its file, as parsed from JSON; None if there is none."""
    number: int = -1
    """Index of its animation in the file, which may move several figures; -1 if unknown."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "start", float(self.start))
        object.__setattr__(self, "end", float(self.end))
        if not (math.isfinite(self.start) and self.start <= self.end < math.inf):
            raise RigError(f"clip {self.name}: expected a range, found {self.start} to {self.end}")


class Animation:
    """An animation of a figure.

    ``name``: as in the file; may repeat or be empty. ``start``, ``end``: playback range in seconds.
    ``read``: returns the keys, or raises a ``FormatError``; called at most once. ``place``: JSON
    pointer to the animation in the file; empty if unknown. ``number``: index of the animation in
    its file, which may move several figures; -1 if unknown.
    """

    __slots__ = ("_clip", "_read", "end", "name", "number", "place", "start")

    def __init__(
        self,
        name: str,
        start: float,
        end: float,
        read: Callable[[], TransformClip],
        place: str = "",
        number: int = -1,
    ) -> None:
        self.name, self.start, self.end, self._read = name, start, end, read
        self.place, self.number = place, number
        self._clip: TransformClip | None = None

    def plays(self, clip: object) -> bool:
        """Return whether a motion is the clip of this animation."""
        return clip is not None and clip is self._clip

    def clip(self) -> TransformClip:
        """Return the motion; always the same object.

        Raises ``FormatError`` if the file's keys are invalid, or the file can no longer be read.
        """
        if self._clip is None:
            self._clip = self._read()
        return self._clip
