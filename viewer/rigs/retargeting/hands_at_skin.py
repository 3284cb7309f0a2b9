"""Hands of a driven figure, moved until their gaps from its skin are those of the source's."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from viewer.data_classes import dataclass
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.feet.body import spans_of
from viewer.rigs.feet.curves import falling, smooth_curves
from viewer.rigs.feet.legs import bend, hinges, unscaled
from viewer.rigs.geometry.rotation import quaternion_to_matrix
from viewer.rigs.geometry.vectors import lengths_of, unit
from viewer.rigs.motion.timing import Timing
from viewer.rigs.retargeting.body_joints import (
    ARMS,
    EXTENDED,
    TRUNK,
    Body,
    bones,
    from_bone,
    region_of,
    together_in,
    within_reach,
)
from viewer.rigs.retargeting.figure_skin import Singles, Solid, batches, encloses
from viewer.rigs.retargeting.person_skin import UNSURE, Person, nearness_of

# Lengths of the smooth curve of a hand's shift to the skin, seconds: where it does not touch, and
# where it does. A power of the contact lies between them, so that hands that only come near do not
# bend the curve.
_FADE, _STEADY, _POWER = 0.3, 0.08, 8
_LITTLE = 0.01  # weight of the place that is known without the skin
UNCHANGED = 1e-4  # shifts that are no change
_WHOLE = 400  # points that decide whether another is inside, at least
_DEEP = 0.2  # distance up to which skin is near a hand: half the width of a stout body
# Cosine of the angle to the normal of the nearest point from which a point is inside. Beyond the
# edge of something thin, or of an open mesh, the nearest point is aside.
_BEHIND = 0.5
# Hands are moved in rounds, at most so far in each. Gaps that are wider than those of the source
# by less than the first are closed, by more than the second are between other parts.
_ROUNDS, _FAST, _PULL = 12, 0.12, (0.06, 0.12)
_PLACED = 30.0  # frames per second in which hands are placed
_NOWHERE = 1e3  # coordinates of no point, relative to the height
_ALMOST = 1.0 - 1e-6  # the curve leaves many arms exactly as long as possible, but for rounding


def shifts_at_skin(
    body: Body, solid: Solid, other: Body, person: Person, to_target: Floats, shifts: Floats,
    timing: Timing,
) -> Floats:  # fmt: skip
    """Return smooth shifts (2, N, 3) of wrists with which hands keep the gaps of the source.

    ``to_target``: (3, 3), from the axes of the source, ``other``, to those of the figure.
    ``shifts``: (2, N, 3), those that are known without the skin.
    """
    aims = _aims(body, solid, other, person, to_target, shifts)
    # Directions out: from the trunk, and from the other forearm and hand where the hands touch.
    apart, together = other.between_wrists() @ to_target.T, together_in(other)
    across = np.where(together[:, None] > 0.0, unit(apart), 0.0)
    trunk = [_side(other, number) @ to_target.T for number in range(len(ARMS))]
    sides = np.stack([trunk, [-across, across]], axis=2)
    # Free rows pull the curve to 0 with a weight of 1, rows at the skin to their targets, so that
    # waves longer than _STEADY pass. It also goes through rows between those that are placed.
    pulls = (_FADE / _STEADY) ** 4 * person.holds**_POWER
    every = max(round(timing.frame_rate / _PLACED), 1)
    is_placed = np.zeros(aims.shape[1], dtype=bool)
    for start, stop in spans_of(timing):
        is_placed[start:stop:every] = True
    pulls = np.where(is_placed, every * pulls, 0.0)
    targets, touches = aims.copy(), np.where(is_placed, person.touches, 0.0)
    result = _faded(body, targets, pulls, timing)
    # Hands that are in the body of the source may be as deep in the figure's.
    gaps = person.hand - np.clip(person.hand, -UNSURE, UNSURE)
    arms = _Arms(body, np.flatnonzero(touches.any(axis=0)).astype(np.int32))
    arms.bend(result)
    near = [
        skin
        for number, touching in enumerate(touches)
        for skin in _near(
            solid, number, np.flatnonzero(touching).astype(np.int32), result[number], arms
        )
    ]
    for _ in range(_ROUNDS if near else 0):
        farthest = 0.0
        for skin in near:
            number, rows = skin.number, skin.rows
            step = _steps(skin, result, arms, solid.area, gaps, sides)
            length = lengths_of(step)
            # The next curve starts from this one, so that steps which it smooths do not add up.
            part = np.where(length > UNCHANGED, touches[number, rows], 0.0)
            wished = part[:, None] * (result[number, rows] + step)
            targets[number, rows] = (1.0 - part)[:, None] * targets[number, rows] + wished
            farthest = max(farthest, float((part * length).max()))
        # Hands that went through each other do not touch any more: they go back, at once.
        found = body.between_wrists() + result[1] - result[0]
        is_crossed = is_placed & (np.einsum("na,na->n", found, apart) < 0.0)
        half = np.where(is_crossed, 0.5 * together, 0.0)[:, None] * (apart - found)
        targets += np.stack([-half, half])
        farthest = max(farthest, float(lengths_of(half).max()))
        if farthest < UNCHANGED:
            break
        result = _faded(body, targets, pulls, timing)
        arms.bend(result)
    return result


def _aims(
    body: Body, solid: Solid, other: Body, person: Person, to_target: Floats, shifts: Floats
) -> Floats:
    """Return shifts (2, N, 3) that put wrists as far from the skin as in the source, roughly."""
    result = np.empty_like(shifts)
    for number, arm in enumerate(ARMS):
        own, is_held = body.at(arm[2]), person.holds[number] > 0.0
        total, weights = _LITTLE * shifts[number], np.full(len(own), _LITTLE)
        for name, gap in person.wrist[number].items():
            around = [bone for bone in bones(body.place) if region_of(*bone) == name]
            found = [from_bone(other, arm[2], *bone) for bone in around]
            distances = np.linalg.norm([away for away, _ in found], axis=2)
            for (start, end), (away, along), distance in zip(around, found, distances, strict=True):
                weight = nearness_of(gap + distance - distances.min(axis=0))
                weight = np.where(is_held, weight, 0.0)
                nearest = body.at(start) + along[:, None] * (body.at(end) - body.at(start))
                way = unit(away @ to_target.T)
                radius = solid.radii(name, nearest, way, weight > 0.0)
                weight[np.isnan(radius)] = 0.0
                ends = nearest + (np.nan_to_num(radius) + gap)[:, None] * way
                total += weight[:, None] ** 2 * (ends - own)
                weights += weight**2
        result[number] = total / weights[:, None]
    # Hands that touch each other move by half of the difference each.
    found = body.between_wrists() + result[1] - result[0]
    half = 0.5 * together_in(other)[:, None] * (other.between_wrists() @ to_target.T - found)
    return result + np.stack([-half, half])


def _faded(body: Body, targets: Floats, pulls: Floats, timing: Timing) -> Floats:
    """Return curves (2, N, 3) through targets at the skin, which fade around them, within reach.

    ``pulls``: (2, N), weights of the targets, relative to the weight of staying.
    """
    result = np.empty_like(targets)
    for start, stop in spans_of(timing):
        rows = slice(start, stop)
        weights = 1.0 + pulls[:, rows]
        aims = (pulls[:, rows] / weights)[..., None] * targets[:, rows]
        result[:, rows] = smooth_curves(aims, weights, _FADE * timing.frame_rate)
    return np.stack([within_reach(body, arm, each) for arm, each in zip(ARMS, result, strict=True)])


def _side(other: Body, number: int) -> Floats:
    """Return the direction of a wrist from the nearest bone of the trunk: (N, 3)."""
    trunk = pairwise([name for name in TRUNK if name in other.place])
    ways = np.stack([from_bone(other, ARMS[number][2], *bone)[0] for bone in trunk])
    nearest = np.linalg.norm(ways, axis=2).argmin(axis=0)
    side: Floats = unit(ways[nearest, np.arange(ways.shape[1])])
    return side


class _Arms:
    """Arms of a body in some rows of its motion, as their wrists move."""

    def __init__(self, body: Body, rows: Ints) -> None:
        self.rows = rows
        self.joints = [
            (body.at(shoulder)[rows], body.at(elbow)[rows], body.at(wrist)[rows])
            for shoulder, elbow, wrist in ARMS
        ]
        across = self.joints[0][0] - self.joints[1][0]
        uppers = [unscaled(body.world[rows, body.place[arm[0]], :3, :3]) for arm in ARMS]
        self.axes = [
            hinges(upper, points, across) for upper, points in zip(uppers, self.joints, strict=True)
        ]

    def bend(self, shifts: Floats) -> None:
        """Move the wrists by shifts (2, N, 3), of which those in the rows count."""
        self.shifts = shifts[:, self.rows]
        # Of each part of an arm, and of all others in the end: x' = A x + b.
        self.linear = np.tile(np.eye(3), (len(ARMS), len(self.rows), 4, 1, 1))
        self.offsets = np.zeros((len(ARMS), len(self.rows), 4, 3))
        for arm, (points, shift) in enumerate(zip(self.joints, self.shifts, strict=True)):
            shoulder, elbow, wrist = points
            turns = bend(*points, wrist + shift, self.axes[arm])
            upper, lower = (quaternion_to_matrix(turn) for turn in turns)
            bent = shoulder + np.einsum("rab,rb->ra", upper, elbow - shoulder)
            self.linear[arm, :, :2] = np.stack([upper, lower], axis=1)
            self.offsets[arm, :, 0] = shoulder - np.einsum("rab,rb->ra", upper, shoulder)
            self.offsets[arm, :, 1] = bent - np.einsum("rab,rb->ra", lower, elbow)
            self.offsets[arm, :, 2] = shift

    def moved(self, arm: int, rows: Ints, parts: Ints, points: Floats) -> Floats:
        """Return points (R, P, 3) of the skin, of which some parts (R, P) are those of an arm.

        All are where they are without changes of the arms.
        """
        if (parts < 0).all():
            return points
        index = np.searchsorted(self.rows, rows)[:, None]
        return self.turned(arm, rows, parts, points) + self.offsets[arm, index, parts]

    def turned(self, arm: int, rows: Ints, parts: Ints, normals: Floats) -> Floats:
        """Return the normals (R, P, 3) at such points."""
        index = np.searchsorted(self.rows, rows)[:, None]
        return np.einsum("rpab,rpb->rpa", self.linear[arm, index, parts], normals)

    def swung(self, arm: int, rows: Ints, steps: Floats) -> Floats:
        """Return steps (R, 3) of a wrist; those of straight arms swing about the shoulder."""
        index = np.searchsorted(self.rows, rows)
        shoulder, elbow, wrist = (each[index] for each in self.joints[arm])
        longest = _ALMOST * EXTENDED * (lengths_of(elbow - shoulder) + lengths_of(wrist - elbow))
        line = wrist + self.shifts[arm, index] - shoulder
        outward = np.einsum("ra,ra->r", unit(line), steps)
        # Along the tangent t, the way s out of the skin takes s^2 / t.
        swing = steps - outward[:, None] * unit(line)
        length = np.einsum("ra,ra->r", steps, steps) / np.maximum(lengths_of(swing), 1e-30)
        is_straight = (outward > 0.0) & (lengths_of(line) >= longest)
        swing = np.minimum(length, _FAST)[:, None] * unit(swing)
        return np.where(is_straight[:, None], swing, steps)


@dataclass(frozen=True, slots=True, eq=False)
class _NearSkin:
    """A hand and the skin near it in some rows, where they are without changes of the arms."""

    number: int
    """0 or 1, as of ``ARMS``."""
    rows: Ints
    """(R,). Rows of the motion."""
    own: Floats
    """(R, H, 3). Points of the hand."""
    parts: Ints
    """(R, P). Parts of the points of the skin, as in ``SkinPoints``."""
    points: Floats
    normals: Floats
    """(R, P, 3). Rows with fewer points have some that are far from everything."""
    whole: Singles
    """(2, R, S, 3). Points and normals of the skin without the hand's arm, in single precision."""
    area: float
    """Area of the piece of the skin at each of these."""


def _near(
    solid: Solid, number: int, rows: Ints, shifts: Floats, arms: _Arms
) -> Iterator[_NearSkin]:
    """Yield batches of rows of a hand that is moved by shifts (N, 3), with the skin near it."""
    others = solid.points.skin[solid.points.arms[solid.points.skin] != number]
    for batch in batches(rows):
        own = solid.posed(batch, solid.points.hands[number])[0]
        points, normals = solid.posed(batch, others)
        parts = np.broadcast_to(solid.points.parts[others], points.shape[:2])
        moved = arms.moved(1 - number, batch, parts, points)
        ends = own + shifts[batch, None]
        centres = ends.mean(axis=1, keepdims=True)
        reach = lengths_of(ends - centres).max(axis=1, keepdims=True) + _DEEP
        is_near = lengths_of(moved - centres) < reach
        holds, row = np.flatnonzero(is_near.any(axis=1)), np.arange(len(own))[:, None]
        if not len(holds):
            continue
        # Those that are near come first.
        order = np.argsort(~is_near, axis=1, kind="stable")[:, : is_near.sum(axis=1).max()]
        near = np.where(is_near[row, order][..., None], points[row, order], _NOWHERE)
        some = slice(None, None, max(len(others) // _WHOLE, 1))
        whole = np.stack([points, normals])[:, :, some].astype(np.float32)
        yield _NearSkin(
            number, batch[holds], own[holds], parts[row, order][holds], near[holds],
            normals[row, order][holds], whole[:, holds], some.step * solid.area,
        )  # fmt: skip


def _steps(
    skin: _NearSkin, shifts: Floats, arms: _Arms, area: float, gaps: Floats, sides: Floats
) -> Floats:
    """Return translations (R, 3) of a hand to its gaps from the skin near it.

    ``area``: of the piece of the skin at each point; ``gaps``: (2, N), of the hands; ``sides``:
    (2, N, 2, 3), directions in which the hands are from the trunk, and from the other hand.
    """
    number, rows, parts = skin.number, skin.rows, skin.parts
    own, row = skin.own + shifts[number, rows, None], np.arange(len(rows))[:, None]
    others = arms.moved(1 - number, rows, parts, skin.points)
    squares = np.einsum("rpa,rpa->rp", others, others)[:, None]
    nearest = (squares - 2.0 * own @ others.swapaxes(1, 2)).argmin(axis=2)
    part, away = parts[row, nearest], own - others[row, nearest]
    outward = arms.turned(1 - number, rows, part, skin.normals[row, nearest])
    heights = np.einsum("rha,rha->rh", away, outward)
    distances = lengths_of(away)
    aside = np.sqrt(np.maximum(distances**2 - heights**2, 0.0))
    is_inside = heights < -_BEHIND * distances
    # Behind the inner face of a piece of armour is no inside.
    deep = is_inside & (heights < -UNSURE)
    unsure = np.flatnonzero(deep.any(axis=1))
    if len(unsure):
        whole, normals_there = skin.whole[:, unsure]
        # The deep points of each row come first.
        most = deep.sum(axis=1).max()
        at = unsure[:, None], np.argsort(~deep[unsure], axis=1, kind="stable")[:, :most]
        is_inside[at] &= ~deep[at] | encloses(whole, normals_there, skin.area, own[at])
    # Points of the skin are discs as wide as the distances between them.
    disc = np.sqrt(area / np.pi)
    clear = np.where(is_inside, heights, np.hypot(heights, np.maximum(aside - disc, 0.0)))
    row, first = row[:, 0], clear.argmin(axis=1)
    missing = np.maximum(gaps[number, rows, None] - clear, 0.0)
    # What is farther is another part than the source's hand touches.
    excess = clear[row, first] - gaps[number, rows]
    near = falling((excess - _PULL[0]) / (_PULL[1] - _PULL[0]))
    pull = -(near * excess)[:, None] * unit(away[row, first])
    # The mean direction out, on the side of the part on which the hand is.
    part = part[..., None]
    trunk, hand = (sides[number, rows, None, which] for which in (0, 1))
    ways = np.where(part < 0, trunk, np.where(part > 0, hand, 0.0))
    inwards = np.minimum(np.einsum("rha,rha->rh", outward, ways), 0.0)
    way = unit(np.einsum("rh,rha->ra", missing, outward - inwards[..., None] * ways))
    cosine = np.maximum(np.einsum("ra,ra->r", way, outward[row, first]), 0.5)
    push = np.minimum(missing[row, first] / cosine, _FAST)[:, None] * way
    # Of two hands, each gives way by half.
    give = np.where(part[row, first, 0] == 2, 0.5, 1.0)
    step = give[:, None] * np.where((missing[row, first] > 0.0)[:, None], push, pull)
    return arms.swung(number, rows, step)
