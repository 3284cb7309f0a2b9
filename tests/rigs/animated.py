"""Figures with keyed transforms, and a plain evaluator of glTF's interpolation, key by key."""

import math
from dataclasses import replace

import numpy as np

from viewer.rigs.blendshapes import BlendShapes
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.transform import translation_matrix
from viewer.rigs.mesh import Mesh
from viewer.rigs.motion.transform_clip import Animation, TransformChannel, TransformClip
from viewer.rigs.skeleton import ball_skeleton
from viewer.rigs.skin import skin_from_lists

NAMES = ("hip", "knee", "foot")
STACKED = np.array([[0.0, 0, 0], [0, 1, 0], [0, 2, 0]])
HALF = math.sqrt(0.5)


def about(axis: int, degrees: float) -> list[float]:
    """Return the quaternion (x, y, z, w) of a rotation about a coordinate axis."""
    quaternion = [0.0, 0.0, 0.0, math.cos(math.radians(degrees) / 2)]
    quaternion[axis] = math.sin(math.radians(degrees) / 2)
    return quaternion


def channel(joint: int, path: str, times, values, interpolation: str = "linear", tangents=None):
    """Return a channel; weights animate shapes 0, 1, …"""
    values = np.asarray(values, dtype=float)
    shapes = np.arange(values.shape[1]) if path == "weights" else None
    return TransformChannel(
        -1 if path == "weights" else joint, path, times, values, interpolation, tangents, shapes
    )


def clip_of(*channels: TransformChannel, name: str = "wave", end: float | None = None):
    """Return a clip that spans the first to the last key."""
    ends = [time for one in channels for time in one.times[[0, -1]]]
    return TransformClip(name, channels, min(ends), max(ends) if end is None else end)


def leg(**parts) -> Figure:
    """Return a leg of three joints stacked a unit apart, with two triangles and two blend shapes.

    The knee is rotated at rest by 90 degrees about x; the foot is mirrored and enlarged.
    """
    positions = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 2, 0], [1, 2, 0]])
    plain = ball_skeleton(NAMES, np.array([-1, 0, 1]), STACKED)
    rest = replace(
        plain,
        rest_rotations=[about(0, 0.0), about(0, 90.0), about(0, 0.0)],
        rest_scales=[[1.0, 1, 1], [1, 1, 1], [-2, 2, 2]],
    )
    shapes = np.zeros((2, 6, 3))
    shapes[0, 4:, 1], shapes[1, 1::2, 0] = 1.0, 0.5
    return Figure(
        parts.pop("name", "leg"),
        Mesh(positions, np.tile([0.0, 0, 1], (6, 1)), np.array([[0, 1, 2], [3, 5, 4]])),
        rest,
        skin_from_lists([[(row // 2, 1.0)] for row in range(6)], translation_matrix(-STACKED)),
        blend_shapes=BlendShapes(("rise", "widen"), shapes),
        unit="m",
        **parts,
    )


def wave() -> TransformClip:
    """Return a clip with all paths and interpolations, in which channels end at different times."""
    slopes = np.zeros((3, 2, 3))
    slopes[1] = [[1.0, 0, 0], [0, 2, 0]]
    return clip_of(
        channel(0, "translation", [0.5, 1.0, 2.0], [[0.0, 0, 0], [1, 0, 0], [1, 2, 0]], "cubic",
                slopes),
        channel(0, "rotation", [0.5, 1.5], [about(2, 0.0), about(2, 90.0)]),
        channel(1, "rotation", [0.5, 1.0], [about(0, 90.0), about(0, 30.0)], "step"),
        channel(1, "scale", [0.5, 2.5], [[1.0, 1, 1], [1, 3, -1]]),
        channel(-1, "weights", [0.5, 1.5], [[0.0, 0.5], [1.0, 0.5]]),
    )  # fmt: skip


def bow() -> TransformClip:
    """Return a shorter clip that only rotates the foot, with keys at 24 frames per second."""
    times = np.array([0.0, 1, 5]) / 24.0
    return clip_of(channel(2, "rotation", times, [about(1, a) for a in (0, 10, -50)]), name="bow")


def animated_leg(*clips: TransformClip) -> Figure:
    """Return the leg with animations; by default two, ``wave`` and ``bow``."""
    chosen = clips or (wave(), bow())
    return leg(animations=tuple(map(animation, chosen)))


def animation(clip: TransformClip) -> Animation:
    """Return a clip as an animation that is read when it is first used."""
    return Animation(clip.name, clip.start, clip.end, lambda: clip)


def plain_value(one: TransformChannel, time: float) -> np.ndarray:
    """Return a channel's value by the formulas of glTF 2.0, appendix C."""
    times = one.times.tolist()
    if time <= times[0] or len(times) == 1:
        return _unit(one, one.values[0])
    if time >= times[-1]:
        return _unit(one, one.values[-1])
    k = max(key for key, at in enumerate(times) if at <= time)
    span = times[k + 1] - times[k]
    t = (time - times[k]) / span
    if one.interpolation == "step":
        return _unit(one, one.values[k])
    if one.interpolation == "cubic":
        a, b = one.tangents[k + 1, 0], one.tangents[k, 1]
        value = (
            (2 * t**3 - 3 * t**2 + 1) * one.values[k]
            + span * (t**3 - 2 * t**2 + t) * b
            + (-2 * t**3 + 3 * t**2) * one.values[k + 1]
            + span * (t**3 - t**2) * a
        )
        return _unit(one, value)
    if one.path != "rotation":
        return (1 - t) * one.values[k] + t * one.values[k + 1]
    return _slerp(_unit(one, one.values[k]), _unit(one, one.values[k + 1]), t)


def _unit(one: TransformChannel, value: np.ndarray) -> np.ndarray:
    return value / np.linalg.norm(value) if one.path == "rotation" else value


def _slerp(start: np.ndarray, end: np.ndarray, t: float) -> np.ndarray:
    d = float(start @ end)
    angle = math.acos(min(abs(d), 1.0))
    if angle < 1e-6:
        return start
    sign = -1.0 if d < 0 else 1.0
    return (
        math.sin(angle * (1 - t)) / math.sin(angle) * start
        + sign * math.sin(angle * t) / math.sin(angle) * end
    )
