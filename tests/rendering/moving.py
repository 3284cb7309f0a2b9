"""An arm that moves along x with a missing frame, and a moving camera."""

import math

import numpy as np
from rendering.drawn_figures import arm

from viewer.rigs.captures.cameras import CameraMotion, CameraView
from viewer.rigs.geometry.rotation import axis_rotations
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.scene import Actor

RATE, SPEED, MISSING = 10.0, 2.0, 5
FILMED, SIZE = 5, (160, 120)
K = np.array([[300.0, 0.0, 79.5], [0.0, 300.0, 59.5], [0.0, 0.0, 1.0]])
_UPRIGHT = np.diag([1.0, -1.0, -1.0])  # looks along -z with y up


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


def moving_camera() -> CameraView:
    """Return a camera 5 in front of the origin that moves by 0.2 and rotates by 3 degrees per
    frame. It moves to the right and rotates to the left, so the origin stays in the picture.
    """
    frames = np.arange(FILMED)
    turns = axis_rotations(1, np.radians(3.0) * frames)
    centers = np.stack([0.2 * frames, 0.5 + 0.0 * frames, 5.0 + 0.0 * frames], axis=1)
    rotations = turns @ _UPRIGHT
    translations = -np.einsum("nab,nb->na", rotations, centers)
    motion = CameraMotion(Timing(RATE, frames.astype(np.int32)), rotations, translations)
    return CameraView("video", K, rotations[0], translations[0], SIZE, motion=motion)


def pixel(view: CameraView, frame: int, point: np.ndarray) -> np.ndarray:
    """Return the pixel of a scene point in one frame, from K (R X + T)."""
    seen = K @ (view.motion.rotations[frame] @ point + view.motion.translations[frame])
    return seen[:2] / seen[2]
