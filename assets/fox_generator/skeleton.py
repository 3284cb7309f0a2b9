"""The fox's joints: pivots in the standing bind pose, limits, and the pose written to the file."""

from dataclasses import dataclass

import numpy as np
from generator_tools.shapes import Floats

Limits = tuple[tuple[float, float], tuple[float, float], tuple[float, float]]


@dataclass(frozen=True, slots=True)
class Joint:
    """One ball joint.

    Parameters
    ----------
    name, parent
        Names; the root's parent is empty.
    pivot, end : (3,)
        World position in the bind pose, and end of the joint's body segment; metres.
    region
        Part of the surface that the joint may move; see `body.REGIONS`.
    limits : (3, 2)
        Range of the x, y and z DOF in radians; equal bounds lock the DOF.
    """

    name: str
    parent: str
    pivot: tuple[float, float, float]
    end: tuple[float, float, float]
    region: str
    limits: Limits


def _ball(x: float, y: float, z: float) -> Limits:
    return ((-x, x), (-y, y), (-z, z))


def _hinge(low: float, high: float) -> Limits:
    return ((low, high), (0.0, 0.0), (0.0, 0.0))


TAIL = [
    (0, 0.358, -0.222),
    (0, 0.346, -0.280),
    (0, 0.327, -0.340),
    (0, 0.308, -0.400),
    (0, 0.294, -0.460),
    (0, 0.287, -0.520),
    (0, 0.286, -0.580),
    (0, 0.305, -0.696),
]

MIDDLE = [
    Joint("pelvis", "", (0, 0.345, -0.165), (0, 0.352, -0.105), "torso", _ball(0.6, 3.1416, 0.5)),
    Joint(
        "spine_1", "pelvis", (0, 0.352, -0.105), (0, 0.350, -0.045), "torso", _ball(0.4, 0.35, 0.3)
    ),
    Joint(
        "spine_2", "spine_1", (0, 0.350, -0.045), (0, 0.346, 0.020), "torso", _ball(0.4, 0.35, 0.3)
    ),
    Joint("chest", "spine_2", (0, 0.346, 0.020), (0, 0.335, 0.120), "torso", _ball(0.4, 0.35, 0.3)),
    Joint("neck_1", "chest", (0, 0.362, 0.120), (0, 0.415, 0.170), "neck", _ball(0.6, 0.5, 0.35)),
    Joint("neck_2", "neck_1", (0, 0.415, 0.170), (0, 0.480, 0.222), "neck", _ball(0.5, 0.5, 0.35)),
    Joint("head", "neck_2", (0, 0.480, 0.222), (0, 0.480, 0.370), "head", _ball(0.7, 0.8, 0.5)),
    Joint(
        "jaw",
        "head",
        (0, 0.466, 0.272),
        (0, 0.448, 0.360),
        "jaw",
        ((-0.04, 0.6), (-0.1, 0.1), (0.0, 0.0)),
    ),
]

LEFT = [
    Joint(
        "ear_l", "head", (0.037, 0.540, 0.238), (0.051, 0.590, 0.230), "ear", _ball(0.5, 0.7, 0.4)
    ),
    Joint(
        "ear_tip_l",
        "ear_l",
        (0.051, 0.590, 0.230),
        (0.064, 0.645, 0.221),
        "ear",
        _ball(0.5, 0.3, 0.4),
    ),
    Joint(
        "scapula_l",
        "chest",
        (0.042, 0.372, 0.075),
        (0.056, 0.292, 0.125),
        "fore",
        ((-0.4, 0.4), (-0.1, 0.1), (-0.15, 0.15)),
    ),
    Joint(
        "fore_upper_l",
        "scapula_l",
        (0.056, 0.292, 0.125),
        (0.057, 0.220, 0.085),
        "fore",
        ((-1.0, 1.0), (-0.25, 0.25), (-0.25, 0.4)),
    ),
    Joint(
        "fore_lower_l",
        "fore_upper_l",
        (0.057, 0.220, 0.085),
        (0.053, 0.088, 0.100),
        "fore",
        _hinge(-1.6, 0.45),
    ),
    Joint(
        "fore_paw_l",
        "fore_lower_l",
        (0.053, 0.088, 0.100),
        (0.053, 0.026, 0.108),
        "fore",
        ((-0.6, 1.5), (-0.2, 0.2), (-0.2, 0.2)),
    ),
    Joint(
        "fore_toes_l",
        "fore_paw_l",
        (0.053, 0.022, 0.112),
        (0.053, 0.010, 0.145),
        "fore",
        _hinge(-0.8, 0.9),
    ),
    Joint(
        "hind_upper_l",
        "pelvis",
        (0.048, 0.335, -0.172),
        (0.062, 0.228, -0.130),
        "hind",
        ((-1.1, 0.9), (-0.25, 0.25), (-0.2, 0.4)),
    ),
    Joint(
        "hind_lower_l",
        "hind_upper_l",
        (0.062, 0.228, -0.130),
        (0.055, 0.122, -0.224),
        "hind",
        _hinge(-0.6, 1.3),
    ),
    Joint(
        "hind_paw_l",
        "hind_lower_l",
        (0.055, 0.122, -0.224),
        (0.054, 0.028, -0.210),
        "hind",
        ((-1.2, 0.7), (-0.15, 0.15), (-0.15, 0.15)),
    ),
    Joint(
        "hind_toes_l",
        "hind_paw_l",
        (0.054, 0.022, -0.206),
        (0.054, 0.010, -0.172),
        "hind",
        _hinge(-0.9, 0.9),
    ),
]

# The pose in the file: x, y, z in radians; joints not listed keep the modelled pose.
POSE = {
    "spine_2": (0.0, 0.05, 0.0),
    "chest": (0.0, 0.05, 0.0),
    "neck_1": (-0.06, 0.14, 0.0),
    "neck_2": (-0.04, 0.16, 0.0),
    "head": (0.06, 0.20, -0.10),
    "jaw": (-0.015, 0.0, 0.0),
    "ear_l": (0.05, 0.10, -0.05),
    "ear_r": (0.0, -0.15, 0.05),
    "tail_1": (-0.16, -0.14, 0.0),
    "tail_2": (0.02, -0.12, 0.0),
    "tail_3": (0.14, -0.10, 0.0),
    "tail_4": (0.22, -0.06, 0.0),
    "tail_5": (0.26, 0.0, 0.0),
    "tail_6": (0.26, 0.06, 0.0),
    "tail_7": (0.16, 0.10, 0.0),
    "fore_upper_r": (-0.50, 0.0, 0.0),
    "fore_lower_r": (-0.35, 0.0, 0.0),
    "fore_paw_r": (1.15, 0.0, 0.0),
    "fore_toes_r": (0.30, 0.0, 0.0),
}


def _tail() -> list[Joint]:
    limits = _ball(0.6, 0.5, 0.3)
    parents = ["pelvis", *(f"tail_{i}" for i in range(1, len(TAIL) - 1))]
    return [
        Joint(f"tail_{i + 1}", parents[i], TAIL[i], TAIL[i + 1], "tail", limits)
        for i in range(len(TAIL) - 1)
    ]


def _mirrored(joint: Joint) -> Joint:
    """Return the right counterpart of a left joint: x and the y and z DOFs change sign."""

    def across(point: tuple[float, float, float]) -> tuple[float, float, float]:
        return (-point[0], point[1], point[2])

    x, y, z = joint.limits
    parent = joint.parent[:-2] + "_r" if joint.parent.endswith("_l") else joint.parent
    return Joint(
        joint.name[:-2] + "_r",
        parent,
        across(joint.pivot),
        across(joint.end),
        joint.region,
        (x, (0.0 - y[1], 0.0 - y[0]), (0.0 - z[1], 0.0 - z[0])),
    )


def joints() -> list[Joint]:
    """Return all joints depth-first, as numbered in .skel files."""
    everything = [*MIDDLE, *_tail(), *LEFT, *map(_mirrored, LEFT)]
    ordered = [everything[0]]

    def visit(parent: Joint) -> None:
        for child in (joint for joint in everything if joint.parent == parent.name):
            ordered.append(child)
            visit(child)

    visit(everything[0])
    return ordered


def segments(table: list[Joint]) -> tuple[Floats, Floats]:
    """Return the starts (J, 3) and ends (J, 3) of the joints' body segments."""
    return np.array([j.pivot for j in table], float), np.array([j.end for j in table], float)
