"""Analytic inverse kinematics of legs: hip and knee rotate until the ankle is at its target."""

from __future__ import annotations

import numpy as np

from viewer.data_classes import dataclass
from viewer.rig.arrays import Floats
from viewer.rig.cleanup.easing import falling
from viewer.rig.geometry.quaternion import multiply, rotation_vector_to_quaternion

__all__ = ["Leg", "bend", "reach"]

# Sines of the knee's bend below which a leg bends about the axis of its knee, and above which it
# stays in its own plane. The plane of a nearly straight leg is noise.
_PLANE = (np.sin(np.radians(5.0)), np.sin(np.radians(25.0)))
_REACH = 0.9999  # maximum extension relative to the leg's length: a straight knee has no direction


@dataclass(frozen=True, slots=True)
class Leg:
    """Joints of one leg.

    Attributes
    ----------
    hip, knee, ankle : int
        Indices in the skeleton.
    toe : int
        The ball of the foot; the ankle if there is none.
    """

    hip: int
    knee: int
    ankle: int
    toe: int


def reach(hips: Floats, knees: Floats, ankles: Floats) -> Floats:
    """Return the longest distance from hip to ankle in each frame: (F,) for (F, 3) each."""
    thigh = np.linalg.norm(knees - hips, axis=1)
    return _REACH * (thigh + np.linalg.norm(ankles - knees, axis=1))


def bend(
    hips: Floats, knees: Floats, ankles: Floats, targets: Floats, axis: Floats
) -> tuple[Floats, Floats]:
    """Return the rotations of thigh and shin that bring the ankle to a target.

    The shin rotates about the normal of the leg's plane until the distance from hip to ankle equals
    the target's (law of cosines). Then the whole leg rotates about the hip by the smallest angle
    that points it at the target, so the knee keeps its direction. Legs that are nearly straight, or
    bent the wrong way, bend about the axis of their knee instead.

    Parameters
    ----------
    hips, knees, ankles : (F, 3)
        Positions.
    targets : (F, 3)
        Targets of the ankle; those out of reach are approached as closely as possible.
    axis : (F, 3)
        Unit vectors along the axis of the knee: the normal of a bent leg's plane, thigh x shin.

    Returns
    -------
    thigh, shin : (F, 4)
        Unit quaternions in the space of the positions: R' = Q R.
    """
    upper, lower = hips - knees, ankles - knees
    a, b = np.linalg.norm(upper, axis=1), np.linalg.norm(lower, axis=1)
    normal = _normals(upper, lower, -axis, np.maximum(a * b, 1e-30))
    distance = np.linalg.norm(targets - hips, axis=1)
    distance = np.clip(distance, np.abs(a - b) * (2.0 - _REACH), _REACH * (a + b))
    # u . R(n, x) v = c + m cos(x + x0), where c is the product of the components along the axis n.
    along = _dot(upper, normal) * _dot(lower, normal)
    across, sine = _dot(upper, lower) - along, _dot(np.cross(upper, lower), normal)
    wanted = 0.5 * (a * a + b * b - distance * distance) - along
    new = _angle(wanted / np.maximum(np.hypot(across, sine), 1e-30))
    old = np.arctan2(sine, across)
    knee = rotation_vector_to_quaternion((new - old)[:, None] * normal)
    bent = _rotated(knee, lower) - upper  # from the hip to the ankle
    turn = _between(bent, targets - hips)
    return turn, multiply(turn, knee)


def _normals(upper: Floats, lower: Floats, hinge: Floats, product: Floats) -> Floats:
    """Return the axes about which legs bend: (F, 3)."""
    normal = np.cross(upper, lower)
    found = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    sine = _dot(normal, hinge) / product
    own = 1.0 - falling((sine - _PLANE[0]) / (_PLANE[1] - _PLANE[0]))
    mixed = hinge + own[:, None] * (found - hinge)
    return mixed / np.linalg.norm(mixed, axis=1, keepdims=True)


def _dot(a: Floats, b: Floats) -> Floats:
    return np.einsum("fa,fa->f", a, b)


def _angle(cosine: Floats) -> Floats:
    return np.arccos(np.clip(cosine, -1.0, 1.0))


def _rotated(quaternions: Floats, vectors: Floats) -> Floats:
    """Return v + 2 w (u x v) + 2 u x (u x v) for quaternions (u, w)."""
    axis, real = quaternions[:, :3], quaternions[:, 3:]
    across = np.cross(axis, vectors)
    return vectors + 2.0 * (real * across + np.cross(axis, across))


def _between(start: Floats, end: Floats) -> Floats:
    """Return the smallest rotations from one direction to another: (F, 4)."""
    a = start / np.maximum(np.linalg.norm(start, axis=1, keepdims=True), 1e-30)
    b = end / np.maximum(np.linalg.norm(end, axis=1, keepdims=True), 1e-30)
    real = 1.0 + np.einsum("fa,fa->f", a, b)
    found = np.concatenate([np.cross(a, b), real[:, None]], axis=1)
    return found / np.maximum(np.linalg.norm(found, axis=1, keepdims=True), 1e-30)
