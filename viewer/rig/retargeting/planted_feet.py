"""Planting of a driven figure's feet during contacts of the source (after Kovar et al. 2002).

Retargeting preserves the directions of limbs, so feet slide and sink if proportions differ.
During a contact of the source, the ball or the heel of the figure's foot stays in place and its
sole on the ground; before and after, the correction fades in and out. Hips and knees rotate so that
the ankles reach their targets, and the body is lowered if a leg is too short. If a knee then moves
more suddenly than the source's, feet are held and released more gradually.
"""

from __future__ import annotations

from dataclasses import replace
from typing import cast

import numpy as np

from viewer.data_classes import dataclass
from viewer.progress import report
from viewer.rig.arrays import Floats, Ints
from viewer.rig.cleanup.frame_rows import in_frame_order
from viewer.rig.cleanup.leg_solving import leg_rotations, lowering
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
from viewer.rig.retargeting.foot_shifts import foot_shifts
from viewer.rig.retargeting.knee_accelerations import acceleration_ratio, knee_accelerations
from viewer.rig.retargeting.level_feet import levelled
from viewer.rig.retargeting.moving_ground import ground_velocity, on_moving_ground
from viewer.rig.retargeting.retarget import Retargeted

__all__ = ["PlantedFeet", "plant_feet"]

_EXTENDED = 0.97  # maximum extension of a corrected leg, as a fraction of its length
_EASES = (0.1, 0.2)  # longer beginnings and ends of contacts, seconds
_CALM = 1.15  # largest growth of the knees' accelerations that needs no longer ease, a factor
_ROUNDING = 1e-6  # tolerance of lengths, relative to the body
_STEPS = 2 + 3 * (1 + len(_EASES))  # maximum number of steps reported as progress


@dataclass(frozen=True, slots=True)
class PlantedFeet:
    """Changes made by planting feet.

    Attributes
    ----------
    n_contacts : int
        Number of contacts of all feet.
    source, before, after : float
        Total distance that feet slide while they are on the ground, in figure units: in the source,
        scaled to the figure, and in the figure before and after planting.
    gap_before, gap_after : float
        Largest distance of a planted sole above or below the ground.
    lowered : float
        Largest distance by which the body was lowered.
    size : float
        Approximate height of the body.
    ground_speed : float
        Speed of the ground on which the feet stand, per second; 0 if it does not move.
    """

    n_contacts: int = 0
    source: float = 0.0
    before: float = 0.0
    after: float = 0.0
    gap_before: float = 0.0
    gap_after: float = 0.0
    lowered: float = 0.0
    size: float = 1.0
    ground_speed: float = 0.0

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

    Parameters
    ----------
    found : Retargeted
        The retargeting.
    figure : Figure
        The driven figure.
    hangs : bool
        Whether the motion's up axis points down.

    Returns
    -------
    clip : SampledClip
        The motion; unchanged if it would not improve.
    changes : PlantedFeet or None
        Changes made; None if the figure or the source has no recognised legs, or the figure has
        the source's proportions.
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
    moves = ground_velocity(feet, *how, body.size, up)
    if moves is not None:  # contacts and corrections are found in the axes of the ground
        seconds = np.flatnonzero(timing.present) / timing.frame_rate
        travel = -seconds[:, None] * moves
        body = replace(body, travel=travel)
        worlds, feet = body.worlds(clip), on_moving_ground(feet, travel)
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
    knees = (knee_accelerations(each, body.legs, plan.spans, plan.rate) for each in (worlds, after))
    return _Attempt(planted, changes, acceleration_ratio(*knees))


def _planted(
    clip: SampledClip, body: DrivenLegs, worlds: Floats, plan: FootPlan
) -> tuple[SampledClip, float]:
    """Return the corrected motion, and how far the body was lowered."""
    up, joints = plan.up, body.chains.joints
    heights, straight = body.heights(worlds, up), body.straightness(worlds)
    shifts, sway = foot_shifts(plan, body.feet(worlds), heights, straight)
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
