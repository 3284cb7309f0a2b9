"""Legs of people and animals: found by names or by shape, and bent until ankles reach targets."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from viewer.data_classes import dataclass
from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.feet.curves import envelope
from viewer.rigs.geometry.quaternion import between, conjugate, multiply
from viewer.rigs.geometry.rotation import matrix_to_quaternion
from viewer.rigs.geometry.vectors import unit
from viewer.rigs.retargeting.joint_names import joint_meanings
from viewer.rigs.skeleton import Skeleton

# Forward bias of the direction of the knee, relative to the leg's length: 80 mm for a person. The
# direction of a nearly straight knee is only noise.
_FORWARDS = 0.1
_REACH = 0.9999  # maximum extension relative to the leg's length: a straight knee has no direction

# Maximum extension of a corrected leg that was straighter before. A foot that is held while the
# body moves on stretches its leg until it leaves the ground: at 0.998, the knee straightened by 11
# degrees and bent again within 3 frames. At 0.99, knees bend by at least 16 degrees and accelerate
# by a quarter to a third less, and the body is lowered by another 0.3 to 0.5 % of its size. This
# limit applies from corrections on that stretch a leg by 0.2 % of its length: below, it rises by 5
# times what is missing, so that people who stand on straight legs keep them.
_STRAIGHTEST, _YIELDS = 0.99, 5.0

_EASE = 0.2  # seconds over which the body is lowered and raised

# Sine of the bend at which a leg and the direction across the body determine the axis of its knee
# equally.
_FLEXED = np.sin(np.radians(15.0))


@dataclass(frozen=True, slots=True)
class Leg:
    """Joints of one leg."""

    hip: int
    knee: int
    ankle: int
    """Indices in the skeleton."""
    toe: int
    """The ball of the foot; the ankle if there is none."""


def legs_of(skeleton: Skeleton) -> list[Leg]:
    """Return the legs of a skeleton, found by the names of its joints."""
    names = joint_meanings(skeleton)
    legs = []
    for side in ("left", "right"):
        joints = [f"{side}_{part}" for part in ("hip", "knee", "ankle")]
        if all(name in names for name in joints):
            hip, knee, ankle = (names.index(name) for name in joints)
            toe = names.index(f"{side}_foot") if f"{side}_foot" in names else ankle
            legs.append(Leg(hip, knee, ankle, toe))
    return legs


def leg_rotations(
    rotations: Floats,
    world: Floats,
    parents: Ints,
    legs: Sequence[Leg],
    drop: Floats,
    shifts: Sequence[Floats],
) -> Floats:
    """Return local rotations (N, J, 4) that bring ankles to their targets.

    Feet keep their world rotations. ``drop`` (N, 3) translates the body; ``shifts``, (N, 3) a leg,
    the ankles instead of ``drop``.
    """
    result = rotations.copy()
    across = world[:, legs[0].hip, :3, 3] - world[:, legs[-1].hip, :3, 3]
    old = matrix_to_quaternion(unscaled(world[..., :3, :3]))
    for leg, shift in zip(legs, shifts, strict=True):
        moves = (shift - drop).any(axis=1)
        if not moves.any():
            continue
        hips, knees, ankles = (world[:, j, :3, 3] + drop for j in (leg.hip, leg.knee, leg.ankle))
        axis = hinges(unscaled(world[:, leg.hip, :3, :3]), (hips, knees, ankles), across)
        thigh, shin = bend(hips, knees, ankles, ankles - drop + shift, axis)
        above = int(parents[leg.hip])
        parent = old[:, above] if above >= 0 else np.array([0.0, 0.0, 0.0, 1.0])
        new_hip = multiply(thigh, old[:, leg.hip])
        under_knee = multiply(thigh, old[:, int(parents[leg.knee])])
        under_ankle = multiply(shin, old[:, int(parents[leg.ankle])])
        for joint, outer, inner in (
            (leg.hip, parent, new_hip),
            (leg.knee, under_knee, multiply(shin, old[:, leg.knee])),
            (leg.ankle, under_ankle, old[:, leg.ankle]),
        ):
            # World rotations R = P L, so L = P^-1 R, with P the new rotation of the parent.
            local = multiply(conjugate(np.broadcast_to(outer, inner.shape)), inner)
            result[moves, joint] = local[moves]
    return result


def bend(
    hips: Floats, knees: Floats, ankles: Floats, targets: Floats, axis: Floats
) -> tuple[Floats, Floats]:
    """Return world rotations (F, 4) of thighs and shins, R' = Q R, that bring ankles to targets.

    The knee keeps its direction, or points forwards the straighter the leg is. ``axis`` (F, 3):
    unit normal of a bent leg's plane, thigh x shin. Targets out of reach are approached.
    """
    # Everything is first found for a leg that points along its old line from hip to ankle. The
    # distance to the target fixes the angle at the hip by the law of cosines, b^2 = a^2 + d^2 -
    # 2 a d cos; the knee stays on the side ahead of the line, on which it is. Then the leg as a
    # whole rotates about the hip by the smallest angle that points the line at the target.
    upper, lower = knees - hips, ankles - knees
    a, b = np.linalg.norm(upper, axis=1), np.linalg.norm(lower, axis=1)
    line = unit(ankles - hips)
    aside = upper - np.einsum("fa,fa->f", upper, line)[:, None] * line
    ahead = unit(aside + _FORWARDS * (a + b)[:, None] * np.cross(line, axis))
    distance = np.linalg.norm(targets - hips, axis=1)
    distance = np.clip(distance, np.abs(a - b) * (2.0 - _REACH), _REACH * (a + b))
    cosine = (a * a + distance * distance - b * b) / np.maximum(2.0 * a * distance, 1e-30)
    cosine = np.clip(cosine, -1.0, 1.0)[:, None]
    knee = a[:, None] * (cosine * line + np.sqrt(1.0 - cosine * cosine) * ahead)
    turn = between(line, targets - hips)
    thigh, shin = between(upper, knee), between(lower, distance[:, None] * line - knee)
    return multiply(turn, thigh), multiply(turn, shin)


def hinges(thighs: Floats, points: tuple[Floats, Floats, Floats], across: Floats) -> Floats:
    """Return a knee's axis in each frame, a unit vector fixed to the thigh (N, 3).

    ``across`` (N, 3): from right to left, the axis of a knee that hardly bends.
    """
    # The mean normal of the leg's plane in the axes of the thigh, weighted by the fourth power of
    # the sine of the bend, as a straight leg has no plane. ``across`` weighs like a bend of 15
    # degrees.
    hips, knees, ankles = points
    upper, lower = knees - hips, ankles - knees
    bones = np.linalg.norm(upper, axis=1) * np.linalg.norm(lower, axis=1)
    normals = np.cross(upper, lower) / np.maximum(bones, 1e-30)[:, None]
    sines = np.linalg.norm(normals, axis=1, keepdims=True)
    found = np.einsum("nba,nb->a", thighs, sines**3 * normals + _FLEXED**4 * unit(across))
    return thighs @ unit(found)


def unscaled(linear: Floats) -> Floats:
    """Return matrices (..., 3, 3) with columns of length 1: the rotations of scaled joints."""
    return linear / np.maximum(np.linalg.norm(linear, axis=-2, keepdims=True), 1e-30)


def reach(hips: Floats, knees: Floats, ankles: Floats) -> Floats:
    """Return the longest distance from hip to ankle in each frame: (F,) for (F, 3) each."""
    thigh = np.linalg.norm(knees - hips, axis=1)
    return _REACH * (thigh + np.linalg.norm(ankles - knees, axis=1))


def lowering(
    points: Floats,
    legs: Sequence[Leg],
    shifts: Sequence[Floats],
    rate: float,
    up: Floats,
    extended: float = 1.0,
) -> Floats:
    """Return how far along ``up`` the body must sink (N,), smoothly, to bring ankles into reach."""
    needed = np.zeros(len(points))
    for leg, shift in zip(legs, shifts, strict=True):
        hips, knees, ankles = (points[:, joint] for joint in (leg.hip, leg.knee, leg.ankle))
        longest = reach(hips, knees, ankles)
        old = np.linalg.norm(ankles - hips, axis=1)
        away = ankles + shift - hips
        distance = np.linalg.norm(away, axis=1)
        eased = np.maximum(_STRAIGHTEST * longest, old - _YIELDS * np.maximum(distance - old, 0.0))
        length = np.minimum(longest, np.maximum(np.minimum(old, eased), extended * longest))
        height = away @ up
        flat = np.einsum("fa,fa->f", away, away) - height**2
        depth = np.sqrt(np.maximum(length**2 - flat, 0.0))
        is_far = (distance > length) & shift.any(axis=1)
        needed = np.maximum(needed, np.where(is_far, -height - depth, 0.0))
    if not needed.any():
        return needed
    return envelope(needed, max(1, round(_EASE * rate)))


# Legs of animals, found from the shape of the skeleton: chains of joints down to the ground.
#
# Lengths are relative to the height of the skeleton.
_FOOT = 0.12  # maximum height of the last joint of a leg
_TOE = 0.05  # maximum height of the joint on which a foot stands
_PAW = 0.15  # maximum extent of the toes of one foot
_MIRRORED = 0.05  # maximum distance between a foot and the mirrored foot of the other side
_FEWEST = 4  # minimum number of legs


def animal_legs(parents: Ints, points: Floats, up: Floats) -> list[Leg]:
    """Return the legs of an animal with at least four, left ones first; else none.

    Hip, knee and ankle are the ends of the two long bones, without a scapula; the ankle is a hind
    leg's hock or a front leg's wrist. Chains without a counterpart, such as a tail, are left out.
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
