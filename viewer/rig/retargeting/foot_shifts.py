"""Translations of the feet and the body of a moving figure that keep standing feet in place."""

from __future__ import annotations

import numpy as np

from viewer.data_classes import dataclass
from viewer.rig.arrays import Bools, Floats
from viewer.rig.cleanup.leg_solving import faded, falling
from viewer.rig.retargeting.foot_plan import FootPlan

__all__ = ["foot_shifts"]

_EASE = 0.3  # seconds over which a correction fades in and out outside contacts
_SWAY = 0.15  # seconds over which the shifts of the feet are averaged, twice
_FLIGHT = 0.05  # weight of the default translation relative to that of a standing foot
_STRAIGHT = (0.8, 0.95)  # relative lengths below which a leg is bent and above which it is straight
# Cosines of the angle between sole and ground: a foot that is tilted further may sink.
_ON_SIDE = (-0.1, 0.1)


@dataclass(frozen=True, slots=True, eq=False)
class _Wanted:
    """Corrections of one foot during its contacts."""

    flat: Floats  # (N, 3), horizontal
    is_flat: Bools  # (N,), rows with horizontal corrections
    rise: Floats  # (N,)
    holds: Floats  # (N,), degree to which the sole is held on the ground, 0 to 1
    lifts: Floats  # (N,), degree to which the sole is kept above the floor, 0 to 1
    above: Floats  # (N,), height of the sole above the floor


def foot_shifts(
    plan: FootPlan,
    points: list[tuple[Floats, Floats]],
    heights: Floats,
    facing: Floats,
    straight: Floats,
) -> tuple[list[Floats], Floats]:
    """Return the translations of all feet and of the body.

    A foot is corrected while it is on the ground. The body smoothly follows planted feet on
    straight legs, so that these need not bend; other feet follow the body.

    Parameters
    ----------
    plan : FootPlan
        Positions and times at which the feet must be planted, with at least one contact.
    points : list of ((N, 3), (N, 3))
        Paths of the balls and the heels.
    heights : (N, L)
        Heights of the soles.
    facing : (N, L)
        Cosine of the angle between each sole and the ground.
    straight : (N, L)
        Length of each leg from hip to ankle, as a fraction of its longest.

    Returns
    -------
    shifts : list of (N, 3)
        Translations of the feet.
    sway : (N, 3)
        Translations of the body.
    """
    holds = plan.holds(facing)
    every = [
        _wanted(plan, foot, points[foot], heights[:, foot], (holds[:, foot], facing[:, foot]))
        for foot in range(len(points))
    ]
    bent = falling((straight - _STRAIGHT[0]) / (_STRAIGHT[1] - _STRAIGHT[0]))
    rises = np.concatenate(
        [each.rise[(each.holds >= 1.0) & (bent[:, foot] < 0.5)] for foot, each in enumerate(every)]
    )
    usual = float(np.median(rises)) if len(rises) else 0.0
    still = np.tile(usual * plan.up, (len(heights), 1))
    sway = _sway(plan, [_shift(plan, each, still) for each in every], 1.0 - bent, still)
    return [_shift(plan, each, sway) for each in every], sway


def _wanted(
    plan: FootPlan,
    foot: int,
    points: tuple[Floats, Floats],
    heights: Floats,
    weights: tuple[Floats, Floats],
) -> _Wanted:
    """Return the corrections of a foot.

    ``weights`` are the degrees to which it is held and faces the ground. Where a contact begins and
    ends, the foot follows that of the source.
    """
    path, (holds, facing) = plan.feet[foot], weights
    flat, rise = np.zeros_like(points[0]), np.zeros(len(heights))
    is_flat = np.zeros(len(heights), dtype=np.bool_)
    low = path.lowest(plan.up)
    for contact, rows, ground in plan.stances(foot):
        loose = 1.0 - contact.hold
        wanted = loose[:, None] * plan.steps((path.toe, path.heel), contact)
        steps = np.cumsum(plan.steps(points, contact) - wanted, axis=0)
        flat[rows], is_flat[rows] = steps.mean(axis=0) - steps, True
        rise[rows] = ground + loose * (low[rows] - contact.height) - heights[rows]
    if not is_flat.any():
        return _Wanted(flat, is_flat, rise, holds, np.zeros_like(rise), np.zeros_like(rise))
    lifts = falling((_ON_SIDE[1] - facing) / (_ON_SIDE[1] - _ON_SIDE[0]))
    return _Wanted(flat, is_flat, rise, holds, lifts, heights - plan.floor(foot))


def _shift(plan: FootPlan, wanted: _Wanted, base: Floats) -> Floats:
    """Return the translation of a foot, which approaches ``base`` away from contacts: (N, 3)."""
    up, stands = plan.up, wanted.holds >= 1.0
    rise = base @ up
    flat = base - rise[:, None] * up
    away = np.where(wanted.is_flat[:, None], wanted.flat - flat, 0.0)
    held = np.where(wanted.holds > 0.0, wanted.rise - rise, 0.0)
    eased = _eased(plan, held[:, None], stands)[:, 0]
    rise = rise + eased + wanted.holds * (held - eased)
    sunk = np.maximum(-wanted.above - rise, 0.0)
    rise = rise + np.where(stands, 0.0, wanted.lifts * sunk)
    return flat + _eased(plan, away, wanted.is_flat) + rise[:, None] * up


def _eased(plan: FootPlan, values: Floats, is_held: Bools) -> Floats:
    """Return corrections (N, C) that fade out outside the held rows."""
    result, ease = np.zeros_like(values), max(1, round(_EASE * plan.rate))
    for start, stop in plan.spans:
        part = slice(start, stop)
        there = np.ones(stop - start, dtype=np.bool_)
        result[part] = faded(values[part], is_held[part], there, ease)
    return result


def _sway(plan: FootPlan, shifts: list[Floats], weights: Floats, usual: Floats) -> Floats:
    """Return the mean translation of the standing feet, (N, 3), smooth over time.

    ``weights`` are those of the feet, (N, L); ``usual`` is the translation without standing feet,
    (N, 3).
    """
    sums, total = _FLIGHT * usual, np.full((len(usual), 1), _FLIGHT)
    for foot, shift in enumerate(shifts):
        for contact, rows, _ in plan.stances(foot):
            weight = (weights[rows, foot] * contact.hold)[:, None]
            sums[rows] += weight * shift[rows]
            total[rows] += weight
    mean = sums / total
    half = max(1, round(_SWAY * plan.rate))
    for start, stop in plan.spans:
        for _ in range(2):
            padded = np.pad(mean[start:stop], ((half, half), (0, 0)), mode="edge")
            sums = np.cumsum(np.pad(padded, ((1, 0), (0, 0))), axis=0)
            mean[start:stop] = (sums[2 * half + 1 :] - sums[: -2 * half - 1]) / (2 * half + 1)
    return mean
