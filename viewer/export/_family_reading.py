"""Poses of the original figure, read back from written motions of the SMPL family."""

from __future__ import annotations

import json
from array import array
from dataclasses import replace

import numpy as np

from viewer.export._family_frames import up_axis
from viewer.export._options import MotionOptions
from viewer.rig.arrays import Floats
from viewer.rig.geometry.quaternion import multiply, rotation_vector_to_quaternion
from viewer.rig.geometry.rotation import rotation_vector_to_matrix
from viewer.rig.motion.body_motion import BodyMotion, body_clip
from viewer.rig.motion.evaluation import Frames, frames_of, rest_translations_of
from viewer.rig.motion.sampled_animation import SampledAnimation
from viewer.rig.motion.timing import Timing
from viewer.rig.smpl_family import Member
from viewer.rig.units import METRES


def read_frames(motion: BodyMotion, animation: SampledAnimation, options: MotionOptions) -> Frames:
    """Return the poses in a file for an animation's figure, in the animation's world and unit.

    ``motion``: the read motion, in metres.
    ``animation``: the written animation.
    ``options``: options with the up axes of the animation and the file.
    """
    figure, count = animation.figure, motion.timing.n_frames
    timing = Timing(motion.timing.frame_rate, np.arange(count, dtype=np.int32))
    moved = motion.translations / METRES[figure.unit]
    # Coefficients were written as they are, so they are read as those of the figure.
    motion = replace(motion, timing=timing, translations=moved, shape_space=figure.shape_space)
    clip, _ = body_clip(motion, figure)
    found = frames_of(figure, clip, np.arange(count) / timing.frame_rate)
    if up_axis(options) == options.world_up:
        return found
    angle = -np.pi / 2 if up_axis(options) == "z" else np.pi / 2
    return _rotated(found, animation, np.array([angle, 0.0, 0.0]))


def _rotated(frames: Frames, animation: SampledAnimation, vector: Floats) -> Frames:
    """Return frames in a rotated world: R' = Q R, T' = Q (p + T) - p; p is the root at rest."""
    rotations = frames.rotations.copy()
    rotations[:, 0] = multiply(rotation_vector_to_quaternion(vector), rotations[:, 0])
    root = rest_translations_of(animation.figure, frames.shape_weights)[:, 0]
    rotation = np.round(
        rotation_vector_to_matrix(vector)
    )  # a rotation by 90 degrees has integer entries
    places = (root + frames.figure_translations) @ rotation.T - root
    return replace(frames, rotations=rotations, figure_translations=places)


class Records:
    """The records of one person in EasyMocap's frames, parsed from their text.

    ``member``: the body model.
    """

    def __init__(self, member: Member) -> None:
        self._member = member
        self._rows: list[dict[str, array[float]]] = []

    def motion(self, rate: float) -> BodyMotion:
        """Return the motion of all added frames."""
        rotation = self._array("poses").reshape(len(self._rows), -1, 3)
        rotation[:, 0] = self._array("Rh")
        has_expression = "expression" in self._rows[0]
        return BodyMotion(
            "again",
            Timing(rate, np.arange(len(self._rows), dtype=np.int32)),
            self._member.names,
            rotation,
            self._array("Th"),
            about_origin=True,
            shape=self._array("shapes"),
            expression=self._array("expression") if has_expression else None,
        )

    def add(self, text: str) -> None:
        """Add the record of the next frame."""
        # Arrays take a quarter of the memory of lists.
        record = json.loads(text)
        record.pop("id", None)
        self._rows.append({key: array("d", row) for key, (row,) in record.items()})

    def _array(self, key: str) -> Floats:
        return np.array([record[key] for record in self._rows], dtype=np.float64)
