"""Translations of the feet and the body of a moving figure that keep planted feet in place."""

from __future__ import annotations

import numpy as np

from viewer.data_classes import dataclass
from viewer.rig.arrays import Bools, Floats
from viewer.rig.cleanup.easing import falling
from viewer.rig.cleanup.smooth_curves import smooth_curves
from viewer.rig.retargeting.foot_plan import FootPlan
from viewer.rig.retargeting.source_contacts import Contact

__all__ = ["foot_shifts"]

_EASE = 0.15  # seconds over which a correction falls to 40 % outside contacts
_JUMP = 0.03  # seconds below which a jump of the recording is sudden
_JUMPS = (0.002, 0.004)  # its sizes, relative to the body, between which it becomes a jump
_GAP = 0.0007  # maximum distance of a standing foot from the ground in a jump, relative to the body
_EXACT = 12.0  # decimal exponent of the weight of a fully held foot, plus 3
# Number of passes that lift sinking feet, and their weight relative to the stiffness of the curves.
_LIFTS, _LIFTED = 7, 0.25
_SWAY = 0.15  # half the window of the two moving averages of the feet's shifts, seconds
_SHAKE = 0.1  # duration below which changes of the feet's translations count as quick, seconds
_FLIGHT = 0.05  # weight of the default translation relative to the weight of a planted foot
_STRAIGHT = (0.8, 0.95)  # relative lengths below which a leg is bent and above which it is straight


@dataclass(frozen=True, slots=True, eq=False)
class _Wanted:
    """Corrections of one foot during its contacts."""

    flat: Floats  # (N, 3), horizontal
    is_flat: Bools  # (N,), whether a row has a horizontal correction
    rise: Floats  # (N,)
    holds: Floats  # (N,), degree to which the foot is held in place, 0 to 1
    above: Floats  # (N,), height of the sole above the floor


def foot_shifts(
    plan: FootPlan,
    points: list[tuple[Floats, Floats]],
    heights: Floats,
    straight: Floats,
) -> tuple[list[Floats], Floats]:
    """Return the translations of all feet and of the body.

    A foot is corrected while it is on the ground. The body smoothly follows planted feet on
    straight legs, so that these legs need not bend; other feet follow the body.

    Parameters
    ----------
    plan : FootPlan
        Positions and times at which the feet must be planted, with at least one contact.
    points : list of ((N, 3), (N, 3))
        Paths of the balls and the heels.
    heights : (N, L)
        Heights of the soles.
    straight : (N, L)
        Length of each leg from hip to ankle, as a fraction of its maximum length.

    Returns
    -------
    shifts : list of (N, 3)
        Translations of the feet.
    sway : (N, 3)
        Translations of the body.
    """
    every = [_wanted(plan, foot, points[foot], heights[:, foot]) for foot in range(len(points))]
    bent = falling((straight - _STRAIGHT[0]) / (_STRAIGHT[1] - _STRAIGHT[0]))
    rises = np.concatenate(
        [each.rise[(each.holds >= 1.0) & (bent[:, foot] < 0.5)] for foot, each in enumerate(every)]
    )
    usual = float(np.median(rises)) if len(rises) else 0.0
    still = np.tile(usual * plan.up, (len(heights), 1))
    shifts = _shifts(plan, every, still)
    sway = _sway(plan, shifts, 1.0 - bent, still) + _shake(plan, shifts)
    sway += _shake(plan, [shift - sway for shift in _shifts(plan, every, sway)])
    return _shifts(plan, every, sway, _LIFTS), sway


def _wanted(plan: FootPlan, foot: int, points: tuple[Floats, Floats], heights: Floats) -> _Wanted:
    """Return the corrections of a foot.

    At the beginning and end of a contact, the foot follows the source's foot.
    """
    path = plan.feet[foot]
    flat, rise = np.zeros_like(points[0]), np.zeros(len(heights))
    is_flat, holds = np.zeros(len(heights), dtype=np.bool_), np.zeros(len(heights))
    low = path.lowest(plan.up)
    for contact, rows, ground in plan.stances(foot):
        loose = 1.0 - contact.hold
        wanted = loose[:, None] * plan.steps((path.toe, path.heel), contact)
        steps = np.cumsum(plan.steps(points, contact) - wanted, axis=0)
        flat[rows], is_flat[rows] = steps.mean(axis=0) - steps, True
        holds[rows] = contact.hold
        away = low[rows] - _level(low[rows], contact)
        rise[rows] = ground + loose * away - heights[rows]
    if not is_flat.any():
        return _Wanted(flat, is_flat, rise, holds, np.full_like(rise, np.inf))
    return _Wanted(flat, is_flat, rise, holds, heights - plan.floor(foot))


def _level(low: Floats, contact: Contact) -> Floats:
    """Return the heights from which the source's foot rises in the rows of a contact: (N,).

    A standing foot may drift; when it lifts, its correction continues without a jump.
    """
    held = np.flatnonzero(contact.hold >= 1.0)
    if len(held) == 0:
        return np.full_like(low, contact.height)
    return np.interp(np.arange(len(low)), held, low[held])


def _shifts(plan: FootPlan, every: list[_Wanted], base: Floats, n_lifts: int = 0) -> list[Floats]:
    """Return the translations of the feet, which approach ``base`` away from contacts: (N, 3).

    ``n_lifts`` is the number of passes that lift sinking feet.
    """
    up, count = plan.up, len(every)
    usual = base @ up
    flat = base - usual[:, None] * up
    targets = np.zeros((2 * count, *base.shape))
    weights = np.zeros((2 * count, len(base)))
    for foot, wanted in enumerate(every):
        targets[foot] = np.where(wanted.is_flat[:, None], wanted.flat - flat, 0.0)
        targets[count + foot, :, 0] = np.where(wanted.holds > 0.0, wanted.rise - usual, 0.0)
        weights[[foot, count + foot]] = wanted.holds
    targets = _calmed(plan, targets, weights)
    found = _smoothed(plan, targets, _strength(weights))
    result, lifted = [], 1.0 + _LIFTED * (_EASE * plan.rate) ** 4
    for foot, wanted in enumerate(every):
        row = count + foot
        stands, held = wanted.holds[:, None] >= 1.0, targets[row, :, :1]
        across = np.where(stands, targets[foot], found[foot])
        rise = np.where(stands, held, found[row, :, :1])
        least = np.where(stands, -np.inf, -wanted.above[:, None] - usual[:, None])
        goals, force = targets[row : row + 1, :, :1].copy(), _strength(weights[row : row + 1])
        for _ in range(n_lifts):
            missing = (least - rise)[:, 0]
            sinks = missing > 0.0
            if not sinks.any():
                break
            goals[0, sinks, 0] = np.maximum(goals[0, sinks, 0], rise[sinks, 0]) + missing[sinks]
            force[0, sinks] = np.maximum(force[0, sinks], lifted)
            rise = np.where(stands, held, _smoothed(plan, goals, force)[0])
        result.append(flat + across + (usual[:, None] + rise) * up)
    return result


def _calmed(plan: FootPlan, targets: Floats, holds: Floats) -> Floats:
    """Return the targets of held rows without sudden jumps of the source, which the feet then keep.

    Where the whole body of a recording jumps for a frame, a foot that stays in place makes the knee
    jump instead.
    """
    smooth = _smoothed(plan, targets, holds + 1e-6, _JUMP)
    away = np.linalg.norm(targets - smooth, axis=2, keepdims=True) / plan.size
    jumps = 1.0 - falling((away - _JUMPS[0]) / (_JUMPS[1] - _JUMPS[0]))
    left = jumps * (smooth - targets) * (holds > 0.0)[..., None]
    half = len(targets) // 2
    left[half:] = np.clip(left[half:], -_GAP * plan.size, _GAP * plan.size)
    return targets + left


def _strength(holds: Floats) -> Floats:
    """Return the weights of rows: from 1 for free rows to the weight of an exactly held foot."""
    return 1.0 + holds * 10.0 ** (_EXACT * holds - 3.0)


def _smoothed(plan: FootPlan, targets: Floats, weights: Floats, seconds: float = _EASE) -> Floats:
    """Return smooth corrections, (S, N, C); gaps in time separate them."""
    result = np.empty_like(targets)
    for start, stop in plan.spans:
        part = slice(start, stop)
        result[:, part] = smooth_curves(targets[:, part], weights[:, part], seconds * plan.rate)
    return result


def _sway(plan: FootPlan, shifts: list[Floats], weights: Floats, usual: Floats) -> Floats:
    """Return the mean translation of the planted feet, (N, 3), smooth over time.

    ``weights`` are the weights of the feet, (N, L); ``usual`` is the translation without planted
    feet, (N, 3).
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


def _shake(plan: FootPlan, shifts: list[Floats]) -> Floats:
    """Return the quick translation that all planted feet have in common: (N, 3).

    Noise of the source's root moves body and feet alike. If the feet stay in place and the body
    does not follow them, this noise moves the knees. Noise of one leg must not move the others.
    """
    own = np.stack(shifts)
    ones = np.ones(own.shape[:2])
    quick = own - _smoothed(plan, own, ones, _SHAKE)
    holds = _smoothed(plan, plan.holds().T[..., None], ones, _SHAKE)
    holds = np.clip(holds, 0.0, 1.0) ** 4
    total = holds.sum(axis=0)
    mean = np.einsum("lnc,lna->na", holds, quick) / np.maximum(total, 1.0)
    squares = np.einsum("lnc,lna->nc", holds, quick**2) / np.maximum(total, 1.0)
    # 1 if all feet have the same translation, less if they differ.
    agreement = (mean**2).sum(axis=1, keepdims=True) / np.maximum(squares, 1e-30)
    return np.minimum(agreement, 1.0) ** 2 * mean
