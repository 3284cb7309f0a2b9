"""Feet of driven figures, planted where those of the source stand (after Kovar et al. 2002).

Retargeting keeps the directions of limbs, so that feet slide and sink where proportions differ. In
a contact of the source, the ball or the heel of the figure's foot stays at one place and its sole
on the ground; before and after, the correction fades. Hips and knees rotate to reach the ankles,
and the body is lowered where legs are too short.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from viewer.rig.arrays import Bools, Floats, Ints
from viewer.rig.cleanup.frame_rows import in_frame_order
from viewer.rig.cleanup.leg_solving import faded, falling, leg_rotations, lowering
from viewer.rig.figure import Figure
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.retargeting.driven_legs import (
    DrivenLegs,
    driven_legs,
    foot_paths,
    leg_pairs,
    spans_of,
)
from viewer.rig.retargeting.retarget import Retargeted
from viewer.rig.retargeting.source_contacts import (
    Contact,
    FootPath,
    foot_contacts,
    ground_level,
    step_height,
)

__all__ = ["PlantedFeet", "plant_feet"]

_EXTENDED = 0.97  # corrections straighten a leg up to this fraction of its length
_EASE = 0.3  # seconds over which a correction begins and ends outside contacts
# Cosine of the angle between the sole and the ground: nothing is held up to the first value, and
# everything from the second one on.
_ON_SOLE = (-0.1, 0.3)
_ON_SIDE = (-0.1, 0.1)
_ALIKE = 1e-4  # relative to the body
_ROUNDING = 1e-6  # relative to the body
_SUNK = 0.015  # the source's feet may be this far below the ground, relative to the body


@dataclass(frozen=True, slots=True)
class PlantedFeet:
    """Changes made by planting feet.

    Attributes
    ----------
    n_contacts : int
        Number of times a foot stands.
    source, before, after : float
        Distance that feet slide while they stand, in total: in the source, scaled to the figure,
        and in the figure; figure units.
    gap_before, gap_after : float
        Largest height of a standing sole above or below the ground.
    lowered : float
        Largest distance by which the body was lowered.
    size : float
        About the height of the body.
    """

    n_contacts: int = 0
    source: float = 0.0
    before: float = 0.0
    after: float = 0.0
    gap_before: float = 0.0
    gap_after: float = 0.0
    lowered: float = 0.0
    size: float = 1.0

    @property
    def is_better(self) -> bool:
        """Whether feet slide less or are nearer to the ground, and neither is worse."""
        slack = _ROUNDING * self.size
        slides, gap = self.after - self.before, self.gap_after - self.gap_before
        return max(slides, gap) <= slack and min(slides, gap) < -slack


@dataclass(frozen=True, slots=True, eq=False)
class _Plan:
    """Contacts of all feet, and the heights of the ground."""

    contacts: list[list[Contact]]
    grounds: list[list[float]]  # height of the ground of each contact
    spans: list[tuple[int, int]]
    rate: float
    up: Floats


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
        The motion; unchanged if it would not become better.
    changes : PlantedFeet or None
        What was changed; None if the figure or the source has no legs of known names, or the
        figure has the source's proportions.
    """
    pairs = leg_pairs(found, figure.require_skeleton())
    rest_up = np.eye(3)["xyz".index(figure.up)]
    up = -rest_up if hangs else rest_up
    clip = cast("SampledClip", in_frame_order(found.clip))
    body = driven_legs(figure, clip, [pair.leg for pair in pairs], rest_up) if pairs else None
    if body is None or clip.n_rows == 0:
        return found.clip, None
    source = cast("SampledClip", in_frame_order(found.source.clip))
    worlds = body.worlds(clip)
    feet = foot_paths(found, source, pairs, body.feet_from_ankles(worlds), rest_up)
    if _moves_alike(feet, body.feet(worlds), body.size):
        return found.clip, None
    plan = _plan(feet, body, clip, up)
    if not any(plan.contacts):
        return found.clip, PlantedFeet()
    planted, lowered = _planted(clip, body, worlds, feet, plan)
    after = body.worlds(planted)
    changes = PlantedFeet(
        sum(map(len, plan.contacts)),
        _slide([(foot.toe, foot.heel) for foot in feet], plan),
        _slide(body.feet(worlds), plan),
        _slide(body.feet(after), plan),
        _gap(body, worlds, plan),
        _gap(body, after, plan),
        lowered,
        body.size,
    )
    return (planted if changes.is_better else found.clip), changes


def _moves_alike(
    feet: Sequence[FootPath], own: Sequence[tuple[Floats, Floats]], size: float
) -> bool:
    """Return whether the figure's ankles move exactly as those of the source."""
    for foot, (_, heel) in zip(feet, own, strict=True):
        away = heel - foot.heel
        if float(np.abs(away - away[0]).max()) > _ALIKE * size:
            return False
    return True


def _plan(feet: list[FootPath], body: DrivenLegs, clip: SampledClip, up: Floats) -> _Plan:
    """Return the contacts of the source, and the heights of the ground under the figure."""
    spans, rate, size = spans_of(clip.timing), clip.timing.frame_rate, body.size
    contacts = foot_contacts(feet, spans, rate, size, up)
    if not any(contacts):
        return _Plan(contacts, [], spans, rate, up)
    level, is_usual = ground_level(contacts, size, body.clearance)
    ground = 0.0 if is_usual else level - body.clearance
    grounds = [[ground + step_height(one, level, size) for one in foot] for foot in contacts]
    return _Plan(contacts, grounds, spans, rate, up)


def _planted(
    clip: SampledClip, body: DrivenLegs, worlds: Floats, feet: list[FootPath], plan: _Plan
) -> tuple[SampledClip, float]:
    """Return the corrected motion, and how far the body was lowered."""
    up = plan.up
    raised, heights = _vertical(body, worlds, feet, plan)
    moves = []
    for number, points in enumerate(body.feet(worlds)):
        flat = _horizontal(points, feet[number], plan.contacts[number], plan)
        moves.append(flat + heights[:, number, None] * up)
    lowered = lowering(worlds[..., :3, 3], body.legs, moves, plan.rate, up, _EXTENDED)
    drop = (raised - lowered)[:, None] * up
    shifts = [move + raised * up for move in moves]
    joints = body.chains.joints
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


def _horizontal(
    points: tuple[Floats, Floats], foot: FootPath, contacts: Sequence[Contact], plan: _Plan
) -> Floats:
    """Return horizontal shifts (N, 3) that keep a foot in its place in every contact.

    Where a contact begins and ends, the foot follows that of the source.
    """
    shift = np.zeros_like(points[0])
    is_held = np.zeros(len(shift), dtype=np.bool_)
    for contact in contacts:
        rows = slice(contact.start, contact.stop)
        wanted = (1.0 - contact.hold)[:, None] * _steps((foot.toe, foot.heel), contact, plan.up)
        steps = np.cumsum(_steps(points, contact, plan.up) - wanted, axis=0)
        shift[rows] = steps.mean(axis=0) - steps
        is_held[rows] = True
    return _eased(shift, is_held, plan)


def _steps(points: tuple[Floats, Floats], contact: Contact, up: Floats) -> Floats:
    """Return how the standing point of a foot moves horizontally from row to row: (N, 3)."""
    rows = slice(contact.start, contact.stop)
    toe, heel = (np.diff(path[rows], axis=0, prepend=path[rows][:1]) for path in points)
    moved = np.where(contact.on_toe[:, None], toe, heel)
    return moved - (moved @ up)[:, None] * up


def _eased(values: Floats, is_held: Bools, plan: _Plan) -> Floats:
    """Return corrections (N, C) that fade outside the rows that are held."""
    result, ease = np.zeros_like(values), max(1, round(_EASE * plan.rate))
    for start, stop in plan.spans:
        part = slice(start, stop)
        there = np.ones(stop - start, dtype=np.bool_)
        result[part] = faded(values[part], is_held[part], there, ease)
    return result


def _vertical(
    body: DrivenLegs, worlds: Floats, feet: list[FootPath], plan: _Plan
) -> tuple[float, Floats]:
    """Return how far the body is raised, and then each foot: (N, L)."""
    heights, facing = body.heights(worlds, plan.up), body.facing(worlds, plan.up)
    needed, holds = np.zeros_like(heights), _holds(facing, plan)
    for foot, (contacts, grounds) in enumerate(zip(plan.contacts, plan.grounds, strict=True)):
        for contact, ground in zip(contacts, grounds, strict=True):
            rows = slice(contact.start, contact.stop)
            own = feet[foot].lowest(plan.up)[rows] - contact.height
            needed[rows, foot] = ground + (1.0 - contact.hold) * own - heights[rows, foot]
    result, stands = np.zeros_like(heights), holds >= 1.0
    if not stands.any():
        return 0.0, result
    raised = float(np.median(needed[stands]))
    for foot, contacts in enumerate(plan.contacts):
        if not contacts:
            continue
        held = np.where(holds[:, foot] > 0.0, needed[:, foot] - raised, 0.0)
        eased = _eased(held[:, None], stands[:, foot], plan)[:, 0]
        eased += holds[:, foot] * (held - eased)
        floor = _floor(feet[foot], contacts, plan.grounds[foot], body.size, plan)
        sunk = np.maximum(floor - (heights[:, foot] + raised + eased), 0.0)
        on_side = falling((facing[:, foot] - _ON_SIDE[0]) / (_ON_SIDE[1] - _ON_SIDE[0]))
        result[:, foot] = eased + np.where(stands[:, foot], 0.0, (1.0 - on_side) * sunk)
    return raised, result


def _holds(facing: Floats, plan: _Plan) -> Floats:
    """Return how far the sole of each foot is held on the ground, 0 to 1: (N, L).

    ``facing``: cosine of the angle between each sole and the ground.
    """
    result = np.zeros_like(facing)
    for foot, contacts in enumerate(plan.contacts):
        for contact in contacts:
            result[contact.start : contact.stop, foot] = contact.hold
    return result * falling((_ON_SOLE[1] - facing) / (_ON_SOLE[1] - _ON_SOLE[0]))


def _floor(
    foot: FootPath, contacts: Sequence[Contact], grounds: Sequence[float], size: float, plan: _Plan
) -> Floats:
    """Return the height below which a foot must not sink: (N,).

    This is the lower ground of the contacts before and after. Where the source's own foot is
    lower, its ground is.
    """
    rows = np.arange(len(foot.toe))
    after = np.searchsorted([contact.start for contact in contacts], rows, side="right")
    before = np.maximum(after - 1, 0)
    after = np.minimum(after, len(contacts) - 1)
    levels = np.array(grounds)
    stands = np.array([contact.height for contact in contacts])
    lowest = np.minimum(levels[before], levels[after])
    sunk = np.minimum(stands[before], stands[after]) - foot.lowest(plan.up) - _SUNK * size
    return lowest - np.maximum(sunk, 0.0)


def _slide(feet: Sequence[tuple[Floats, Floats]], plan: _Plan) -> float:
    """Return the distance that feet slide while they stand, in total."""
    total = 0.0
    for points, contacts in zip(feet, plan.contacts, strict=True):
        for contact in contacts:
            total += float(np.linalg.norm(_steps(points, contact, plan.up), axis=1).sum())
    return total


def _gap(body: DrivenLegs, worlds: Floats, plan: _Plan) -> float:
    """Return the largest distance of a standing sole from the ground."""
    heights = body.heights(worlds, plan.up)
    stands = _holds(body.facing(worlds, plan.up), plan) >= 1.0
    largest = 0.0
    for foot, (contacts, grounds) in enumerate(zip(plan.contacts, plan.grounds, strict=True)):
        for contact, ground in zip(contacts, grounds, strict=True):
            rows = slice(contact.start, contact.stop)
            gaps = np.abs(heights[rows, foot] - ground)[stands[rows, foot]]
            largest = max(largest, float(gaps.max(initial=0.0)))
    return largest
