"""Bending axes of knees and elbows, found from the motion.

A joint bends about the normal of its two bones, cross(upper, lower), whose length is the sine of
the angle. Knees bend backwards and elbows forwards, so the sign of the normal distinguishes left
from right. Its mean over the motion, in the axes of a joint, is the bending axis of the joint.
"""

from __future__ import annotations

import numpy as np

from viewer.data_classes import dataclass
from viewer.rig.arrays import Floats
from viewer.rig.retargeting.postures import SIDES, Postures, unit

__all__ = ["LimbAxes", "limb_axes"]

_LIMBS = (("hip", "knee", "ankle", -1.0), ("shoulder", "elbow", "wrist", 1.0))
_BENT = np.sin(np.radians(15.0))  # sine of the minimum bend that shows the axis of a joint
_COHERENT = 0.7  # minimum ratio of the length of the mean normal to the mean length of the normals


@dataclass(frozen=True, slots=True, eq=False)
class LimbAxes:
    """Directions of a limb's two bones and its bending axis, in the axes of two joints.

    Attributes
    ----------
    upper, lower : str
        The joints at the start of the two bones, such as ``left_hip`` and ``left_knee``.
    bones : (2, 3)
        Unit vectors along the bones, each in the axes of its joint.
    bends : (2, 3)
        The bending axis in the axes of both joints.
    is_seen : bool
        Whether the motion shows the axis; otherwise it is assumed to be sideways to the body.
    """

    upper: str
    lower: str
    bones: Floats
    bends: Floats
    is_seen: bool


def limb_axes(postures: Postures) -> list[LimbAxes]:
    """Return the axes of both legs and both arms.

    Parameters
    ----------
    postures : Postures
        Upright poses of the motion.
    """
    return [
        _limb(postures, tuple(f"{side}_{part}" for part in parts), front)
        for *parts, front in _LIMBS
        for side in SIDES
    ]


def _limb(postures: Postures, names: tuple[str, ...], front: float) -> LimbAxes:
    upper, lower, end = names
    bones = postures.direction(upper, lower), postures.direction(lower, end)
    normals = np.cross(*bones)
    frames = [postures.rotations[:, postures.joints[name]] for name in (upper, lower)]
    bends = [_mean(axes, normals) for axes in frames]
    sines = np.linalg.norm(normals, axis=1)
    lengths = [float(np.linalg.norm(bend)) for bend in bends]
    is_seen = bool(sines.max() > _BENT and min(lengths) > _COHERENT * sines.mean())
    if not is_seen:
        sideways = [np.cross(bone, front * postures.forward()) for bone in bones]
        bends = [_mean(axes, side) for axes, side in zip(frames, sideways, strict=True)]
    means = [_mean(axes, bone) for axes, bone in zip(frames, bones, strict=True)]
    return LimbAxes(upper, lower, unit(np.array(means)), unit(np.array(bends)), is_seen)


def _mean(axes: Floats, vectors: Floats) -> Floats:
    """Return the mean of world vectors, (F, 3), in the axes of a joint, (F, 3, 3)."""
    return np.einsum("fba,fb->a", axes, vectors) / len(axes)
