"""An arm that moves along x, with a frame missing."""

from __future__ import annotations

import math

import numpy as np
from rendering.drawn_figures import arm

from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.motion.timing import Timing
from viewer.rig.scene import Actor

RATE, SPEED, MISSING = 10.0, 2.0, 5


def moving_arm(turns: bool = True) -> Actor:
    """Return an arm of three joints and a motion of 11 frames at 10 fps.

    It moves along x at 2 units per second; its elbow rotates about y by up to 90 degrees. Frame 5
    is missing.
    """
    frames = np.delete(np.arange(11), MISSING)
    rows = np.full(11, -1, dtype=np.int32)
    rows[frames] = np.arange(10)
    rotations = np.tile([0.0, 0.0, 0.0, 1.0], (10, 3, 1))
    if turns:
        half = frames / 10 * math.pi / 4
        rotations[:, 1, 1], rotations[:, 1, 3] = np.sin(half), np.cos(half)
    places = np.zeros((10, 3))
    places[:, 0] = SPEED * frames / RATE
    clip = SampledClip("moves", Timing(RATE, rows), rotations, figure_translations=places)
    return Actor(arm(3), clip=clip)
