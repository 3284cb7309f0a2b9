"""Inverse kinematics of legs: ankles of a moving body reach their targets, smoothly over time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from viewer.rig.arrays import Bools, Floats, Ints
from viewer.rig.cleanup.frame_rows import runs_of
from viewer.rig.cleanup.leg_ik import Leg, bend, reach
from viewer.rig.geometry.quaternion import conjugate, multiply
from viewer.rig.geometry.rotation import matrix_to_quaternion

__all__ = ["EASE", "faded", "falling", "leg_rotations", "lowering"]

EASE = 0.2
"""Seconds over which a correction begins and ends outside contacts."""


def leg_rotations(
    rotations: Floats,
    world: Floats,
    parents: Ints,
    legs: Sequence[Leg],
    drop: Floats,
    shifts: Sequence[Floats],
) -> Floats:
    """Return local rotations that bring the ankles of all legs to their targets.

    Feet keep their orientation in the world.

    Parameters
    ----------
    rotations : (N, J, 4)
        Local rotations, unit quaternions.
    world : (N, J, 4, 4)
        World matrices of the same poses.
    parents : (J,)
        -1 for a root.
    legs : sequence of Leg
        The legs, from left to right.
    drop : (N, 3)
        Translation of the whole body.
    shifts : sequence of (N, 3)
        Translation of each leg's ankle, instead of ``drop``.
    """
    result = rotations.copy()
    # Knees bend about the axis from right to left.
    across = world[:, legs[0].hip, :3, 3] - world[:, legs[-1].hip, :3, 3]
    old = matrix_to_quaternion(_unscaled(world[..., :3, :3]))
    for leg, shift in zip(legs, shifts, strict=True):
        _reach_for(result, world, old, parents, leg, drop, shift, across)
    return result


def _reach_for(
    rotations: Floats,
    world: Floats,
    old: Floats,
    parents: Ints,
    leg: Leg,
    drop: Floats,
    shift: Floats,
    across: Floats,
) -> None:
    """Rotate a leg in place so that its ankle is at its previous position plus a shift."""
    hips, knees, ankles = (world[:, j, :3, 3] + drop for j in (leg.hip, leg.knee, leg.ankle))
    moves = (shift - drop).any(axis=1)
    if not moves.any():
        return
    thigh, shin = bend(hips, knees, ankles, ankles - drop + shift, across)
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
        local = multiply(conjugate(np.broadcast_to(outer, inner.shape)), inner)
        rotations[moves, joint] = local[moves]


def _unscaled(linear: Floats) -> Floats:
    return linear / np.maximum(np.linalg.norm(linear, axis=-2, keepdims=True), 1e-30)


def lowering(
    points: Floats,
    legs: Sequence[Leg],
    shifts: Sequence[Floats],
    rate: float,
    up: Floats,
    extended: float = 1.0,
) -> Floats:
    """Return how far the body must be lowered so that all ankle targets are in reach.

    Parameters
    ----------
    points : (N, J, 3)
        World positions of the joints.
    legs : sequence of Leg
        The legs.
    shifts : sequence of (N, 3)
        Translation of each leg's ankle.
    rate : float
        Frames per second.
    up : (3,)
        The up axis.
    extended : float
        Legs extend up to this fraction of their full length, or up to their previous extension.

    Returns
    -------
    (N,)
        Distances along the up axis, smooth over time.
    """
    needed = np.zeros(len(points))
    for leg, shift in zip(legs, shifts, strict=True):
        hips, knees, ankles = (points[:, joint] for joint in (leg.hip, leg.knee, leg.ankle))
        longest = reach(hips, knees, ankles)
        old = np.linalg.norm(ankles - hips, axis=1)
        length = np.minimum(longest, np.maximum(old, extended * longest))
        away = ankles + shift - hips
        height = away @ up
        flat = np.einsum("fa,fa->f", away, away) - height**2
        depth = np.sqrt(np.maximum(length**2 - flat, 0.0))
        is_far = (np.linalg.norm(away, axis=1) > length) & shift.any(axis=1)
        needed = np.maximum(needed, np.where(is_far, -height - depth, 0.0))
    if not needed.any():
        return needed
    width = 2 * max(1, round(EASE * rate)) + 1
    padded = np.pad(needed, width - 1, mode="edge")
    highest = np.lib.stride_tricks.sliding_window_view(padded, width).max(axis=1)
    # The moving average of moving maxima is never below the values themselves.
    return np.lib.stride_tricks.sliding_window_view(highest, width).mean(axis=1)


def faded(values: Floats, is_held: Bools, present: Bools, ease: int) -> Floats:
    """Return values that fade in and out around held frames; gaps separate runs.

    Parameters
    ----------
    values : (F, C)
        Corrections in held frames.
    is_held, present : (F,)
        Masks of held frames and of existing frames.
    ease : int
        Number of frames over which a correction fades.
    """
    result = values.copy()
    for start, stop in runs_of(present):
        held = np.flatnonzero(is_held[start:stop]) + start
        if len(held) == 0:
            continue
        frames = np.arange(start, stop)
        place = np.searchsorted(held, frames, side="right")
        before, after = held[np.maximum(place - 1, 0)], held[np.minimum(place, len(held) - 1)]
        left = np.where(place > 0, frames - before, ease + 1)
        right = np.where(place < len(held), after - frames, ease + 1)
        first, second = falling(left / (ease + 1)), falling(right / (ease + 1))
        # Between two close contacts, the value blends from one to the other.
        total = np.maximum(first + second, 1.0)[:, None]
        mixed = first[:, None] * values[before] + second[:, None] * values[after]
        result[start:stop] = np.where(is_held[start:stop, None], values[start:stop], mixed / total)
    return result


def falling(x: Floats) -> Floats:
    """Return a smooth step from 1 at 0 to 0 at 1 and beyond, with slope 0 at both ends."""
    x = np.clip(x, 0.0, 1.0)
    return 1.0 - x * x * (3.0 - 2.0 * x)
