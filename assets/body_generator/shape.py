"""Shape directions: the effect of one standard deviation of a measurement on the figure.

A direction stretches bones, which moves everything attached to them, and swells soft tissue.
Stretches are blended by the skin weights, so they are equally smooth.
"""

from dataclasses import dataclass, field

import numpy as np
from generator_tools.shapes import Floats

from .joints import CENTRES, NAMES, PARENTS

Triple = tuple[float, float, float]
MIDDLE = (0.0, 1.19, 0.0)  # fixed point of a growing figure, metres


@dataclass(frozen=True, slots=True)
class Swell:
    """Displacement of the skin around a point, metres per deviation, zero beyond three radii."""

    place: Triple
    radii: Triple
    push: Triple

    def __call__(self, points: Floats) -> Floats:
        """Return displacements (N, 3) of the left side's points."""
        far = np.sum(((points - self.place) / self.radii) ** 2, axis=1)
        return np.exp(-far)[:, None] * np.asarray(self.push)


@dataclass(frozen=True, slots=True)
class Direction:
    """One shape direction: relative stretch along x, y, z per joint, and swellings."""

    name: str
    stretch: dict[str, Triple]
    swells: tuple[Swell, ...] = field(default=())


DIRECTIONS = (
    Direction(
        "stature",
        {
            "pelvis": (0.048, 0.052, 0.046),
            "spine1": (0.046, 0.053, 0.046),
            "spine2": (0.046, 0.053, 0.046),
            "spine3": (0.046, 0.053, 0.046),
            "neck": (0.036, 0.050, 0.036),
            "head": (0.030, 0.034, 0.030),
            "hip": (0.045, 0.056, 0.045),
            "knee": (0.043, 0.056, 0.043),
            "ankle": (0.045, 0.050, 0.050),
            "foot": (0.045, 0.045, 0.050),
            "collar": (0.050, 0.045, 0.045),
            "shoulder": (0.055, 0.043, 0.043),
            "elbow": (0.055, 0.043, 0.043),
            "wrist": (0.050, 0.045, 0.045),
            "hand": (0.050, 0.045, 0.045),
        },
    ),
    Direction(
        "mass",
        {
            "pelvis": (0.088, 0.0, 0.094),
            "spine1": (0.097, 0.0, 0.116),
            "spine2": (0.088, 0.0, 0.110),
            "spine3": (0.064, 0.0, 0.082),
            "neck": (0.055, 0.0, 0.055),
            "head": (0.012, 0.0, 0.008),
            "hip": (0.099, 0.0, 0.099),
            "knee": (0.067, 0.0, 0.067),
            "ankle": (0.020, 0.006, 0.006),
            "collar": (0.012, 0.030, 0.050),
            "shoulder": (0.0, 0.104, 0.104),
            "elbow": (0.0, 0.067, 0.067),
            "wrist": (0.0, 0.035, 0.020),
            "hand": (0.0, 0.025, 0.015),
        },
        (
            Swell((0.0, 1.030, 0.110), (0.120, 0.110, 0.090), (0.0, -0.002, 0.011)),
            Swell((0.140, 1.030, 0.0), (0.060, 0.090, 0.090), (0.004, 0.0, 0.0)),
            Swell((0.080, 0.870, -0.125), (0.080, 0.080, 0.070), (0.001, 0.0, -0.005)),
            Swell((0.075, 1.225, 0.105), (0.060, 0.060, 0.060), (0.0, -0.002, 0.004)),
            Swell((0.050, 1.525, 0.050), (0.030, 0.035, 0.040), (0.0018, 0.0, 0.0008)),
            Swell((0.0, 1.472, 0.060), (0.035, 0.025, 0.035), (0.0, -0.0030, 0.0010)),
        ),
    ),
    Direction(
        "muscle",
        {
            "spine1": (-0.020, 0.0, -0.026),
            "spine2": (0.012, 0.0, 0.0),
            "spine3": (0.040, 0.0, 0.025),
            "neck": (0.045, 0.0, 0.040),
            "hip": (0.022, 0.0, 0.022),
            "knee": (0.028, 0.0, 0.030),
            "collar": (0.030, 0.035, 0.030),
            "shoulder": (0.0, 0.065, 0.065),
            "elbow": (0.0, 0.045, 0.045),
            "wrist": (0.0, 0.020, 0.012),
        },
        (
            Swell((0.085, 1.270, 0.095), (0.060, 0.045, 0.050), (0.001, 0.002, 0.005)),
            Swell((0.130, 1.220, -0.070), (0.045, 0.090, 0.060), (0.004, 0.0, -0.001)),
            Swell((0.070, 1.420, -0.045), (0.050, 0.040, 0.040), (0.0, 0.004, 0.0)),
            Swell((0.220, 1.410, -0.025), (0.060, 0.040, 0.050), (0.0, 0.003, 0.0)),
            Swell((0.330, 1.372, 0.020), (0.060, 0.040, 0.030), (0.0, 0.0, 0.003)),
            Swell((0.098, 0.660, 0.080), (0.060, 0.110, 0.040), (0.0, 0.0, 0.004)),
            Swell((0.105, 0.340, -0.075), (0.050, 0.080, 0.040), (0.0, 0.0, -0.003)),
            Swell((0.0, 1.010, 0.110), (0.120, 0.080, 0.060), (0.0, 0.0, -0.004)),
        ),
    ),
    Direction(
        "hip width",
        {"pelvis": (0.060, 0.0, 0.012), "hip": (0.018, 0.0, 0.010), "spine1": (0.006, 0.0, 0.0)},
        (
            Swell((0.175, 0.880, -0.010), (0.060, 0.110, 0.100), (0.004, 0.0, 0.0)),
            Swell((0.090, 0.860, -0.120), (0.070, 0.070, 0.060), (0.002, 0.0, -0.003)),
        ),
    ),
    Direction(
        "shoulder width",
        {"collar": (0.058, 0.0, 0.008), "spine3": (0.030, 0.0, 0.010), "spine2": (0.012, 0.0, 0.0)},
    ),
    Direction(
        "leg length",
        {
            "hip": (0.0, 0.031, 0.0),
            "knee": (0.0, 0.034, 0.0),
            "spine1": (0.0, -0.050, 0.0),
            "spine2": (0.0, -0.050, 0.0),
            "spine3": (0.0, -0.045, 0.0),
            "pelvis": (0.0, -0.020, 0.0),
        },
    ),
    Direction(
        "arm length",
        {
            "shoulder": (0.040, 0.0, 0.0),
            "elbow": (0.045, 0.0, 0.0),
            "wrist": (0.022, 0.006, 0.006),
            "hand": (0.022, 0.006, 0.006),
        },
    ),
    Direction(
        "belly",
        {"spine1": (0.010, 0.0, 0.0), "pelvis": (0.004, 0.0, 0.0)},
        (
            Swell((0.0, 1.030, 0.110), (0.130, 0.105, 0.100), (0.0, -0.002, 0.014)),
            Swell((0.140, 1.040, 0.010), (0.060, 0.080, 0.090), (0.005, 0.0, 0.001)),
        ),
    ),
    Direction(
        "bust",
        {"spine3": (0.004, 0.0, 0.008)},
        (Swell((0.072, 1.228, 0.115), (0.052, 0.052, 0.060), (0.0012, -0.0030, 0.0085)),),
    ),
    Direction(
        "head size",
        {"head": (0.030, 0.030, 0.030), "neck": (0.028, 0.006, 0.026)},
    ),
)


def _stretches(direction: Direction) -> Floats:
    """Return the stretch (J, 3) in each joint's frame."""
    rows = np.zeros((len(NAMES), 3))
    for j, name in enumerate(NAMES):
        side, _, kind = name.rpartition("_")
        rows[j] = direction.stretch.get(kind if side else name, (0, 0, 0))
    return rows


def _centre_moves(stretches: Floats) -> Floats:
    """Return the displacements (J, 3) of the centres: the root grows from `MIDDLE`."""
    moves = np.empty_like(CENTRES)
    for j, parent in enumerate(PARENTS):
        if parent < 0:
            moves[j] = stretches[j] * (CENTRES[j] - MIDDLE)
        else:
            moves[j] = moves[parent] + stretches[parent] * (CENTRES[j] - CENTRES[parent])
    return moves


def shape_directions(vertices: Floats, weights: Floats) -> tuple[Floats, Floats]:
    """Return the directions of the vertices (V, 3, S) and of the joints' centres (24, 3, S)."""
    sign = np.where(vertices[:, :1] < 0, [[-1, 1, 1]], 1)
    onto_left = vertices * sign
    skin, bones = [], []
    for direction in DIRECTIONS:
        stretches = _stretches(direction)
        moves = _centre_moves(stretches)
        moved = weights @ (moves - stretches * CENTRES) + (weights @ stretches) * vertices
        for swell in direction.swells:
            moved += sign * swell(onto_left)
        moved[vertices[:, 0] == 0, 0] = 0
        skin.append(moved)
        bones.append(moves)
    return np.stack(skin, axis=-1), np.stack(bones, axis=-1)
