"""Frame numbers, as on the timeline, of motions that are not stored as frames."""

from __future__ import annotations

import numpy as np

from viewer.data_classes import dataclass
from viewer.rig.arrays import Floats, Ints
from viewer.rig.captures.points import PointClip
from viewer.rig.motion.evaluation import frame_rate, time_span
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.scene import Scene

__all__ = ["Counting", "counting_of"]

_ON_FRAME = 1e-6  # tolerance, as a fraction of a frame, within which a time counts as that frame's


@dataclass(frozen=True, slots=True)
class Counting:
    """Frame numbering of a timeline.

    Attributes
    ----------
    rate : float
        Frames per second.
    origin : float
        Time of the first frame on the scene's clock, in seconds.
    first : int
        Number of the first frame.
    """

    rate: float
    origin: float
    first: int = 0

    def numbers(self, times: Floats) -> Ints:
        """Return the frame shown at each time of the scene's clock: (N,) int32."""
        places = np.floor((times - self.origin) * self.rate + _ON_FRAME)
        return places.astype(np.int32) + np.int32(self.first)


def counting_of(scene: Scene, keyed_rate: float) -> Counting:
    """Return a scene's frame numbering: its longest capture's, or from the earliest start.

    Parameters
    ----------
    scene : Scene
        Scene with or without motions.
    keyed_rate : float
        Frames per second if no motion consists of frames.
    """
    moving = [actor for actor in scene.actors if actor.clip is not None]
    captured = [actor for actor in moving if isinstance(actor.clip, SampledClip | PointClip)]
    if not captured:
        return Counting(keyed_rate, time_span(moving)[0])
    longest = max(captured, key=lambda actor: np.subtract(*time_span([actor])[::-1]))
    clip = longest.clip
    assert isinstance(clip, SampledClip | PointClip)  # only sampled motions were collected
    timing = clip.timing
    return Counting(frame_rate(clip), timing.start + longest.offset, timing.first_frame)
