"""Legs of animals, found from the shape of the skeleton: chains of joints down to the ground."""

from __future__ import annotations

import numpy as np

from viewer.rig.arrays import Bools, Floats, Ints
from viewer.rig.cleanup.leg_ik import Leg

# Lengths are relative to the height of the skeleton.
_FOOT = 0.12  # maximum height of the last joint of a leg
_TOE = 0.05  # maximum height of the joint on which a foot stands
_PAW = 0.15  # maximum extent of the toes of one foot
_MIRRORED = 0.05  # maximum distance between a foot and the mirrored foot of the other side
_FEWEST = 4  # minimum number of legs


def animal_legs(parents: Ints, points: Floats, up: Floats) -> list[Leg]:
    """Return the legs of an animal with at least four legs, left ones first.

    ``parents``: (J,), -1 for a root. ``points``: (J, 3), positions of the joints of a standing
    animal. ``up``: (3,), the up axis. Returns hip, knee and ankle are the two long bones of a leg,
    without a scapula. The ankle is the hock of a hind leg and the wrist of a front leg. Chains
    without a counterpart on the other side, such as a tail, are omitted. Empty if there are fewer
    than four legs.
    """
    heights = points @ up - (points @ up).min()
    size = float(heights.max())
    if size <= 0.0:
        return []
    heights /= size
    flat = (points - (points @ up)[:, None] * up) / size
    inner = np.zeros(len(parents), dtype=np.bool_)
    inner[parents[parents >= 0]] = True
    is_foot = ~inner & (heights < _FOOT)
    in_leg = _in_one_leg(parents, flat, is_foot)
    chains = [
        _path(int(joint), parents, in_leg, is_foot)
        for joint in np.flatnonzero(in_leg)
        if parents[joint] >= 0 and not in_leg[parents[joint]]
    ]
    legs = [_leg(chain, points, heights) for chain in chains]
    return _paired([leg for leg in legs if leg is not None], flat, up)


def _in_one_leg(parents: Ints, flat: Floats, is_foot: Bools) -> Bools:
    """Return the joints whose chains all end in toes of the same foot: (J,)."""
    low = np.where(is_foot[:, None], flat, np.inf)
    high = np.where(is_foot[:, None], flat, -np.inf)
    for joint in range(len(parents) - 1, -1, -1):
        if parents[joint] >= 0:
            low[parents[joint]] = np.minimum(low[parents[joint]], low[joint])
            high[parents[joint]] = np.maximum(high[parents[joint]], high[joint])
    has_foot = np.isfinite(low[:, 0])
    extent = np.where(has_foot[:, None], high - np.where(has_foot[:, None], low, 0.0), 0.0)
    return has_foot & (np.linalg.norm(extent, axis=1) < _PAW)


def _path(joint: int, parents: Ints, in_leg: Bools, is_foot: Bools) -> list[int]:
    """Return the joints from the top of a leg to the base of its toes."""
    path = [joint]
    while not is_foot[path[-1]]:
        children = np.flatnonzero((parents == path[-1]) & in_leg)
        path.append(int(children[0]))
    return path


def _leg(path: list[int], points: Floats, heights: Floats) -> Leg | None:
    """Return the leg of a chain of joints; None if it is too short."""
    stands = next((n for n, joint in enumerate(path) if heights[joint] < _TOE), len(path) - 1)
    if stands < 2:
        return None
    # A chain with three bones above the foot begins with a scapula or one side of the pelvis.
    first = 1 if stands >= 4 else 0
    last = max(stands - 3, 0)
    bones = np.linalg.norm(np.diff(points[path], axis=0), axis=1)
    hip = max(range(first, max(last, first) + 1), key=lambda n: float(bones[n] + bones[n + 1]))
    return Leg(path[hip], path[hip + 1], path[hip + 2], path[stands])


def _paired(legs: list[Leg], flat: Floats, up: Floats) -> list[Leg]:
    """Return the legs that have a counterpart on the other side, left before right."""
    if len(legs) < _FEWEST:
        return []
    feet = flat[[leg.toe for leg in legs]]
    for side in np.eye(3)[np.abs(up) < 0.5]:
        across = feet @ side
        middle = 0.5 * (across.min() + across.max())
        mirrored = feet - 2.0 * (across - middle)[:, None] * side
        away = np.linalg.norm(mirrored[:, None] - feet, axis=2)
        np.fill_diagonal(away, np.inf)
        chosen = [int(n) for n in np.argsort(-across) if away[n].min() < _MIRRORED]
        if len(chosen) >= _FEWEST:
            return [legs[n] for n in chosen]
    return []
