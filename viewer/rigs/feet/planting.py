"""Planting of feet while they are on the ground: plan, shifts, legs.

After Kovar, Schreiner and Gleicher 2002, Footskate cleanup for motion capture editing: fixed places
during contacts, corrections that fade around them, legs solved in closed form. They lengthen legs
that are too short; here the body is lowered and follows its feet, and no bone changes its length.

During a contact, the ball or the heel of a foot stays in place and its sole on the ground; before
and after, the correction fades in and out. Long feet that would touch the ground in the air are
levelled. Hips and knees rotate so that the ankles reach their targets, and the body is lowered if a
leg is too short. If a knee then moves more suddenly than before, feet are held and released more
gradually.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from viewer.data_classes import dataclass
from viewer.progress import report
from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.cleanup.frames import in_frame_order
from viewer.rigs.feet import limits
from viewer.rigs.feet.body import BodyLegs, body_legs, spans_of
from viewer.rigs.feet.contacts import (
    Contact,
    FootPath,
    foot_contacts,
    ground_level,
    is_upright,
    moving_ground,
    on_moving_ground,
    step_height,
)
from viewer.rigs.feet.curves import envelope, falling, smooth_curves, strength
from viewer.rigs.feet.legs import Leg, leg_rotations, legs_of, lowering, unscaled
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.quaternion import (
    align_signs,
    conjugate,
    multiply,
    rotation_vector_to_quaternion,
)
from viewer.rigs.geometry.rotation import matrix_to_quaternion, quaternion_to_matrix
from viewer.rigs.geometry.vectors import axis_vector
from viewer.rigs.motion.sampled_clip import SampledClip

# How constants were found: five made motions (a walk, stairs, a jump, kneeling, a walk whose root
# jumps) were planted on the bundled body, SMPL and a character with short legs. The knee ratio is
# the largest acceleration of a knee after planting, divided by that before: below 1, knees move
# more gradually than before; above 1, more suddenly.

# Maximum extension of a corrected leg, as a fraction of its length. The knee's angle at extension x
# is 2 asin(x) if thigh and shin are equally long. It changes by 2 / sqrt(1 - x^2) radians per leg
# length: 8 at 0.97, but 45 at 0.999, where a knee would snap straight within a frame. The knee
# ratio of the walk is 0.8 at 0.97 and 1.6 at 0.9999; the body is lowered by 1.7 and 0.6 % of its
# size.
_EXTENDED = 0.97

# Longer beginnings and ends of contacts, seconds, tried one after the other while the knee ratio is
# above _CALM. Six recordings have at most 1.06 without any: 1.15 is beyond such chance, and too
# little to be seen. The ratio of kneeling, in which feet are lifted far, is 1.26 without and 1.00
# with 0.1 s. ``contacts`` limits either to a third of the contact, so that more than 0.2 s changes
# only contacts longer than 0.6 s: 0.3 s lowers no knee ratio above 1.15 by more than 0.01 (that of
# kneeling with short legs stays at 2.44), while feet slide farther.
_EASES, _CALM = (0.1, 0.2), 1.15
_ROUNDING = 1e-6  # tolerance of lengths, relative to the body

# Smallest acceleration of a knee with which another one is compared, rad/s^2: a knee at rest would
# have any ratio. 1 instead of 10 changes nothing; with 100, kneeling would have 0.38, not 1.26.
_STILL = 10.0

# The length s of the smooth curve of a correction, seconds. Outside contacts the target is 0 with
# weight 1, so the curve obeys s^4 c'''' = -c. Its solution that begins at rest and fades is
# exp(-a) (cos a + sin a) with a = t / (sqrt(2) s): 70 % after s, 28 % after 2 s, 4 % after 3 s.
_EASE = 0.15

# Like _EASE, for the tilt of a sole and for the limit of a lifted foot, which are quicker.
_LEVELS = 0.06
_FLAT = 6.0  # decimal exponent of the weight of a standing foot's tilt

# Like _EASE, for the noise of a standing foot's rotation. 0.02 or 0.08 changes knee ratios by at
# most 2 %.
_NOISE = 0.04

# Cosines of the tilts beyond which a sole is unchanged and below which it is fully levelled. Feet
# of standing rest poses differ by up to 31 degrees from file to file, which levelling has to undo;
# feet of rest poses that hang or are folded by 43 and more: their level direction is not known.
# The correction fades over 20 degrees, so that a foot near a limit does not flicker. The limits are
# thus a compromise: 71 % of a tilt of 43 degrees is still corrected, nothing from 55.
_TILTED = (np.cos(np.radians(55.0)), np.cos(np.radians(35.0)))

# The length s of the curve that does not follow a sudden jump of the recording, seconds: at 30 rows
# per second 0.9 rows, a curve that keeps 9 % of a wave that alternates from row to row; of half
# this length it would keep 60 %. With 0.06, ordinary steps of short legs pass as jumps, and their
# feet slide twice as far.
_JUMP = 0.03

# Sizes of a jump, relative to the body, between which it begins to be left in the motion of the
# foot. At a quarter of these, ordinary steps pass as jumps, and feet slide twice as far.
_JUMPS = (0.002, 0.004)

# Maximum distance of a standing foot from the ground in a jump, relative to the body: 1 mm.
_GAP = 0.0007

# Number of passes that lift sinking feet, and their weight relative to the stiffness s^4 of the
# curves. Without any, a foot of the short legs sinks by 13 % of the body; one pass leaves 0.13 %,
# three 0.05 %, seven 0.015 % (0.3 mm). A stronger pull needs fewer, but makes a kink where the foot
# would have touched the ground: the knee ratio of kneeling is 1.3 at 0.25 and 1.9 at 4.
_LIFTS, _LIFTED = 7, 0.25

# Rows per second above which the pull of a row on a lifted foot no longer grows with the stiffness:
# with twice as many rows, each at the same weight, the foot is pulled as it was. If it grew, a kick
# of CMU at 120 rows per second would be 100 mm lower than at 30, because the curve leaves the floor
# with the slope that it has there.
_DENSE = 60.0

# Half the window of the two moving averages of the feet's shifts, seconds. 0.075 or 0.3 changes
# knee ratios by at most 7 %.
_SWAY = 0.15

# Length s of the curve that does not follow quick changes of the feet's translations, seconds. At
# 0.2, part of a step counts as well, feet disagree about it, and the knee ratio of the walk with a
# jump is 3.0 instead of 0.8.
_SHAKE = 0.1

# Weight of the default translation relative to that of a planted foot: small, so that it decides
# only in flight. A tenth of it changes nothing; ten times as much holds the body back, and the knee
# ratio on stairs is 0.78 instead of 0.62.
_FLIGHT = 0.05

# Distances from hip to ankle, relative to those of the rest pose, below which a leg is bent and
# above which it is straight. By the law of cosines, knees of equal bones are bent by 74 and 36
# degrees: the straight leg of a walker is above the second, the leg of one who kneels below the
# first.
_STRAIGHT = (0.8, 0.95)

# Number of shares of a tilt, 0 to 1, at which the rise of the sole is evaluated.
_N_SHARES = 9

# Percentage of the rows in which the feet of a motion without contacts are lowest.
_LOWEST_ROWS = 2.0

STEPS = 2 + 3 * (1 + len(_EASES))
"""Maximum number of steps reported as progress; the first one is the caller's."""


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
    n_glides: int = 0
    """Number of contacts in which a foot is not held because it glides too far, as on skates or
    where the whole body drifts."""
    raised: float = 0.0
    """Height by which the whole motion was raised because its feet never stand."""
    ground: float = 0.0
    """Height of the ground on which the feet stand, the nearest to 0 of all; without contacts, of
    the lowest soles."""

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
    knees: float  # the knee ratio; see the constants


def plant(
    clip: SampledClip,
    body: BodyLegs,
    worlds: Floats,
    up: Floats,
    feet: list[FootPath] | None = None,
) -> tuple[SampledClip, PlantedFeet]:
    """Plant the feet of a motion during contacts, unless that would not improve it.

    ``worlds`` are the matrices of ``body``. ``feet``: paths that decide when the body's feet stand,
    those of the source of a driven figure; None for the body's own, which may slide.
    """
    is_own = feet is None
    feet = body.paths(worlds) if feet is None else feet
    timing = clip.timing
    how = spans_of(timing), timing.frame_rate
    ground = moving_ground(feet, *how, body.size, up)
    if ground is not None:  # contacts and corrections are found in the axes of the ground
        seconds = np.flatnonzero(timing.present) / timing.frame_rate
        travel = -seconds[:, None] * ground.velocity
        body = replace(body, travel=travel)
        worlds, feet = body.worlds(clip), on_moving_ground(feet, travel)
    speed = 0.0 if ground is None else float(np.linalg.norm(ground.velocity))
    slips = 1.0 if ground is None else ground.slips

    def plan_of(ease: float) -> _FootPlan:
        if is_own:
            return _own_plan(feet, *how, body.size, up, body.heights(worlds, up), ease)
        return _foot_plan(feet, *how, (body.size, body.clearance), up, ease, slips)

    plan = plan_of(0.0)
    if not any(plan.contacts):
        raised = 0.0 if is_own else _below_source(feet, body, worlds, up)
        roots = body.chains.joints[body.chains.parents < 0]
        lift = np.tile(raised * up, (clip.n_rows, 1))
        moved = _translated(clip, lift, roots) if raised else clip
        soles = body.heights(worlds, up).min(axis=1)
        low = float(np.percentile(soles, _LOWEST_ROWS)) + raised
        return moved, PlantedFeet(n_glides=plan.n_glides, raised=raised, size=body.size, ground=low)
    best = _attempt(clip, body, worlds, plan, speed, 2)
    for number, ease in enumerate(_EASES, 1):
        # The knees of a noisy capture move suddenly before anything is changed.
        if is_own or best.knees <= _CALM:
            break
        tried = _attempt(clip, body, worlds, plan_of(ease), speed, 2 + 3 * number)
        if tried.knees < best.knees and tried.changes.after <= tried.changes.source:
            best = tried
    return (best.clip if best.changes.is_better else clip), best.changes


def _below_source(feet: Sequence[FootPath], body: BodyLegs, worlds: Floats, up: Floats) -> float:
    """Return how far the lowest soles are below those of the source; 0 unless the source stands."""
    # Heights of hips follow those of the source, scaled by the length of the legs, so that the feet
    # of a figure with low ankles float where those of the source only touch the ground for a frame,
    # as in a run of a game.
    legs = np.concatenate([foot.hip - foot.heel for foot in feet])
    if not is_upright(legs, up):
        return 0.0
    lows = np.min([foot.lowest(up) for foot in feet], axis=0), body.heights(worlds, up).min(axis=1)
    theirs, own = (float(np.percentile(each, _LOWEST_ROWS)) for each in lows)
    # Their joints are above their soles, as for ``ground_level``.
    low, high = limits.ON_GROUND
    theirs = 0.0 if low * body.size < theirs < high * body.size else theirs
    return theirs - own if abs(theirs - own) > limits.LEVEL * body.size else 0.0


def _attempt(
    clip: SampledClip,
    body: BodyLegs,
    worlds: Floats,
    plan: _FootPlan,
    ground_speed: float,
    step: int,
) -> _Attempt:
    """Return the motion with its feet planted according to a plan; reports progress from a step."""
    # Soles first, because levelling moves the balls and heels that are then held in place. What the
    # attempt gained (sliding, distance from the ground) and cost (sudden knees) is measured on the
    # result, by forward kinematics of the clip as it will be played.
    report(step, STEPS, "steps")
    levelled = clip if plan.is_own else _clearing(_levelled(clip, body, worlds, plan), body, plan)
    report(step + 1, STEPS, "steps")
    planted, lowered = _planted(levelled, body, body.worlds(levelled), plan)
    report(step + 2, STEPS, "steps")
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
        plan.n_glides,
        ground=min((height for each in plan.grounds for height in each), key=abs),
    )
    knees = (
        _knee_accelerations(each, body.legs, plan.spans, plan.rate) for each in (worlds, after)
    )
    return _Attempt(planted, changes, _acceleration_ratio(*knees))


def _planted(
    clip: SampledClip, body: BodyLegs, worlds: Floats, plan: _FootPlan
) -> tuple[SampledClip, float]:
    """Return the corrected motion, and how far the body was lowered."""
    up, joints = plan.up, body.chains.joints
    heights, straight = body.heights(worlds, up), body.straightness(worlds)
    shifts, sway = _foot_shifts(plan, body.feet(worlds), heights, straight)
    from_body = [shift - sway for shift in shifts]
    lowered = lowering(worlds[..., :3, 3], body.legs, from_body, plan.rate, up, _EXTENDED)
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


# The plan: contacts of all feet, and the heights of the ground under them.


@dataclass(frozen=True, slots=True, eq=False)
class _FootPlan:
    """Contacts of all feet, and the heights of the ground."""

    feet: list[FootPath]
    """Paths of the source's feet."""
    contacts: list[list[Contact]]
    """Contacts of each foot, in time order."""
    grounds: list[list[float]]
    """Height of the ground under the figure during each contact."""
    spans: list[tuple[int, int]]
    """Ranges of rows without gaps."""
    rate: float
    """Rows per second."""
    size: float
    """Approximate height of the body."""
    up: Floats
    """(3,). The up axis."""
    is_own: bool = False
    """Whether the feet are those of the body itself: clean-up of a capture."""
    n_glides: int = 0
    """Number of contacts that are left out because the feet glide too far."""

    def stances(self, foot: int) -> Iterator[tuple[Contact, slice, float]]:
        """Return the contacts of a foot, their rows, and the heights of the ground."""
        for contact, ground in zip(self.contacts[foot], self.grounds[foot], strict=True):
            yield contact, slice(contact.start, contact.stop), ground

    def steps(self, points: tuple[Floats, Floats], contact: Contact) -> Floats:
        """Return a planted foot's horizontal displacements from row to row, (n, 3)."""
        rows = slice(contact.start, contact.stop)
        toe, heel = (np.diff(path[rows], axis=0, prepend=path[rows][:1]) for path in points)
        moved = np.where(contact.on_toe[:, None], toe, heel)
        return moved - (moved @ self.up)[:, None] * self.up

    def slide(self, feet: Sequence[tuple[Floats, Floats]]) -> float:
        """Return the total distance that balls and heels slide while they are in contact."""
        total = 0.0
        for points, contacts in zip(feet, self.contacts, strict=True):
            for contact in contacts:
                total += float(np.linalg.norm(self.steps(points, contact), axis=1).sum())
        return total

    def holds(self) -> Floats:
        """Return the degree to which each foot is held on the ground, 0 to 1: (N, L)."""
        result = np.zeros((len(self.feet[0].toe), len(self.feet)))
        for foot in range(len(self.contacts)):
            for contact, rows, _ in self.stances(foot):
                result[rows, foot] = contact.hold
        return result

    def gap(self, heights: Floats) -> float:
        """Return planted feet's largest distance from the ground; ``heights`` (N, L): of soles."""
        stands, largest = self.holds() >= 1.0, 0.0
        for foot in range(len(self.contacts)):
            for _, rows, ground in self.stances(foot):
                gaps = np.abs(heights[rows, foot] - ground)[stands[rows, foot]]
                largest = max(largest, float(gaps.max(initial=0.0)))
        return largest

    def floor(self, foot: int) -> Floats:
        """Return the height (N,) below which a foot must not sink: the lower contact around it.

        It is higher in the air, while no other foot stands.
        """
        contacts, path = self.contacts[foot], self.feet[foot]
        rows = np.arange(len(path.toe))
        after = np.searchsorted([contact.start for contact in contacts], rows, side="right")
        before = np.maximum(after - 1, 0)
        after = np.minimum(after, len(contacts) - 1)
        levels = np.array(self.grounds[foot])
        lows = np.array([contact.height for contact in contacts])
        lowest = np.minimum(levels[before], levels[after])
        # Where the source's foot itself sinks below this ground, the limit follows it.
        sunk = np.minimum(lows[before], lows[after]) - path.lowest(self.up)
        lowest -= np.maximum(sunk - limits.SUNK * self.size, 0.0)
        # While no other foot stands, as of a person who kneels down, a foot that the source lifts
        # must not slide on the ground instead: it is lifted as well. Its limit follows a curve of
        # 0.06 s, as the knee would follow a sudden one: the knee ratio of kneeling would be 1.3
        # instead of 1.2. A curve of 0.15 s allows the foot to slide.
        # Near a contact of its own, the limit is that of the ground: one above a foot that is still
        # held, or held in the next row, would throw it up between two rows.
        holds, half = self.holds(), max(1, round(_LEVELS * self.rate))
        is_alone = 1.0 - np.delete(holds, foot, axis=1).max(axis=1, initial=0.0)
        is_alone *= 1.0 - envelope(holds[:, foot], half)
        raised = (is_alone * np.clip(-sunk, 0.0, limits.CLEARS * self.size))[:, None]
        smooth = _smoothed(self, raised, np.ones(len(raised)), _LEVELS)
        return lowest + np.clip(smooth, 0.0, raised)[:, 0]


def _foot_plan(
    feet: list[FootPath],
    spans: list[tuple[int, int]],
    rate: float,
    shape: tuple[float, float],
    up: Floats,
    ease: float,
    slips: float,
) -> _FootPlan:
    """Return the contacts of the source and the heights of the ground under the figure."""
    size, clearance = shape
    contacts = foot_contacts(feet, spans, rate, size, up, ease, slips)
    if not any(contacts):
        return _FootPlan(feet, contacts, [[] for _ in feet], spans, rate, size, up)
    level, is_usual = ground_level(contacts, size, clearance)
    ground = 0.0 if is_usual else level - clearance
    grounds = [[ground + step_height(one, level, size) for one in foot] for foot in contacts]
    return _FootPlan(feet, contacts, grounds, spans, rate, size, up)


def _own_plan(
    feet: list[FootPath],
    spans: list[tuple[int, int]],
    rate: float,
    size: float,
    up: Floats,
    heights: Floats,
    ease: float,
) -> _FootPlan:
    """Return the contacts of a capture's own feet, whose soles keep their heights, (N, L)."""
    found = foot_contacts(feet, spans, rate, size, up, ease, limits.SLIPS)
    free = _FootPlan(feet, found, [[] for _ in feet], spans, rate, size, up)
    contacts: list[list[Contact]] = []
    grounds: list[list[float]] = []
    for number, (foot, some) in enumerate(zip(feet, found, strict=True)):
        kept = []
        for contact in some:
            path = np.cumsum(free.steps((foot.toe, foot.heel), contact), axis=0)
            if np.linalg.norm(path - path.mean(axis=0), axis=1).max() <= limits.FARTHEST * size:
                kept.append(contact)
        contacts.append(kept)
        # The median of the rows that are held best: ends of a contact, where the foot still lands,
        # would raise it. Some holds never reach 1, so half of the contact's highest is the limit.
        rows = [np.flatnonzero(one.hold > 0.5 * one.hold.max()) + one.start for one in kept]
        grounds.append([float(np.median(heights[each, number])) for each in rows])
    n_glides = sum(map(len, found)) - sum(map(len, contacts))
    return replace(free, contacts=contacts, grounds=grounds, is_own=True, n_glides=n_glides)


# Level soles.
#
# Retargeting preserves the direction from the ankle to the ball. Where ankles have different
# heights, or the rest pose of a file is inexact, the sole is then tilted. While the ball and the
# heel of the source stand, the foot rotates until its sole is level; while only the ball stands,
# the toes rotate instead.


def _levelled(clip: SampledClip, body: BodyLegs, worlds: Floats, plan: _FootPlan) -> SampledClip:
    """Return a motion whose standing soles are level."""
    legs, up = body.legs, plan.up
    ankles, toes = [leg.ankle for leg in legs], [leg.toe for leg in legs]
    old = matrix_to_quaternion(unscaled(worlds[..., :3, :3]))
    holds, flat_holds = _holds(plan, legs)
    if not (holds > 0.0).any():
        return clip
    steady = _steadied(plan, np.stack([old[:, ankles], old[:, toes]]), holds)
    normals = np.stack([_normals(steady[0], body.level), _normals(steady[1], body.toe_level)])
    cosines = normals @ up
    flat_holds *= falling((_TILTED[1] - cosines) / (_TILTED[1] - _TILTED[0]))
    targets = _tilts(normals, up) * (flat_holds > 0.0)[..., None]
    # A row's weight is compared with s^4 of the smooth curve, s = _LEVELS seconds in rows: 168 at
    # 60 rows per second. 1 lets the tilt fade to its target 0; 10^6 of a fully held row enforces it
    # to a few ten-thousandths; the exponent in between lets the weight grow evenly over the orders
    # of magnitude, so that the curve tightens gradually as a foot lands.
    weights = 1.0 + flat_holds * 10.0 ** (_FLAT * flat_holds)
    weights, targets = weights.swapaxes(1, 2), targets.swapaxes(1, 2)
    tilts = _smoothed(plan, targets, weights, _LEVELS).swapaxes(1, 2)
    return _rotated(clip, body, old, multiply(rotation_vector_to_quaternion(tilts), steady))


def _holds(plan: _FootPlan, legs: Sequence[Leg]) -> tuple[Floats, Floats]:
    """Return how firmly feet and toes stand, and how firmly with flat soles: (2, N, L) each."""
    holds = np.zeros((2, len(plan.feet[0].toe), len(legs)))
    flat = np.zeros_like(holds)
    for foot, leg in enumerate(legs):
        if plan.feet[foot].toe is plan.feet[foot].heel:  # animals stand on their toes
            continue
        for contact, rows, _ in plan.stances(foot):
            holds[:, rows, foot] = contact.hold
            flat[0, rows, foot] = contact.hold * contact.is_flat
            flat[1, rows, foot] = contact.hold * contact.on_toe * (leg.toe != leg.ankle)
    return holds, flat


def _steadied(plan: _FootPlan, rotations: Floats, holds: Floats) -> Floats:
    """Return rotations, (2, N, L, 4), smoothed over time where feet stand."""
    # q and -q are one rotation. With signs that make neighbours nearest, the four components are
    # ordinary curves, and rotations of a standing foot differ by so little that smoothing the
    # components and normalising is smoothing the rotation (error of third order in the angle).
    rotations = rotations.copy()
    align_signs(rotations.swapaxes(0, 1))
    ones = np.ones_like(holds).swapaxes(1, 2)
    smooth = _smoothed(plan, rotations.swapaxes(1, 2), ones, _NOISE).swapaxes(1, 2)
    # A blend by the holds themselves would jump where a contact begins; their smooth curve rises
    # over _LEVELS seconds. It overshoots a little, so it is clipped to a fraction.
    blend = _smoothed(plan, holds[..., None].swapaxes(1, 2), ones, _LEVELS).swapaxes(1, 2)
    mixed = rotations + np.clip(blend, 0.0, 1.0) * (smooth - rotations)
    return mixed / np.linalg.norm(mixed, axis=-1, keepdims=True)


def _normals(rotations: Floats, rest: Floats) -> Floats:
    """Return the unit normals of soles (N, L, 3), given in the joints' spaces: ``rest`` (L, 3)."""
    found = np.einsum("nlab,lb->nla", quaternion_to_matrix(rotations), rest)
    return found / np.maximum(np.linalg.norm(found, axis=2, keepdims=True), 1e-30)


def _tilts(normals: Floats, up: Floats) -> Floats:
    """Return the smallest rotations from normals to the up axis, as rotation vectors."""
    axes = np.cross(normals, up)
    sines = np.linalg.norm(axes, axis=-1, keepdims=True)
    return axes / np.maximum(sines, 1e-30) * np.arctan2(sines, (normals @ up)[..., None])


def _clearing(clip: SampledClip, body: BodyLegs, plan: _FootPlan) -> SampledClip:
    """Return a motion whose feet in the air are levelled as far as they would touch the ground."""
    # A foot that swings points down. If it is longer than the source's relative to the leg, as a
    # shoe of a chibi is, its tip would sink, and the leg would have to bend to lift the ankle: by
    # up to 41 % of the leg's length, which turned shins by 64 degrees. A tilt that is reduced until
    # the sole just clears the ground is less conspicuous. What a level foot still lacks is lifted,
    # and so are feet that sink by no more than feet of a source do: their tilts are unchanged.
    worlds, up = body.worlds(clip), plan.up
    heights = body.heights(worlds, up)
    shifts, _ = _foot_shifts(plan, body.feet(worlds), heights, body.straightness(worlds), 0)
    ankles, toes = [leg.ankle for leg in body.legs], [leg.toe for leg in body.legs]
    old = matrix_to_quaternion(unscaled(worlds[..., :3, :3]))
    tilts = _tilts(_normals(old[:, ankles], body.level), up)
    shares = np.zeros((len(body.legs), clip.n_rows, 1))
    for foot in range(len(body.legs)):
        if not plan.contacts[foot] or plan.feet[foot].toe is plan.feet[foot].heel:
            continue
        missing = plan.floor(foot) - heights[:, foot] - shifts[foot] @ up
        sinks = np.flatnonzero(missing > _ROUNDING * plan.size)
        found = _shares(body, foot, worlds[sinks], tilts[sinks, foot], missing[sinks], up)
        deepest = float(missing.max(initial=0.0)) / (limits.SUNK * plan.size)
        shares[foot, sinks, 0] = found * (1.0 - falling(np.array(deepest - 1.0)))
    if not shares.any():
        return clip
    smooth = np.clip(_smoothed(plan, shares, np.ones(shares.shape[:2]), _LEVELS), 0.0, 1.0)
    change = rotation_vector_to_quaternion(smooth.swapaxes(0, 1) * tilts)
    new = np.stack([multiply(change, old[:, joints]) for joints in (ankles, toes)])
    return _rotated(clip, body, old, new)


def _shares(
    body: BodyLegs, foot: int, worlds: Floats, tilts: Floats, missing: Floats, up: Floats
) -> Floats:
    """Return the smallest shares of tilts (N, 3) by which a foot's sole rises enough: (N,).

    If none is enough, the one by which the sole is highest.
    """
    joints = np.unique(body.soles.movers[body.soles.feet == foot])
    pivots = worlds[:, body.legs[foot].ankle, :3, 3]
    shares, rises = np.linspace(0.0, 1.0, _N_SHARES), []
    unturned = body.heights(worlds, up)[:, foot]
    for share in shares:
        turns = np.tile(np.eye(4), (len(worlds), 1, 1))
        turns[:, :3, :3] = quaternion_to_matrix(rotation_vector_to_quaternion(share * tilts))
        turns[:, :3, 3] = pivots - np.einsum("nab,nb->na", turns[:, :3, :3], pivots)
        turned = worlds.copy()
        turned[:, joints] = turns[:, None] @ worlds[:, joints]
        rises.append(body.heights(turned, up)[:, foot] - unturned)
    rise = np.array(rises)
    is_enough = rise >= missing
    last = np.where(is_enough.any(axis=0), is_enough.argmax(axis=0), rise.argmax(axis=0))
    # Between two shares, the rise is interpolated.
    rows, before = np.arange(len(worlds)), np.maximum(last - 1, 0)
    low, high = rise[before, rows], rise[last, rows]
    part = np.clip((missing - low) / np.maximum(high - low, 1e-30), 0.0, 1.0)
    return shares[before] + part * (shares[last] - shares[before])


def _rotated(clip: SampledClip, body: BodyLegs, old: Floats, new: Floats) -> SampledClip:
    """Return a motion with new rotations of ankles and toes in the world, (2, N, L, 4)."""
    rotations, joints, parents = clip.rotations.copy(), body.chains.joints, body.chains.parents
    for foot, leg in enumerate(body.legs):
        ankle, above = new[0][:, foot], int(parents[leg.ankle])
        rotations[:, joints[leg.ankle]] = multiply(conjugate(old[:, above]), ankle)
        if leg.toe == leg.ankle:
            continue
        change = multiply(ankle, conjugate(old[:, leg.ankle]))
        outer = multiply(change, old[:, int(parents[leg.toe])])
        rotations[:, joints[leg.toe]] = multiply(conjugate(outer), new[1][:, foot])
    return replace(clip, rotations=rotations)


# Shifts of the feet and of the body.


@dataclass(frozen=True, slots=True, eq=False)
class _Wanted:
    """Corrections of one foot during its contacts."""

    across: Floats  # (N, 3), horizontal
    is_across: Bools  # (N,), whether a row has a horizontal correction
    rise: Floats  # (N,)
    holds: Floats  # (N,), degree to which the foot is held in place, 0 to 1
    above: Floats  # (N,), height of the sole above the floor


def _foot_shifts(
    plan: _FootPlan,
    points: list[tuple[Floats, Floats]],
    heights: Floats,
    straight: Floats,
    n_lifts: int = _LIFTS,
) -> tuple[list[Floats], Floats]:
    """Return translations of every foot, (N, 3) each, and of the body, (N, 3).

    ``heights`` (N, L): of the soles. ``straight`` (N, L): see ``BodyLegs.straightness``.
    ``n_lifts``: passes that lift sinking feet.
    """
    # The body follows planted feet, so that straight legs need not bend. Feet and body depend on
    # each other: a foot in the air moves with the body, and the body follows the feet on the
    # ground. So: 1. Feet relative to a body that is moved by one constant, the median rise. 2. The
    # body: the mean of its planted feet, and the quick part that they share. The mean is smooth and
    # has no quick part, so it need not be subtracted first. 3. Feet relative to this body, and the
    # quick part in which they still differ from it. 4. Feet relative to the final body.
    #
    # Step 3 is needed because smooth curves of feet in the air do not follow the body exactly. It
    # changes the body by at most 0.25 % of its size; one more round would change it by 0.16 %. The
    # knee ratio of the walk whose root jumps is 3.8
    # without the quick part, 0.79 (0.49 with short legs) if step 3 is left out, 0.79 (0.36) with
    # it, and the same after further rounds.
    every = [_wanted(plan, foot, points[foot], heights[:, foot]) for foot in range(len(points))]
    # A bent leg can lengthen, so its foot needs no help from the body; a straight one cannot.
    bent = falling((straight - _STRAIGHT[0]) / (_STRAIGHT[1] - _STRAIGHT[0]))
    # A leg counts as straight from the middle of the fade; a limit of 0.25 or 0.75 instead of 0.5
    # changes knee ratios by at most 2 %.
    rises = np.concatenate(
        [each.rise[(each.holds >= 1.0) & (bent[:, foot] < 0.5)] for foot, each in enumerate(every)]
    )
    median_rise = float(np.median(rises)) if len(rises) else 0.0
    still = np.tile(median_rise * plan.up, (len(heights), 1))
    shifts = _shifts(plan, every, still)
    sway = _sway(plan, shifts, 1.0 - bent, still) + _shake(plan, shifts)
    sway += _shake(plan, [shift - sway for shift in _shifts(plan, every, sway)])
    return _shifts(plan, every, sway, n_lifts), sway


def _wanted(plan: _FootPlan, foot: int, points: tuple[Floats, Floats], heights: Floats) -> _Wanted:
    """Return the corrections of a foot."""
    path = plan.feet[foot]
    across, rise = np.zeros_like(points[0]), np.zeros(len(heights))
    is_across, holds = np.zeros(len(heights), dtype=np.bool_), np.zeros(len(heights))
    low = path.lowest(plan.up)
    for contact, rows, ground in plan.stances(foot):
        # With hold h, the foot is to move by (1 - h) times the step of the source's foot: not at
        # all while it stands, like the source when it leaves. A capture's own steps are noise, so
        # there the correction only gets weaker. The correction is the wanted path minus the actual
        # one, shifted so that its mean over the contact is 0: it prefers no direction of the slide.
        loose = np.zeros_like(contact.hold) if plan.is_own else 1.0 - contact.hold
        wanted = loose[:, None] * plan.steps((path.toe, path.heel), contact)
        steps = np.cumsum(plan.steps(points, contact) - wanted, axis=0)
        across[rows], is_across[rows] = steps.mean(axis=0) - steps, True
        holds[rows] = contact.hold
        away = low[rows] - _standing_heights(low[rows], contact)
        rise[rows] = ground + loose * away - heights[rows]
    if not is_across.any():
        return _Wanted(across, is_across, rise, holds, np.full_like(rise, np.inf))
    return _Wanted(across, is_across, rise, holds, heights - plan.floor(foot))


def _standing_heights(low: Floats, contact: Contact) -> Floats:
    """Return the heights (N,) from which the source's foot rises in the rows of a contact."""
    # A standing foot may drift. When it lifts, its correction continues from there without a jump.
    held = np.flatnonzero(contact.hold >= 1.0)
    if len(held) == 0:
        return np.full_like(low, contact.height)
    return np.interp(np.arange(len(low)), held, low[held])


def _shifts(plan: _FootPlan, every: list[_Wanted], base: Floats, n_lifts: int = 0) -> list[Floats]:
    """Return feet's translations (N, 3), ``base`` far from contacts; ``n_lifts``: passes."""
    # Everything is relative to the body, base: then 0 is the target of a foot in the air, which is
    # what smooth curves with weight 1 decay to. Each foot has two curves, because lifting adds
    # weight to the vertical one only: entries [0, count) of the first axis are horizontal, with 3
    # components, entries [count, 2 count) vertical, with 1 (the others stay 0).
    up, count = plan.up, len(every)
    lift = base @ up
    aside = base - lift[:, None] * up
    targets = np.zeros((2 * count, *base.shape))
    weights = np.zeros((2 * count, len(base)))
    for foot, wanted in enumerate(every):
        targets[foot] = np.where(wanted.is_across[:, None], wanted.across - aside, 0.0)
        targets[count + foot, :, 0] = np.where(wanted.holds > 0.0, wanted.rise - lift, 0.0)
        weights[[foot, count + foot]] = wanted.holds
    if not plan.is_own:
        targets = _calmed(plan, targets, weights)
    found = _smoothed(plan, targets, strength(weights))
    # A curve misses its targets by about s^4 over the weight, 1e-5 of its bend for a held foot. A
    # standing foot must be exact, so its rows are set to the targets.
    #
    # A swinging foot may now sink into the ground: its curve c must be at least ``least``, the
    # distance to the floor. The method of multipliers (Nocedal & Wright 2006, section 17.3) adds to
    # the sum that the curve minimises, for every sinking row, the penalty
    #
    #     m (least - c) + p/2 (least - c)^2 = p/2 (least + m / p - c)^2 + a constant,
    #
    # which is a term w (t - c)^2 of the curve's own sum with weight w = p/2 and target
    # t = least + m / p. w is a quarter of the stiffness s^4. After each pass, m grows by
    # p (least - c), so t grows by what is still missing, least - c. The first time
    # that a row sinks, m = 0 gives least = c + (least - c); if the row's own target is above c, it
    # takes the place of c, so that lifting never lowers a target. In a row that has risen above
    # least, m keeps its value, where the exact method would let it shrink: seven passes then leave
    # half as much (0.015 instead of 0.03 % of the body), but knees of kneeling move more suddenly
    # (a knee ratio of 1.26 instead of 1.01). The neighbours rise with the row, and the foot passes
    # just above the ground, without a kink where it would have touched.
    result, lifted = [], 1.0 + _LIFTED * (_EASE * min(plan.rate, _DENSE)) ** 4
    for foot, wanted in enumerate(every):
        row = count + foot
        stands, held = wanted.holds[:, None] >= 1.0, targets[row, :, :1]
        across = np.where(stands, targets[foot], found[foot])
        rise = np.where(stands, held, found[row, :, :1])
        least = np.where(stands, -np.inf, -wanted.above[:, None] - lift[:, None])
        goals, force = targets[row : row + 1, :, :1].copy(), strength(weights[row : row + 1])
        for _ in range(n_lifts):
            missing = (least - rise)[:, 0]
            sinks = missing > 0.0
            if not sinks.any():
                break
            goals[0, sinks, 0] = np.maximum(goals[0, sinks, 0], rise[sinks, 0]) + missing[sinks]
            force[0, sinks] = np.maximum(force[0, sinks], lifted)
            rise = np.where(stands, held, _smoothed(plan, goals, force)[0])
        result.append(aside + across + (lift[:, None] + rise) * up)
    return result


def _calmed(plan: _FootPlan, targets: Floats, holds: Floats) -> Floats:
    """Return targets of held rows without the source's sudden jumps, which knees would absorb."""
    # A jump is what a curve of 0.03 s does not follow: ``smooth`` is the target without it. A
    # target is a correction, the held place of the foot minus its uncorrected place. If the latter
    # jumps, a target without the jump lets the foot jump along with the source, and the leg need
    # not bend to hide it. Below 0.2 % of the body (3 mm) a jump is noise that the foot may hide,
    # above 0.4 % the foot jumps along, in between partly. Heights change by at most 0.07 % (1 mm):
    # a foot above the ground is seen more easily than one that slips.
    smooth = _smoothed(plan, targets, holds + 1e-6, _JUMP)
    away = np.linalg.norm(targets - smooth, axis=2, keepdims=True) / plan.size
    jumps = 1.0 - falling((away - _JUMPS[0]) / (_JUMPS[1] - _JUMPS[0]))
    left = jumps * (smooth - targets) * (holds > 0.0)[..., None]
    half = len(targets) // 2
    left[half:] = np.clip(left[half:], -_GAP * plan.size, _GAP * plan.size)
    return targets + left


def _smoothed(plan: _FootPlan, targets: Floats, weights: Floats, seconds: float = _EASE) -> Floats:
    """Return smooth curves, (..., N, C), with weights (..., N); gaps in time separate them."""
    result = np.empty_like(targets)
    for start, stop in plan.spans:
        rows = targets[..., start:stop, :], weights[..., start:stop]
        result[..., start:stop, :] = smooth_curves(*rows, seconds * plan.rate)
    return result


def _sway(plan: _FootPlan, shifts: list[Floats], weights: Floats, still: Floats) -> Floats:
    """Return planted feet's mean translation (N, 3), smooth over time; ``still`` without any."""
    # In each row, the weighted mean of the shifts of the feet on the ground. The default
    # translation takes part with a small weight: it decides in flight and hardly counts beside a
    # planted foot, without a division by 0 or a case in between.
    sums, total = _FLIGHT * still, np.full((len(still), 1), _FLIGHT)
    for foot, shift in enumerate(shifts):
        for contact, rows, _ in plan.stances(foot):
            weight = (weights[rows, foot] * contact.hold)[:, None]
            sums[rows] += weight * shift[rows]
            total[rows] += weight
    mean = sums / total
    # The mean jumps when a foot lands or leaves. A moving average of 0.3 s makes a ramp of the
    # jump, a second one rounds the corners of the ramp: the body moves without sudden velocity.
    # Each is a difference of cumulated sums, with the ends of a span continued by their values.
    half = max(1, round(_SWAY * plan.rate))
    for start, stop in plan.spans:
        for _ in range(2):
            padded = np.pad(mean[start:stop], ((half, half), (0, 0)), mode="edge")
            sums = np.cumsum(np.pad(padded, ((1, 0), (0, 0))), axis=0)
            mean[start:stop] = (sums[2 * half + 1 :] - sums[: -2 * half - 1]) / (2 * half + 1)
    return mean


def _shake(plan: _FootPlan, shifts: list[Floats]) -> Floats:
    """Return the quick translation (N, 3) that planted feet share: noise of the source's root."""
    # This noise moves body and feet alike: if the feet stay in place and the body does not follow
    # them, it moves the knees. Noise of one leg must not move the others.
    #
    # Quick: what a smooth curve of 0.1 s does not follow. The weight of a foot is the fourth power
    # of its smoothed hold, so that a foot counts only well inside a contact, where its shift is
    # exact: a hold of 0.5 counts 6 %. With the hold itself, the knee ratio of kneeling is 1.38
    # instead of 1.26.
    own = np.stack(shifts)
    ones = np.ones(own.shape[:2])
    quick = own - _smoothed(plan, own, ones, _SHAKE)
    holds = _smoothed(plan, plan.holds().T[..., None], ones, _SHAKE)
    holds = np.clip(holds, 0.0, 1.0) ** 4
    total = holds.sum(axis=0)
    mean = np.einsum("lnc,lna->na", holds, quick) / np.maximum(total, 1.0)
    squares = np.einsum("lnc,lna->nc", holds, quick**2) / np.maximum(total, 1.0)
    # The weighted mean m of the shifts x_l and the mean of their squares: |m|^2 = E|x|^2 exactly if
    # all are equal, and |m|^2 is about E|x|^2 / L if L feet move independently. The ratio is 1 if
    # all feet have the same translation, less if they differ. Its square lets a quarter, not half,
    # of the mean of two independent feet pass; it changes knee ratios by at most 3 %.
    agreement = (mean**2).sum(axis=1, keepdims=True) / np.maximum(squares, 1e-30)
    return np.minimum(agreement, 1.0) ** 2 * mean


def _knee_accelerations(
    worlds: Floats, legs: Sequence[Leg], spans: Sequence[tuple[int, int]], rate: float
) -> Floats:
    """Return the largest angular acceleration of each knee (L,), rad/s^2."""
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


def lock_feet(
    figure: Figure, clip: SampledClip, up: int, way: float = 1.0
) -> tuple[SampledClip, PlantedFeet]:
    """Hold feet still while they stand, as far as legs reach; ``way``: -1 if ``up`` points down."""
    clip = in_frame_order(clip)
    legs = legs_of(figure.require_skeleton())
    rest_up = axis_vector(figure.up)
    body = body_legs(figure, clip, legs, rest_up) if legs and clip.n_rows else None
    if body is None or body.size <= 0.0:
        return clip, PlantedFeet()
    planted, changes = plant(clip, body, body.worlds(clip), way * np.eye(3)[up])
    if not changes.is_better:  # the motion is unchanged
        changes = replace(changes, after=changes.before, lowered=0.0)
    return planted, changes
