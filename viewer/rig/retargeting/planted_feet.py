"""Planting of a driven figure's feet during contacts of the source (after Kovar et al. 2002).

Retargeting preserves the directions of limbs, so feet slide and sink if proportions differ.
During a contact of the source, the ball or the heel of the figure's foot stays in place and its
sole on the ground; before and after, the correction fades in and out. Hips and knees rotate so that
the ankles reach their targets, and the body is lowered if a leg is too short. If a knee then moves
more suddenly than the source's, feet are held and released more gradually.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import cast

import numpy as np

from viewer.data_classes import dataclass
from viewer.progress import report
from viewer.rig.arrays import Bools, Floats, Ints
from viewer.rig.cleanup.curves import falling, smooth_curves
from viewer.rig.cleanup.frames import in_frame_order
from viewer.rig.cleanup.leg_ik import Leg, leg_rotations, lowering
from viewer.rig.figure import Figure
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.retargeting.driven_legs import (
    DrivenLegs,
    driven_legs,
    foot_paths,
    has_source_proportions,
    leg_pairs,
    spans_of,
)
from viewer.rig.retargeting.foot_plan import FootPlan, foot_plan
from viewer.rig.retargeting.level_feet import levelled
from viewer.rig.retargeting.retarget import Retargeted
from viewer.rig.retargeting.source_contacts import Contact, FootPath

_EXTENDED = 0.97  # maximum extension of a corrected leg, as a fraction of its length
_EASES = (0.1, 0.2)  # longer beginnings and ends of contacts, seconds
_CALM = 1.15  # largest growth of the knees' accelerations that needs no longer ease, a factor
_ROUNDING = 1e-6  # tolerance of lengths, relative to the body
_STEPS = 2 + 3 * (1 + len(_EASES))  # maximum number of steps reported as progress


@dataclass(frozen=True, slots=True)
class PlantedFeet:
    """Changes made by planting feet."""

    n_contacts: int = 0
    """Number of contacts of all feet."""
    source: float = 0.0
    before: float = 0.0
    after: float = 0.0
    """Total distance that feet slide while they are on the ground, in figure units: in the source,
    scaled to the figure, and in the figure before and after planting."""
    gap_before: float = 0.0
    gap_after: float = 0.0
    """Largest distance of a planted sole above or below the ground."""
    lowered: float = 0.0
    """Largest distance by which the body was lowered."""
    size: float = 1.0
    """Approximate height of the body."""
    ground_speed: float = 0.0
    """Speed of the ground on which the feet stand, per second; 0 if it does not move."""

    @property
    def is_better(self) -> bool:
        """Whether feet slide less or are nearer to the ground, and neither is worse than before."""
        slack = _ROUNDING * self.size
        slides, gap = self.after - self.before, self.gap_after - self.gap_before
        return max(slides, gap) <= slack and min(slides, gap) < -slack


@dataclass(frozen=True, slots=True, eq=False)
class _Attempt:
    """A motion with planted feet."""

    clip: SampledClip
    changes: PlantedFeet
    knees: float  # ratio of the knees' largest accelerations to those before


def plant_feet(
    found: Retargeted, figure: Figure, hangs: bool = False
) -> tuple[SampledClip, PlantedFeet | None]:
    """Return the motion of a driven figure with its feet planted.

    Returns ``clip``: the motion; unchanged if it would not improve; ``changes``: changes made; None
    if the figure or the source has no recognised legs, or the figure has the source's proportions.
    """
    pairs = leg_pairs(found, figure)
    rest_up = np.eye(3)["xyz".index(figure.up)]
    up = -rest_up if hangs else rest_up
    clip = cast("SampledClip", in_frame_order(found.clip))
    body = driven_legs(figure, clip, [pair.leg for pair in pairs], rest_up) if pairs else None
    if body is None or body.size <= 0.0 or clip.n_rows == 0:
        return found.clip, None
    if has_source_proportions(found, figure, pairs, body.size):
        return found.clip, None
    report(1, _STEPS, "steps", "planting the feet")
    source = cast("SampledClip", in_frame_order(found.source.clip))
    worlds, timing = body.worlds(clip), clip.timing
    feet = foot_paths(found, source, pairs, body.feet_from_ankles(worlds), rest_up)
    how = spans_of(timing), timing.frame_rate
    moves = _ground_velocity(feet, *how, body.size, up)
    if moves is not None:  # contacts and corrections are found in the axes of the ground
        seconds = np.flatnonzero(timing.present) / timing.frame_rate
        travel = -seconds[:, None] * moves
        body = replace(body, travel=travel)
        worlds, feet = body.worlds(clip), _on_moving_ground(feet, travel)
    speed = 0.0 if moves is None else float(np.linalg.norm(moves))
    plan = foot_plan(feet, *how, (body.size, body.clearance), up)
    if not any(plan.contacts):
        return found.clip, PlantedFeet()
    best = _attempt(clip, body, worlds, plan, speed, 2)
    for number, ease in enumerate(_EASES, 1):
        if best.knees <= _CALM:
            break
        plan = foot_plan(feet, *how, (body.size, body.clearance), up, ease)
        tried = _attempt(clip, body, worlds, plan, speed, 2 + 3 * number)
        if tried.knees < best.knees and tried.changes.after <= tried.changes.source:
            best = tried
    return (best.clip if best.changes.is_better else found.clip), best.changes


def _attempt(
    clip: SampledClip,
    body: DrivenLegs,
    worlds: Floats,
    plan: FootPlan,
    ground_speed: float,
    step: int,
) -> _Attempt:
    """Return the motion with its feet planted according to a plan; reports progress from a step."""
    report(step, _STEPS, "steps")
    level = levelled(clip, body, worlds, plan)
    report(step + 1, _STEPS, "steps")
    planted, lowered = _planted(level, body, body.worlds(level), plan)
    report(step + 2, _STEPS, "steps")
    after = body.worlds(planted)
    gaps = [plan.gap(body.heights(each, plan.up)) for each in (worlds, after)]
    changes = PlantedFeet(
        sum(map(len, plan.contacts)),
        plan.slide([(foot.toe, foot.heel) for foot in plan.feet]),
        plan.slide(body.feet(worlds)),
        plan.slide(body.feet(after)),
        gaps[0],
        gaps[1],
        lowered,
        body.size,
        ground_speed,
    )
    knees = (
        _knee_accelerations(each, body.legs, plan.spans, plan.rate) for each in (worlds, after)
    )
    return _Attempt(planted, changes, _acceleration_ratio(*knees))


def _planted(
    clip: SampledClip, body: DrivenLegs, worlds: Floats, plan: FootPlan
) -> tuple[SampledClip, float]:
    """Return the corrected motion, and how far the body was lowered."""
    up, joints = plan.up, body.chains.joints
    heights, straight = body.heights(worlds, up), body.straightness(worlds)
    shifts, sway = _foot_shifts(plan, body.feet(worlds), heights, straight)
    moves = [shift - sway for shift in shifts]
    lowered = lowering(worlds[..., :3, 3], body.legs, moves, plan.rate, up, _EXTENDED)
    drop = sway - lowered[:, None] * up
    rotations = clip.rotations.copy()
    rotations[:, joints] = leg_rotations(
        rotations[:, joints], worlds, body.chains.parents, body.legs, drop, shifts
    )
    moved = _translated(clip, drop, joints[body.chains.parents < 0])
    return replace(moved, rotations=rotations), float(lowered.max(initial=0.0))


def _translated(clip: SampledClip, drop: Floats, roots: Ints) -> SampledClip:
    """Return a motion of the whole body moved by offsets (N, 3)."""
    if clip.figure_translations is not None:
        return replace(clip, figure_translations=clip.figure_translations + drop)
    shifts = np.zeros_like(clip.rotations[..., :3])
    if clip.translations is not None:
        shifts += clip.translations
    shifts[:, roots] += drop[:, None]
    return replace(clip, translations=shifts)


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


def _foot_shifts(
    plan: FootPlan,
    points: list[tuple[Floats, Floats]],
    heights: Floats,
    straight: Floats,
) -> tuple[list[Floats], Floats]:
    """Return the translations of all feet and of the body.

    A foot is corrected while it is on the ground. The body smoothly follows planted feet on
    straight legs, so that these legs need not bend; other feet follow the body.

    ``plan``: positions and times at which the feet must be planted, with at least one contact.
    ``points``: list of ((N, 3), (N, 3)), paths of the balls and the heels. ``heights``: (N, L),
    heights of the soles. ``straight``: (N, L), length of each leg from hip to ankle, as a fraction
    of its maximum length. Returns ``shifts``: list of (N, 3); ``sway``: (N, 3).
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


_STILL = 10.0  # smallest acceleration with which others are compared, rad/s^2


def _knee_accelerations(
    worlds: Floats, legs: Sequence[Leg], spans: Sequence[tuple[int, int]], rate: float
) -> Floats:
    """Return the largest angular acceleration of each knee: (L,) in rad/s^2.

    ``worlds``: (N, K, 4, 4), world matrices of the joints. ``spans``: ranges of rows without gaps.
    ``rate``: rows per second.
    """
    result = np.zeros(len(legs))
    for number, leg in enumerate(legs):
        hips, knees, ankles = (worlds[:, joint, :3, 3] for joint in (leg.hip, leg.knee, leg.ankle))
        upper, lower = hips - knees, ankles - knees
        sines = np.linalg.norm(np.cross(upper, lower), axis=1)
        angles = np.arctan2(sines, np.einsum("na,na->n", upper, lower))
        for start, stop in spans:
            found = np.abs(np.diff(angles[start:stop], 2)).max(initial=0.0)
            result[number] = max(result[number], float(found) * rate**2)
    return result


def _acceleration_ratio(before: Floats, after: Floats) -> float:
    """Return the largest ratio of accelerations, (L,) each; knees at rest do not count."""
    return float((after / np.maximum(before, _STILL)).max(initial=0.0))


# Speed of the ground below motions in place, as on a treadmill or with the travel removed.
#
# Standing feet then move at a constant velocity while the body stays in place. Contacts are found
# in the axes of the moving ground.

# Lengths and speeds are relative to the size of the body, about its height: 0.1 is 0.17 m.
_SAME = 0.08  # tolerance for the speed of standing feet, per second
_SLOWEST = 0.2  # minimum speed of the ground, per second
_DRIFT = 0.25  # maximum speed of the body relative to the speed of the ground
_USUAL = 0.4  # minimum fraction of the rows in which the lowest foot has the ground's velocity

# Minimum ratio of the number of these rows to the number of rows with a resting foot.
_OFTENER = 3.0
_WINDOW = 0.1  # seconds over which velocities are averaged
_MOST = 500  # maximum number of candidates


def _ground_velocity(
    feet: Sequence[FootPath], spans: Sequence[tuple[int, int]], rate: float, size: float, up: Floats
) -> Floats | None:
    """Return the velocity of the ground, (3,) per second; None if it does not move.

    The parameters are those of ``foot_contacts``.
    """
    speeds, body = _speeds(feet, spans, rate, up)
    if not len(speeds):
        return None
    near = _SAME * size
    candidates = speeds[:: -(-len(speeds) // _MOST)]
    counts = [int((np.linalg.norm(speeds - each, axis=1) < near).sum()) for each in candidates]
    best = candidates[int(np.argmax(counts))]
    is_alike = np.linalg.norm(speeds - best, axis=1) < near
    velocity: Floats = np.median(speeds[is_alike], axis=0)
    n_resting = int((np.linalg.norm(speeds, axis=1) < near).sum())
    speed, drift = np.linalg.norm(velocity), np.linalg.norm(body.mean(axis=0))
    is_moving = speed > _SLOWEST * size and drift < _DRIFT * speed
    is_usual = is_alike.mean() > _USUAL and is_alike.sum() > _OFTENER * n_resting
    return velocity if is_moving and is_usual else None


def _speeds(
    feet: Sequence[FootPath], spans: Sequence[tuple[int, int]], rate: float, up: Floats
) -> tuple[Floats, Floats]:
    """Return the horizontal velocities of the lowest foot and of the hips, (M, 3) per second."""
    half = max(1, round(0.5 * _WINDOW * rate))
    lowest = np.array([foot.lowest(up) for foot in feet]).argmin(axis=0)
    found, body = [np.zeros((0, 3))], [np.zeros((0, 3))]
    for first, last in spans:
        rows = np.arange(first + half, last - half, dtype=np.int32)
        own = np.zeros((len(rows), 3))
        for number, foot in enumerate(feet):
            is_toe = (foot.toe @ up <= foot.heel @ up)[rows, None]
            moved = np.where(is_toe, *(_velocities(p, rows, half) for p in (foot.toe, foot.heel)))
            own = np.where((lowest[rows] == number)[:, None], moved, own)
        found.append(own)
        body.append(np.mean([_velocities(foot.hip, rows, half) for foot in feet], axis=0))
    flat = np.eye(3) - np.outer(up, up)
    return rate * np.concatenate(found) @ flat, rate * np.concatenate(body) @ flat


def _velocities(path: Floats, rows: Ints, half: int) -> Floats:
    """Return the displacement per row around each row."""
    return (path[rows + half] - path[rows - half]) / (2.0 * half)


def _on_moving_ground(feet: Sequence[FootPath], travel: Floats) -> list[FootPath]:
    """Return the paths of the feet relative to the ground, moved by ``travel`` (N, 3)."""
    result = []
    for foot in feet:
        toe = foot.toe + travel
        heel = toe if foot.heel is foot.toe else foot.heel + travel
        result.append(FootPath(toe, heel, foot.hip + travel))
    return result
