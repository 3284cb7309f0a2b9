"""Small synthetic clips of one or two joints for tests of clean-up."""

import numpy as np

from viewer.rig.geometry.quaternion import rotation_vector_to_quaternion
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.motion.timing import Timing

RATE = 30.0


def turning(angles, axis=(0.0, 0.0, 1.0), rows=None, places=None, rate=RATE) -> SampledClip:
    """Return a clip of one joint that rotates about an axis by some angles (N,), radians."""
    angles = np.asarray(angles, dtype=float)
    vectors = angles[:, None, None] * (np.array(axis) / np.linalg.norm(axis))
    rows = np.arange(len(angles)) if rows is None else np.asarray(rows)
    timing = Timing(rate, rows.astype(np.int32), first_frame=10, holds=False)
    return SampledClip(
        "turning", timing, rotation_vector_to_quaternion(vectors), figure_translations=places
    )


def angles_of(clip: SampledClip) -> np.ndarray:
    """Return the angles of a clip about z, frame by frame, without jumps; NaN in gaps."""
    rows = clip.timing.rows
    quaternions = clip.rotations[rows, 0]
    found = np.unwrap(2.0 * np.arctan2(quaternions[:, 2], quaternions[:, 3]))
    return np.where(rows >= 0, found, np.nan)
