"""Anatomy of the joints: ranges, bones, and muscles that bulge."""

from dataclasses import dataclass

import numpy as np
from generator_tools.shapes import Floats

Triple = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Bulge:
    """Displacement of the skin around a point when a joint bends, in metres, at a 90 degree bend.

    It grows with 1 - cos of the angle if the bend about ``about`` is positive; otherwise it is 0.
    """

    place: Triple
    radii: Triple
    push: Triple
    about: Triple


@dataclass(frozen=True, slots=True)
class Bend:
    """Range of one joint, and the bones around it.

    Parameters
    ----------
    low, high : (3,)
        Limits of the axis-angle components in degrees, left side.
    chain : (S,)
        Joints whose polyline is the bone; the distance of the skin from it is preserved.
    above, below : (3,)
        Offsets from the joint to the flesh on either side of it, at rest.
    reach : float
        Radius in metres around the joint within which the skin is corrected.
    fold : (2,)
        On the inner side of the bend: fraction of the distance to the bone that is preserved, and
        strength with which flesh stays on its side of the bend.
    smooth : float
        Amount of smoothing of the bend.
    """

    low: Triple
    high: Triple
    chain: tuple[str, ...]
    above: Triple
    below: Triple
    reach: float
    fold: tuple[float, float] = (1.0, 1.0)
    smooth: float = 0.15
    bulges: tuple[Bulge, ...] = ()


UP, DOWN, OUT, IN = (0, 1, 0), (0, -1, 0), (1, 0, 0), (-1, 0, 0)
BENDS = {
    "hip": Bend(
        (-115, -35, -25),
        (25, 40, 55),
        ("spine1", "pelvis", "hip", "knee"),
        UP,
        DOWN,
        0.24,
        (0.0, 0.4),
        0.4,
        (Bulge((0.085, 0.845, -0.110), (0.080, 0.060, 0.060), (0.0, -0.002, -0.012), (-1, 0, 0)),),
    ),
    "spine1": Bend((-20, -25, -20), (35, 25, 20), ("pelvis", "spine1", "spine2"), DOWN, UP, 0.20),
    "spine2": Bend((-20, -25, -18), (30, 25, 18), ("spine1", "spine2", "spine3"), DOWN, UP, 0.20),
    "spine3": Bend((-18, -20, -15), (25, 20, 15), ("spine2", "spine3", "neck"), DOWN, UP, 0.20),
    "knee": Bend(
        (0, -10, -5),
        (135, 10, 5),
        ("hip", "knee", "ankle"),
        UP,
        DOWN,
        0.17,
        (0.5, 0.5),
        0.25,
        (
            Bulge((0.099, 0.515, 0.048), (0.040, 0.045, 0.035), (0.0, 0.0, 0.002), (1, 0, 0)),
            Bulge((0.104, 0.350, -0.060), (0.055, 0.070, 0.040), (0.0, 0.0, -0.002), (1, 0, 0)),
        ),
    ),
    "ankle": Bend((-25, -20, -20), (45, 20, 20), ("knee", "ankle", "foot"), UP, (0, 0, 1), 0.10),
    "foot": Bend((-50, -5, -5), (20, 5, 5), ("ankle", "foot"), (0, 0, -1), (0, 0, 1), 0.07),
    "neck": Bend((-35, -40, -30), (35, 40, 30), ("spine3", "neck", "head"), DOWN, UP, 0.13),
    "head": Bend((-35, -45, -25), (30, 45, 25), ("neck", "head"), DOWN, UP, 0.12),
    "collar": Bend((-10, -25, -15), (10, 20, 30), ("collar", "shoulder"), IN, OUT, 0.20),
    "shoulder": Bend(
        (-80, -95, -80),
        (80, 40, 75),
        ("collar", "shoulder", "elbow"),
        IN,
        OUT,
        0.17,
        (0.15, 0.0),
        0.3,
        (
            Bulge((0.190, 1.410, -0.024), (0.045, 0.035, 0.045), (0.0, 0.003, 0.0), (0, 0, -1)),
            Bulge((0.145, 1.315, 0.040), (0.040, 0.040, 0.040), (0.006, 0.0, 0.012), (0, 0, -1)),
            Bulge((0.155, 1.310, -0.080), (0.040, 0.045, 0.040), (0.006, 0.0, -0.008), (0, 0, -1)),
        ),
    ),
    "elbow": Bend(
        (-40, -140, -10),
        (40, 5, 10),
        ("shoulder", "elbow", "wrist"),
        IN,
        OUT,
        0.14,
        (1.0, 1.0),
        0.15,
        (
            Bulge((0.320, 1.375, 0.015), (0.050, 0.035, 0.030), (0.0, 0.001, 0.007), (0, -1, 0)),
            Bulge((0.450, 1.370, -0.060), (0.025, 0.025, 0.020), (0.0, 0.0, -0.004), (0, -1, 0)),
        ),
    ),
    "wrist": Bend((-80, -25, -75), (80, 30, 70), ("elbow", "wrist", "hand"), IN, OUT, 0.075),
    "hand": Bend((-5, -10, -60), (5, 10, 35), ("wrist", "hand"), IN, OUT, 0.06),
}


def bend_of(name: str) -> Bend | None:
    """Return the bend of a left or middle joint."""
    side, _, kind = name.rpartition("_")
    return BENDS.get(kind if side else name)


def samples(bend: Bend, count: int, seed: int) -> Floats:
    """Return axis-angle vectors (N, 3) in radians: about single axes, then random combinations."""
    low, high = np.asarray(bend.low, float), np.asarray(bend.high, float)
    rows = []
    for axis in range(3):
        for part in (0.25, 0.5, 0.75, 1.0):
            for limit in (low, high):
                row = np.zeros(3)
                row[axis] = part * limit[axis]
                rows.append(row)
    spread = np.random.default_rng(seed).uniform(0, 1, (count, 3))
    # Full bends about all axes at once are implausible: samples stay inside the unit ball after
    # division by the limits.
    mixed = np.where(spread < 0.5, (1 - 2 * spread) * low, (2 * spread - 1) * high)
    unit = mixed / np.maximum(np.where(mixed < 0, -low, high), 1)
    mixed /= np.maximum(np.linalg.norm(unit, axis=1, keepdims=True), 1)
    return np.radians(np.concatenate([np.array(rows), mixed]))
