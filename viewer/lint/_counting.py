"""How frames are counted where motions have none of their own: as the timeline counts them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from viewer.rig.arrays import Floats, Ints
from viewer.rig.captures.points import PointClip
from viewer.rig.motion.evaluation import frame_rate, time_span
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.scene import Scene

__all__ = ["Counting", "counting_of"]

_ON_FRAME = 1e-6  # of a frame: nearer than this to a frame is that frame


@dataclass(frozen=True, slots=True)
class Counting:
    """The frames of a timeline.

    Attributes
    ----------
    rate : float
        Frames a second.
    origin : float
        Seconds of the scene's clock at the first one.
    first : int
        What it is called.
    """

    rate: float
    origin: float
    first: int = 0

    def numbers(self, times: Floats) -> Ints:
        """Return the frame that is shown at each time of the scene's clock: (N,) int32."""
        places = np.floor((times - self.origin) * self.rate + _ON_FRAME)
        return places.astype(np.int32) + np.int32(self.first)


def counting_of(scene: Scene, keyed_rate: float) -> Counting:
    """Return how a scene's timeline counts: by its longest capture, else from the first start.

    Parameters
    ----------
    scene : Scene
        With or without motions.
    keyed_rate : float
        Frames a second where nothing consists of frames.
    """
    moving = [actor for actor in scene.actors if actor.clip is not None]
    captured = [actor for actor in moving if isinstance(actor.clip, SampledClip | PointClip)]
    if not captured:
        return Counting(keyed_rate, time_span(moving)[0])
    longest = max(captured, key=lambda actor: np.subtract(*time_span([actor])[::-1]))
    clip = longest.clip
    assert isinstance(clip, SampledClip | PointClip)  # only those were gathered
    timing = clip.timing
    return Counting(frame_rate(clip), timing.start + longest.offset, timing.first_frame)
