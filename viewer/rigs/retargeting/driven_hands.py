"""Hands of a driven figure: kept at its body where those of its source are at their own.

Retargeting preserves the directions of limbs, so hands that rest on a hip, touch the head or clap
miss if proportions differ. Near a part of the body, a wrist gets the place relative to that part
that it has in the source, scaled by the height; elbow and shoulder follow. If the figure has a
skin, what counts is the gap between the hand and the skin instead: hands come as near to it as
those of the source do, whose skin is estimated from the joints, and touch it where those do. Hands
of long arms stay above the ground if those of the source do.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import chain, pairwise

import numpy as np
from numpy.typing import NDArray

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, note
from viewer.phrases import Remedy
from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.cleanup.frames import in_frame_order
from viewer.rigs.feet.body import (
    chain_worlds,
    chains_to,
    is_solvable,
    rest_worlds,
    shape_of,
    spans_of,
)
from viewer.rigs.feet.curves import falling, smooth_curves, strength
from viewer.rigs.feet.legs import Leg, bend, hinges, leg_rotations, unscaled
from viewer.rigs.feet.soles import Soles, soles_of_feet
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.rotation import quaternion_to_matrix
from viewer.rigs.geometry.samples import sample_surface
from viewer.rigs.geometry.vectors import axis_vector, lengths_of, unit
from viewer.rigs.hierarchy import descendants
from viewer.rigs.kinematics import world_matrices
from viewer.rigs.mesh import area_vectors
from viewer.rigs.motion.evaluation import rest_translations_of
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.pose import rest_pose
from viewer.rigs.retargeting.retarget import Retargeted
from viewer.rigs.scalars import length_text
from viewer.rigs.shape import rest_joints, shaped
from viewer.rigs.skeleton import Skeleton
from viewer.rigs.skin import owners, strongest_influences

# Parts of the body as chains of joints; the bones between those that are matched count.
_PARTS = (
    ("pelvis", "spine1", "spine2", "spine3", "neck", "head", "crown"),
    ("left_hip", "left_knee"), ("right_hip", "right_knee"),
)  # fmt: skip
# The right side first: so elbows bend the other way than knees, see ``hinges``.
_ARMS = tuple(
    tuple(f"{side}_{part}" for part in ("shoulder", "elbow", "wrist")) for side in ("right", "left")
)
_TOPS = ("neck", "head")  # the upper end of the height, the first that is matched
_LEG = ("left_hip", "left_knee", "left_ankle")
_FEET = tuple(tuple(f"{side}_{part}" for part in ("foot", "ankle")) for side in ("right", "left"))

# Distances of a wrist from the axis of a part, relative to the height from ankles to neck: up to
# the first, it touches the part, beyond the second it is free. A person's wrist is 0.12 to 0.14
# away with the hand on a hip or on the head, and 0.13 to 0.17 where the arm hangs beside a thigh.
_NEAR, _FAR = 0.14, 0.24
_TOGETHER, _APART = 0.08, 0.17  # the same for two wrists: 0.06 where hands clap
# Distance from where a hand should be that is left, so that limbs keep their directions: about 2 %
# of the height of a person.
_SLACK = 0.025
# The length s of the smooth curve of a hand's shift, seconds; as for feet, see ``planting``.
_EASE = 0.15
_EXTENDED = 0.97  # maximum extension of an arm: its elbow is bent by 28 degrees
_ALMOST = 1.0 - 1e-6
_SHORT = 0.005  # smallest miss of straight arms that is reported: a fifth of _SLACK
# Height of the crown above the head's joint where nothing shows it: 0.11 to 0.2 for people, of whom
# most files have the joint at the ears, some at the chin.
_CROWN = 0.15

_GIRTH = 75.0  # percentile of the distances of the skin from a thigh that is taken as its radius

# Gaps between a wrist of the motion and the skin of a part, relative to the height: up to the
# first, it is at the part, beyond the second it is not. A person's wrist is 0.03 to 0.07 away with
# the hand on a hip or on the head.
_WRIST_AT, _WRIST_OFF = 0.06, 0.13
# Gaps between a hand and the skin likewise: up to the first, it touches the skin, beyond the second
# it does not: 0.1 where the arm hangs beside a thigh.
_TOUCHING, _OFF = 0.02, 0.07
# Error of these gaps, because a person's skin is only estimated.
_UNSURE = 0.02
# Lengths of the smooth curve of a hand's shift to the skin, seconds, as _EASE: where it does not
# touch, and where it does. A power of the contact lies between them, so that hands that only come
# near do not bend the curve.
_FADE, _STEADY, _POWER = 0.3, 0.08, 8
_LITTLE = 0.01  # weight of the place that is known without the skin
_NONE = 1e-4  # shifts that are no change

# The skin of people whose motion has none consists of tapered capsules, with lengths relative to
# the height from ankles to neck. They are fitted to the surface of the bundled body, from which
# they are up to 0.015 away. Those of the trunk: the ends as fractions of the way from pelvis to
# neck, how far these are before it, and the radii there.
_TRUNK = (
    ((0.0, 0.02, 0.09), (0.31, 0.05, 0.06)),
    ((0.31, 0.05, 0.06), (0.63, 0.03, 0.105)),
    ((0.63, 0.03, 0.105), (1.0, -0.005, 0.042)),
)  # fmt: skip
# From part of the way to a hip to part of the way to a shoulder: before it, and radius.
_FLANK = ((0.32, 0.027, 0.08), (0.73, -0.005, 0.048))
_NECK = 0.042
# Above the head's joint, before it, radius; of chin and crown.
_HEAD = ((0.013, 0.035, 0.058), (0.069, 0.012, 0.071))
_THIGH, _ARM, _HAND = (0.082, 0.045), (0.047, 0.027, 0.018), 0.013
_HAND_LENGTH = 0.125
# Points beside the axis of a hand, along and across it: of the thumb, of first and last fingers.
_ASIDE = ((0.035, 0.025), (0.065, 0.052), (0.1, 0.02), (0.1, -0.02), (0.05, -0.025))

# Points of the skin, between which a person has about 3 cm, and those of a hand that are kept
# outside the others.
_POINTS, _HAND_POINTS = 2000, 24
_DISC = 0.012  # radius of the piece of the skin around a point
_DEEP = 0.2  # distance up to which skin is near a hand: half the width of a stout body
_FEWER = 4  # of so many points, one counts for whether another is inside
_BLUNT = 0.04  # radius of the end of a hand that comes along a ray
# Cosine of the angle to the normal of the nearest point from which a point is inside. Beyond the
# edge of something thin, or of an open mesh, the nearest point is aside.
_BEHIND = 0.5
# Winding number between that of points of a closed skin, 1/2, and of an open sheet, 0.
_SOLID = 0.25
# Hands are moved in rounds, at most so far in each. Gaps that are wider than those of the source
# by less than the first are closed, by more than the second are between other parts.
_ROUNDS, _FAST, _PULL = 12, 0.12, (0.06, 0.12)
_PLACED = 30.0  # frames per second in which hands are placed
_BATCH = 64  # rows that are computed at once
_NOWHERE = 1e3  # coordinates of no point, relative to the height


@dataclass(frozen=True, slots=True)
class KeptHands:
    """How far hands are from where they should be."""

    before: float
    after: float
    """Mean distances, relative to the height from ankles to neck, weighted by nearness; 0 if no
    hand was moved to the body."""
    least: float = 0.0
    """The same distance with straight arms: what is left because they are too short."""
    lifted: float = 0.0
    """Largest distance, in figure units, by which a hand was lifted to stay above the ground."""
    moved: float = 0.0
    """Largest distance, in figure units, by which a hand was moved to be as far from the skin as in
    the source; 0 without a skin."""


class _Body:
    """Joints of a body by meaning, in all rows of a motion, without its place and scale."""

    def __init__(
        self,
        skeleton: Skeleton,
        clip: SampledClip,
        joints: dict[str, int],
        rests: Floats,
        others: Iterable[int] = (),
        crown: float | None = None,
    ) -> None:
        self.rests, self.chains = rests, chains_to(skeleton, [*joints.values(), *others])
        self.place = {name: int(self.chains.place[joint]) for name, joint in joints.items()}
        self.rest = rest_worlds(skeleton, self.chains, rests)
        # A scale or place of the whole figure changes nothing between the parts of its body.
        own = replace(clip, figure_scales=None, figure_translations=None)
        self.world = chain_worlds(own, self.chains, *rests)
        top = next(name for name in _TOPS if name in joints)
        pelvis, neck, *leg = (self.rest[self.place[name], :3, 3] for name in ("pelvis", top, *_LEG))
        limb = np.linalg.norm(np.diff(leg, axis=0), axis=1).sum()
        self.height = float(np.linalg.norm(neck - pelvis) + limb)
        # The crown is a point of the head, in the direction of the trunk at rest.
        self.trunk = unit(neck - pelvis)
        self._head = self.rest[self.place["head"]] if "head" in joints else None
        if self._head is not None:
            length = _CROWN * self.height if crown is None else crown
            self._crown = np.linalg.pinv(self._head[:3, :3]) @ (length * self.trunk)
            self.place["crown"] = self.place["head"]

    def axes(self, name: str) -> tuple[Floats, Floats]:
        """Return the ways, (N, 3), that are up and forwards at rest, as a joint turns them."""
        left = self.rest[self.place["left_hip"], :3, 3] - self.rest[self.place["right_hip"], :3, 3]
        rest = np.stack([self.trunk, unit(np.cross(left, self.trunk))], axis=1)
        place = self.place[name]
        own = np.linalg.inv(self.rest[place, :3, :3]) @ rest
        up, forward = np.moveaxis(self.world[:, place, :3, :3] @ own, 2, 0)
        return unit(up), unit(forward)

    def at(self, name: str) -> Floats:
        """Return the positions of a joint, or the crown, relative to the height: (N, 3)."""
        world = self.world[:, self.place[name]]
        found = world[:, :3, 3] if name != "crown" else world[:, :3] @ np.append(self._crown, 1.0)
        return found / self.height


def keep_hands(
    found: Retargeted, clip: SampledClip, figure: Figure
) -> tuple[SampledClip, KeptHands | None]:
    """Return a clip of a driven figure with hands that touch its body; None if none were moved."""
    skeleton, source = figure.require_skeleton(), found.source.figure.require_skeleton()
    mine = _driven_joints(found)
    if not mine or not clip.n_rows:
        return clip, None
    given, clip = clip, in_frame_order(clip)
    weights = shape_of(figure, clip)
    rests = np.stack([rest_translations_of(figure, weights[None])[0], skeleton.rest_scales])
    shape = shaped(figure, weights)
    skin, points = _skin_of_ends(shape, mine), _points_of(shape, mine)
    movers = [*(() if skin is None else skin.movers), *(() if points is None else points.joints)]
    crown = None if points is None else points.crown
    body = _Body(skeleton, clip, mine, rests, movers, crown)
    theirs = {name: int(found.matches.partners[joint]) for name, joint in mine.items()}
    own_rests = np.stack([source.rest_translations, source.rest_scales])
    tips = _fingertips(source, theirs)
    other = _Body(source, in_frame_order(found.source.clip), theirs, own_rests, tips)
    is_free = (body.chains.place[[each.joint for each in skeleton.constraints]] < 0).all()
    can_move = (
        is_free and is_solvable(body.rest[:, :3, :3]) and min(body.height, other.height) > 0.0
    )
    if not can_move:
        return given, None
    radii = _radii(shape, mine, body.height)
    shifts, nearness, together = _shifts(body, other, found.to_target, radii)
    before, least = (_error(each, nearness) for each in (shifts, _out_of_reach(body, shifts)))
    touches = any((np.linalg.norm(shift, axis=1) > _SLACK).any() for shift in shifts)
    # The proportions of the source are left alone: what its hands enter, it entered.
    differs = max(float(np.abs(shift).max()) for shift in shifts) > _SHORT
    moved, person = 0.0, None
    if points is not None and differs and points.parts.min() < 0:
        person = _Person(other, tips)
    if points is not None and person is not None and person.holds.any():
        solid = _Solid(points, body)
        aims = _at_skin(body, other, person, found.to_target, solid, np.stack(shifts))
        sides = np.stack([_side(other, number) @ found.to_target.T for number in range(len(_ARMS))])
        shifts = list(_to_skin(body, solid, person, aims, sides, clip.timing))
        moved = body.height * float(np.linalg.norm(shifts, axis=2).max())
    else:
        # The distances that are left to two hands add up.
        slack = _SLACK * (1.0 - 0.5 * together)
        shifts = [
            _within_reach(body, arm, _beyond_slack(shift, slack))
            for arm, shift in zip(_ARMS, _eased(shifts, nearness, clip.timing), strict=True)
        ]
    up = axis_vector(figure.up) * (-1.0 if found.source.hangs else 1.0)
    lifts = _lifts(body, other, found, skin, up, shifts)
    if not touches and max(float(np.abs(shifts).max()), float(lifts.max())) < _NONE:
        return given, None
    shifts = [shift + lift[:, None] * up for shift, lift in zip(shifts, lifts, strict=True)]
    joints = body.chains.joints
    arms = [Leg(*(body.place[name] for name in (*arm, arm[2]))) for arm in _ARMS]
    rotations = clip.rotations.copy()
    rotations[:, joints] = leg_rotations(
        rotations[:, joints], body.world, body.chains.parents, arms,
        np.zeros((len(rotations), 3)), [body.height * shift for shift in shifts],
    )  # fmt: skip
    kept = replace(clip, rotations=rotations)
    lifted = body.height * float(lifts.max())
    if not touches or moved:
        return kept, KeptHands(0.0, 0.0, least, lifted, moved)
    reached = _Body(skeleton, kept, mine, rests, crown=crown)
    wished, _, _ = _shifts(reached, other, found.to_target, radii)
    return kept, KeptHands(before, _error(wished, nearness), least, lifted)


def hand_notes(kept: KeptHands | None, found: Retargeted, figure: Figure) -> list[Diagnostic]:
    """Return messages about the changes made by keeping hands at the body."""
    if kept is None:
        return []
    notes: list[Diagnostic] = []
    called = {"motion": found.source.figure.name, "figure": figure.name}
    remedy = Remedy("Hands at the body in the Actors panel", "--hand-contact off")
    if kept.before:
        notes.append(
            note(
                "F007.hands-kept: hands of {figure} kept at its body where those of {motion} are "
                "at the body: they miss by {after:.1f} % of the height from ankles to neck instead "
                "of {before:.1f} %; {remedy} disables this",
                **called,
                after=100.0 * kept.after,
                before=100.0 * kept.before,
                remedy=remedy,
            )
        )
    if kept.least > _SHORT:
        notes.append(
            note(
                "F007.hands-short: arms of {figure} are too short to touch its body where those of "
                "{motion} do: straight, they would still miss by {least:.1f} % of the height from "
                "ankles to neck",
                **called,
                least=100.0 * kept.least,
            )
        )
    if kept.moved:
        notes.append(
            note(
                "F007.hands-moved: hands of {figure} moved by up to {length}, as far from its skin "
                "as those of {motion} are from theirs; {remedy} disables this",
                **called,
                length=length_text(figure, kept.moved),
                remedy=remedy,
            )
        )
    if kept.lifted:
        notes.append(
            note(
                "F007.hands-lifted: hands of {figure} lifted by up to {length}, so that they do "
                "not sink below its feet, as those of {motion} do not; {remedy} disables this",
                **called,
                length=length_text(figure, kept.lifted),
                remedy=remedy,
            )
        )
    return notes


def _driven_joints(found: Retargeted) -> dict[str, int]:
    """Return the driven joints of a figure by meaning; empty if one that is needed is missing."""
    needed = {"pelvis", *_LEG, *_ARMS[0], *_ARMS[1]}
    wanted = needed.union(*_PARTS, *_FEET)
    names, is_driven = found.matches.names, found.matches.partners >= 0
    mine = {name: j for j, name in enumerate(names) if name in wanted and is_driven[j]}
    return {} if not needed <= mine.keys() or mine.keys().isdisjoint(_TOPS) else mine


def _fingertips(skeleton: Skeleton, joints: dict[str, int]) -> list[int]:
    """Return the joint of each hand that is farthest from its wrist, as of ``_ARMS``."""
    points = world_matrices(skeleton, rest_pose(skeleton))[:, :3, 3]
    result = []
    for arm in _ARMS:
        rows = np.flatnonzero(descendants(skeleton.parents, joints[arm[2]]))
        result.append(
            int(rows[np.linalg.norm(points[rows] - points[joints[arm[2]]], axis=1).argmax()])
        )
    return result


_Singles = NDArray[np.float32]
_Capsule = tuple[Floats, Floats, float, float]


class _Person:
    """Gaps between the hands of a motion and the person's skin, estimated from the joints."""

    def __init__(self, body: _Body, tips: list[int]) -> None:
        self.regions = _capsules(body)
        self.wrist: list[dict[str, Floats]] = []
        hands, arms = [], []
        for arm, tip in zip(_ARMS, tips, strict=True):
            shoulder, elbow, wrist = (body.at(name) for name in arm)
            place = int(body.chains.place[tip])
            rest = body.rest[[place, body.place[arm[2]]], :3, 3]
            longest = float(np.linalg.norm(rest[0] - rest[1])) / body.height
            along = body.world[:, place, :3, 3] / body.height - wrist
            # A fist is shorter than a stretched hand. Of some hands, only the knuckles are known.
            length = np.linalg.norm(along, axis=1, keepdims=True) / max(longest, 1e-30)
            is_known = longest > 0.1 * _HAND_LENGTH
            along, length = (along, length) if is_known else (wrist - elbow, np.float64(1.0))
            end = wrist + _HAND_LENGTH * np.clip(length, 0.5, 1.0) * unit(along)
            arms.append(
                [
                    (shoulder, elbow, *_ARM[:2]),
                    (elbow, wrist, *_ARM[1:]),
                    (wrist, end, _HAND, _HAND),
                ]
            )
        for number in range(len(_ARMS)):
            wrist, end = arms[number][2][:2]
            self.wrist.append({name: _gap(wrist, each) for name, each in self.regions.items()})
            every = [*chain.from_iterable(self.regions.values()), *arms[1 - number]]
            points = [wrist + part * (end - wrist) for part in (0.0, 0.25, 0.5, 0.75, 1.0)]
            # Thumbs point forwards at rest, be the arms stretched out or hanging.
            along, forward = unit(end - wrist), body.axes(_ARMS[number][2])[1]
            aside = unit(forward - np.einsum("na,na->n", forward, along)[:, None] * along)
            points += [wrist + x * along + y * aside for x, y in _ASIDE]
            hands.append(np.min([_gap(point, every) for point in points], axis=0) - _HAND)
        self.hand = np.stack(hands)
        self.touches: Floats = falling((self.hand - _TOUCHING) / (_OFF - _TOUCHING))
        """(2, N). How much hands touch the body, 0 to 1."""
        gaps = np.stack([np.min(list(each.values()), axis=0) for each in self.wrist])
        self.holds: Floats = np.maximum(self.touches, _nearness(gaps))
        """(2, N). How near they are to it, 0 to 1."""


def _capsules(body: _Body) -> dict[str, list[_Capsule]]:
    """Return the capsules of a person's trunk with the head, and of each thigh."""
    top = next(name for name in _TOPS if name in body.place)
    spine = [name for name in _PARTS[0][: _PARTS[0].index(top) + 1] if name in body.place]
    rest = [body.rest[body.place[name], :3, 3] for name in spine]
    lengths = np.linalg.norm(np.diff(rest, axis=0), axis=1)
    reached = np.append(0.0, np.cumsum(lengths)) / max(float(lengths.sum()), 1e-30)
    joints = [body.at(name) for name in spine]
    up = unit(joints[-1] - joints[0])
    across = [body.at(f"left_{name}") - body.at(f"right_{name}") for name in ("hip", "shoulder")]

    def before(fraction: float) -> Floats:
        return unit(np.cross((1.0 - fraction) * unit(across[0]) + fraction * unit(across[1]), up))

    def middle(fraction: float) -> Floats:
        place = int(np.clip(np.searchsorted(reached, fraction) - 1, 0, len(lengths) - 1))
        part = (fraction - reached[place]) / max(float(reached[place + 1] - reached[place]), 1e-30)
        return joints[place] + part * (joints[place + 1] - joints[place])

    def end(fraction: float, ahead: float) -> Floats:
        return middle(fraction) + ahead * before(fraction)

    trunk: list[_Capsule] = [
        (end(*first[:2]), end(*second[:2]), first[2], second[2]) for first, second in _TRUNK
    ]
    legs = {}
    for side in ("left", "right"):
        hip, knee, shoulder = (body.at(f"{side}_{name}") for name in ("hip", "knee", "shoulder"))
        (low, ahead, wide), (high, behind, narrow) = _FLANK
        trunk.append((
            end(0.0, ahead) + low * (hip - joints[0]),
            end(1.0, behind) + high * (shoulder - joints[-1]), wide, narrow,
        ))  # fmt: skip
        trunk.append((joints[-1], shoulder, _NECK, _ARM[0]))
        legs[f"{side}_hip"] = [(hip, knee, *_THIGH)]
    crowned = {}
    if "head" in body.place:
        head = body.at("head")
        if top != "head":
            trunk.append((joints[-1], head, _NECK, _NECK))
        upward, forward = body.axes("head")
        ends = [head + above * upward + ahead * forward for above, ahead, _ in _HEAD]
        crowned["head"] = [(ends[0], ends[1], _HEAD[0][2], _HEAD[1][2])]
    return {"pelvis": trunk, **crowned, **legs}


def _nearness(gaps: Floats) -> Floats:
    """Return how near wrists are to a skin, 0 to 1, by their gaps from it."""
    return falling((gaps - _WRIST_AT) / (_WRIST_OFF - _WRIST_AT))


def _gap(points: Floats, capsules: list[_Capsule]) -> Floats:
    """Return the distances of points from the nearest capsule: (N,)."""
    gaps = []
    for start, end, first, last in capsules:
        bone, away = end - start, points - start
        part = np.einsum("na,na->n", away, bone) / np.maximum(
            np.einsum("na,na->n", bone, bone), 1e-30
        )
        part = np.clip(part, 0.0, 1.0)
        gaps.append(
            np.linalg.norm(away - part[:, None] * bone, axis=1) - first - part * (last - first)
        )
    return np.min(gaps, axis=0)


def _shifts(
    body: _Body, other: _Body, to_target: Floats, radii: dict[str, float]
) -> tuple[list[Floats], list[Floats], Floats]:
    """Return how far the wrists should move, (N, 3) each, and how near they are to the body, (N,).

    The last item is how near they are to each other, (N,). 1: they touch, 0: they are far.
    """
    shifts, nearness = [], []
    for arm in _ARMS:
        own = body.at(arm[2])
        total, weights = np.zeros_like(own), np.zeros(len(own))
        most = np.zeros(len(own))
        for start, end in _bones(body.place):
            away, part = _from_bone(other, arm[2], start, end)
            away, distance = away @ to_target.T, np.linalg.norm(away, axis=1)
            nearest = body.at(start) + part[:, None] * (body.at(end) - body.at(start))
            # Stout thighs keep the hand outside: no nearer than their skin, unless it is already.
            outside = np.minimum(radii.get(start, 0.0), np.linalg.norm(own - nearest, axis=1))
            longer = np.maximum(outside / np.maximum(distance, 1e-30), 1.0)
            weight = falling((distance - _NEAR) / (_FAR - _NEAR))
            total += weight[:, None] ** 2 * (nearest + longer[:, None] * away - own)
            weights += weight**2
            most = np.maximum(most, weight)
        shifts.append((most / np.maximum(weights, 1e-30))[:, None] * total)
        nearness.append(most)
    # Hands that touch each other move by half of the difference each.
    ends = [body.at(arm[2]) + shift for arm, shift in zip(_ARMS, shifts, strict=True)]
    between = (other.at(_ARMS[1][2]) - other.at(_ARMS[0][2])) @ to_target.T
    weight = _together(other)
    half = 0.5 * weight[:, None] * (between - (ends[1] - ends[0]))
    shifts = [shifts[0] - half, shifts[1] + half]
    return shifts, [np.maximum(near, weight) for near in nearness], weight


def _region(start: str, end: str) -> str:
    """Return the part of the body around a bone: trunk, head or a thigh, by its first joint."""
    return "head" if end == "crown" else "pelvis" if start in _PARTS[0] else start


def _together(other: _Body) -> Floats:
    """Return how near the wrists are to each other, (N,): 1 where they touch, 0 where far."""
    between = other.at(_ARMS[1][2]) - other.at(_ARMS[0][2])
    return falling((np.linalg.norm(between, axis=1) - _TOGETHER) / (_APART - _TOGETHER))


def _from_bone(body: _Body, wrist: str, start: str, end: str) -> tuple[Floats, Floats]:
    """Return a wrist relative to the nearest point a + t (b - a) of a bone, (N, 3), and t, (N,)."""
    first, bone = body.at(start), body.at(end) - body.at(start)
    away = body.at(wrist) - first
    along = np.einsum("na,na->n", away, bone)
    part = np.clip(along / np.maximum(np.einsum("na,na->n", bone, bone), 1e-30), 0, 1)
    return away - part[:, None] * bone, part


def _bones(joints: dict[str, int]) -> Iterator[tuple[str, str]]:
    for part in _PARTS:
        yield from pairwise([name for name in part if name in joints])


def _eased(shifts: list[Floats], nearness: list[Floats], timing: Timing) -> list[Floats]:
    """Return curves (N, 3) through the shifts of hands at the body, which fade around them."""
    # As for planted feet: the nearer the hand is to the body, the more firmly a row is held.
    targets, holds = np.stack(shifts), np.stack(nearness)
    result = np.empty_like(targets)
    for start, stop in spans_of(timing):
        rows = targets[:, start:stop], strength(holds[:, start:stop])
        result[:, start:stop] = smooth_curves(*rows, _EASE * timing.frame_rate)
    return list(result)


def _beyond_slack(shift: Floats, slack: Floats) -> Floats:
    """Return shifts (N, 3) without the part (N,) that may be left, continuously."""
    length = np.maximum(np.linalg.norm(shift, axis=1), 1e-30)
    return shift * np.maximum(1.0 - slack / length, 0.0)[:, None]


def _within_reach(body: _Body, arm: tuple[str, ...], shift: Floats) -> Floats:
    """Return shifts (N, 3) of a wrist that leave the arm bent, unless it is straighter already."""
    shoulder, elbow, wrist = (body.at(name) for name in arm)
    length = np.linalg.norm(elbow - shoulder, axis=1) + np.linalg.norm(wrist - elbow, axis=1)
    most = np.maximum(_EXTENDED * length, np.linalg.norm(wrist - shoulder, axis=1))
    away = wrist + shift - shoulder
    distance = np.maximum(np.linalg.norm(away, axis=1), 1e-30)
    is_far = (distance > most)[:, None]
    return np.where(is_far, shoulder + away * (most / distance)[:, None] - wrist, shift)


def _skin_of_ends(figure: Figure, joints: dict[str, int]) -> Soles | None:
    """Return the skin of the hands, as of ``_ARMS``, and of the feet; None if any has none."""
    feet = [[joints[name] for name in foot if name in joints] for foot in _FEET]
    if figure.mesh is None or figure.skin is None or not figure.is_attached or not all(feet):
        return None
    skin = soles_of_feet(figure, [*([joints[arm[2]]] for arm in _ARMS), *feet], is_bound=True)
    return None if skin.above.any() else skin


def _lifts(
    body: _Body,
    other: _Body,
    found: Retargeted,
    skin: Soles | None,
    up: Floats,
    shifts: list[Floats],
) -> Floats:
    """Return how far moved hands should rise, relative to the height: (2, N)."""
    if skin is None:
        return np.zeros((len(_ARMS), len(body.world)))
    # Below the feet is the ground, or air that the source's hands do not enter either. These have
    # no skin: they are taken to reach as far below their wrists as the figure's, so that squatting
    # and handstands, in which the source's would sink too, are left alone.
    skin = replace(skin, movers=body.chains.place[skin.movers])
    heights = skin.heights(body.world, np.append(up, 0.0), 1.0) / body.height
    ground = heights[:, len(_ARMS) :].min(axis=1)
    scale = found.scale * other.height / body.height
    feet = [name for foot in _FEET for name in foot if name in other.place]
    level = np.min([other.at(name) @ found.to_target.T @ up for name in feet], axis=0)
    lifts = []
    for arm, shift, low in zip(_ARMS, shifts, heights.T, strict=False):
        length = body.at(arm[2]) @ up - low
        theirs = scale * (other.at(arm[2]) @ found.to_target.T @ up - level) - length
        lifts.append(np.maximum(ground + np.minimum(theirs, 0.0) - low - shift @ up, 0.0))
    return np.stack(lifts)


def _out_of_reach(body: _Body, shifts: list[Floats]) -> list[Floats]:
    """Return the parts of shifts (N, 3) that are left where arms are straight.

    By the triangle inequality, no elbow brings the wrist nearer to a place than the distance from
    the shoulder less the lengths of both bones.
    """
    left = []
    for arm, shift in zip(_ARMS, shifts, strict=True):
        shoulder, elbow, wrist = (body.at(name) for name in arm)
        length = np.linalg.norm(elbow - shoulder, axis=1) + np.linalg.norm(wrist - elbow, axis=1)
        away = wrist + shift - shoulder
        left.append(_beyond_slack(away, length))
    return left


def _error(shifts: list[Floats], nearness: list[Floats]) -> float:
    """Return the mean distance from where hands should be, weighted by nearness."""
    # The shifts contain the weights.
    lengths = np.linalg.norm(np.concatenate(shifts), axis=1)
    return float(lengths.sum() / max(np.concatenate(nearness).sum(), 1e-30))


def _radii(figure: Figure, joints: dict[str, int], height: float) -> dict[str, float]:
    """Return the distance of the skin from each thigh's bone, by its first joint, if it has one."""
    mesh, skin = figure.mesh, figure.skin
    if mesh is None or skin is None or not figure.is_attached:
        return {}
    vertices, strongest = owners(skin), strongest_influences(skin)
    points, result = rest_joints(figure), {}
    for start, end in _PARTS[1:]:
        own = vertices[strongest[skin.joints[strongest] == joints[start]]]
        bone = points[joints[end]] - points[joints[start]]
        length = float(np.linalg.norm(bone))
        if not len(own) or length <= 0.0:
            continue
        away = mesh.positions[own] - points[joints[start]]
        across = np.linalg.norm(np.cross(away, bone / length), axis=1)
        result[start] = float(np.percentile(across, _GIRTH)) / height
    return result


@dataclass(frozen=True, slots=True, eq=False)
class _SkinPoints:
    """Points spread evenly over the skin of a body, each of which moves with one joint."""

    joints: Ints
    """(P,) int32, ascending. The joints of the skeleton."""
    places: Floats
    normals: Floats
    """(P, 3). Positions, and outward normals, in the space of the joints."""
    arms: Ints
    """(P,). 0 and 1 for points of the arms, as of ``_ARMS``, else -1."""
    parts: Ints
    """(P,). 0 for points of upper arms, 1 of forearms, 2 of hands, -1 for all others."""
    hands: Ints
    """(P,). As ``arms``, for the points that are kept outside the skin."""
    regions: dict[str, Bools]
    """(P,) each. Whether points are around the bones of a part, by the first name in ``_PARTS``."""
    area: float
    """Area of the piece of the skin at each point."""
    crown: float | None
    """Height of the crown above the head's joint; None if the head has no skin."""


def _points_of(figure: Figure, joints: dict[str, int]) -> _SkinPoints | None:
    """Return points of a figure's skin; None if a hand has none."""
    mesh, skin = figure.mesh, figure.skin
    if mesh is None or skin is None or not figure.is_attached or not mesh.n_triangles:
        return None
    vectors = area_vectors(mesh.positions, mesh.triangles)
    area = 0.5 * float(np.linalg.norm(vectors, axis=1).sum())
    if not area > 0.0:
        return None
    samples = sample_surface(mesh.positions, mesh.triangles, _POINTS)
    points = samples.positions
    from_middle = mesh.positions[mesh.triangles[:, 0]] - mesh.positions.mean(axis=0)
    outward = np.sign(np.einsum("ta,ta->", from_middle, vectors))
    normals = (outward or 1.0) * samples.normals
    # Each moves with the strongest joint of the nearest corner.
    corners = mesh.triangles[samples.triangles]
    nearest = np.take_along_axis(corners, samples.weights.argmax(axis=1)[:, None], axis=1)[:, 0]
    strongest = np.full(mesh.n_vertices, -1, dtype=np.int32)
    influences = strongest_influences(skin)
    strongest[owners(skin)[influences]] = skin.joints[influences]
    movers = strongest[nearest]
    is_bound = movers >= 0
    movers, points, normals = movers[is_bound], points[is_bound], normals[is_bound]
    parents = figure.require_skeleton().parents
    rest = rest_joints(figure)
    arms, hands, parts = np.full((3, len(movers)), -1)
    for number, arm in enumerate(_ARMS):
        shoulder, elbow, wrist = (joints[name] for name in arm)
        for part, joint in enumerate((shoulder, elbow, wrist)):
            is_moved = descendants(parents, joint)[movers]
            arms[is_moved], parts[is_moved] = number, part
        # A hand is at most as long as its forearm; beyond it are things that it holds.
        reach = np.linalg.norm(rest[wrist] - rest[elbow])
        is_hand = descendants(parents, wrist)[movers]
        hands[is_hand & (np.linalg.norm(points - rest[wrist], axis=1) < reach)] = number
    if not {0, 1} <= set(hands.tolist()):
        return None
    kept = np.flatnonzero((hands >= 0) | _encloses(points, normals, area / _POINTS, points))
    kept = kept[np.argsort(movers[kept], kind="stable")]
    movers, arms, hands, parts = movers[kept], arms[kept], hands[kept], parts[kept]
    points, normals = points[kept], normals[kept]
    crown = None
    if "head" in joints:
        own = descendants(parents, joints["head"])[movers]
        top = next(joints[name] for name in _TOPS if name in joints)
        trunk = unit(rest[top] - rest[joints["pelvis"]])
        if own.any():
            crown = float(np.quantile((points[own] - rest[joints["head"]]) @ trunk, 0.98))
    regions = {"pelvis": arms < 0}
    if "head" in joints:
        regions["head"] = descendants(parents, joints["head"])[movers]
        regions["pelvis"] &= ~regions["head"]
    for hip, knee in _PARTS[1:]:
        is_leg = descendants(parents, joints[hip])[movers]
        regions[hip] = is_leg
        # The trunk ends at the hips.
        thigh = np.linalg.norm(rest[joints[knee]] - rest[joints[hip]])
        regions["pelvis"] &= ~is_leg | (
            np.linalg.norm(points - rest[joints[hip]], axis=1) < 0.4 * thigh
        )
    bind = skin.inverse_bind[movers]
    places = np.einsum("pab,pb->pa", bind[:, :3, :3], points) + bind[:, :3, 3]
    normals = unit(np.einsum("pab,pb->pa", bind[:, :3, :3], normals))
    return _SkinPoints(
        movers.astype(np.int32), places, normals, arms, parts, hands, regions, area / _POINTS, crown
    )  # fmt: skip


def _encloses(
    skin: Floats | _Singles, normals: Floats | _Singles, area: float, points: Floats
) -> Bools:
    """Return which points (..., P, 3) are inside a skin with an area at each of (..., S, 3): (P,).

    The winding number (Barill et al. 2018) sums the solid angles of all pieces of the skin, as
    fractions of the sphere: 1 inside, 0 outside. It is 1/2 at a point of a closed skin, or of one
    with small openings, but 0 at one of an open sheet, such as a cape.
    """
    # Single precision, around the middle, takes half the time.
    middle = points.mean(axis=-2, keepdims=True)
    ends, starts, outward = (
        np.asarray(each, dtype=np.float32) for each in (points - middle, skin - middle, normals)
    )
    squares = (ends**2).sum(axis=-1)[..., None] + (starts**2).sum(axis=-1)[..., None, :]
    # Pieces have a width, so that those next to a point subtend less than a small one would.
    squares = np.maximum(squares - 2.0 * ends @ starts.swapaxes(-1, -2), 0.0) + area
    heights = (starts * outward).sum(axis=-1)[..., None, :] - ends @ outward.swapaxes(-1, -2)
    angles = (heights / (squares * np.sqrt(squares))).sum(axis=-1)
    is_inside: Bools = area / (4.0 * np.pi) * angles > _SOLID
    return is_inside


class _Solid:
    """The skin of a body in the rows of its motion, with lengths relative to its height."""

    def __init__(self, points: _SkinPoints, body: _Body) -> None:
        self.points, self.body = points, body
        self.area = points.area / body.height**2
        self.place = body.chains.place[points.joints]
        every = [np.flatnonzero(points.hands == number) for number in range(len(_ARMS))]
        self.hands = [
            np.sort(rows[_spread(points.places[rows], _HAND_POINTS)]).astype(np.int32)
            for rows in every
        ]
        self.regions = {
            name: np.flatnonzero(each)[::2].astype(np.int32)
            for name, each in points.regions.items()
        }

    def posed(self, rows: Ints, points: Ints) -> tuple[Floats, Floats]:
        """Return the positions and normals (R, P, 3) of some points (P,) in some rows."""
        worlds, joints = self.body.world[rows], self.place[points]
        placed, normals = np.empty((2, len(rows), len(points), 3))
        # Multiplying by joints takes a quarter of the time of multiplying by points.
        starts = np.flatnonzero(np.diff(joints, prepend=-1))
        for start, stop in pairwise([*starts, len(points)]):
            linear, offset = np.split(worlds[:, joints[start], :3] / self.body.height, [3], axis=2)
            own = points[start:stop]
            np.matmul(self.points.places[own], linear.swapaxes(1, 2), out=placed[:, start:stop])
            placed[:, start:stop] += offset.swapaxes(1, 2)
            turns = unscaled(linear).swapaxes(1, 2)
            np.matmul(self.points.normals[own], turns, out=normals[:, start:stop])
        return placed, normals

    def near(self, number: int, rows: Ints, shifts: Floats, arms: _Arms) -> Iterator[_NearSkin]:
        """Yield batches of rows of a hand that is moved by shifts (N, 3), with the skin near it."""
        others = np.flatnonzero(self.points.arms != number).astype(np.int32)
        for batch in _batches(rows):
            own = self.posed(batch, self.hands[number])[0]
            points, normals = self.posed(batch, others)
            parts = np.broadcast_to(self.points.parts[others], points.shape[:2])
            moved, _ = arms.moved(1 - number, batch, parts, points, normals)
            ends = own + shifts[batch, None]
            centres = ends.mean(axis=1, keepdims=True)
            reach = lengths_of(ends - centres).max(axis=1, keepdims=True) + _DEEP
            is_near = lengths_of(moved - centres) < reach
            holds, each = np.flatnonzero(is_near.any(axis=1)), np.arange(len(own))[:, None]
            if not len(holds):
                continue
            # Those that are near come first.
            order = np.argsort(~is_near, axis=1, kind="stable")[:, : is_near.sum(axis=1).max()]
            near = np.where(is_near[each, order][..., None], points[each, order], _NOWHERE)
            whole = np.stack([points, normals])[:, :, ::_FEWER].astype(np.float32)
            yield _NearSkin(
                number, batch[holds], own[holds], parts[each, order][holds], near[holds],
                normals[each, order][holds], whole[:, holds],
            )  # fmt: skip

    def radii(self, region: str, starts: Floats, ways: Floats, needed: Bools) -> Floats:
        """Return how far a blunt hand that comes along rays stops from their starts: (N,)."""
        result, rows = np.full(len(starts), np.nan), np.flatnonzero(needed).astype(np.int32)
        for chosen in _batches(rows if len(self.regions[region]) else rows[:0]):
            away = self.posed(chosen, self.regions[region])[0] - starts[chosen, None]
            along = np.einsum("rpa,ra->rp", away, ways[chosen])
            aside = np.einsum("rpa,rpa->rp", away, away) - along**2
            is_ahead = (along > 0.0) & (aside < (2.0 * _BLUNT) ** 2)
            farthest = np.where(is_ahead, along - aside / (2.0 * _BLUNT), -np.inf).max(axis=1)
            result[chosen] = np.where(np.isfinite(farthest), farthest, np.nan)
        return result


@dataclass(frozen=True, slots=True, eq=False)
class _NearSkin:
    """A hand and the skin near it in some rows, where they are without changes of the arms."""

    number: int
    """0 or 1, as of ``_ARMS``."""
    rows: Ints
    """(R,). Rows of the motion."""
    own: Floats
    """(R, H, 3). Points of the hand."""
    parts: Ints
    """(R, P). Parts of the points of the skin, as in ``_SkinPoints``."""
    points: Floats
    normals: Floats
    """(R, P, 3). Rows with fewer points have some that are far from everything."""
    whole: _Singles
    """(2, R, S, 3). Points and normals of the skin without the hand's arm, in single precision."""


def _batches(rows: Ints) -> list[Ints]:
    """Return rows in pieces whose arrays fit into the cache."""
    return [rows[start : start + _BATCH] for start in range(0, len(rows), _BATCH)]


def _at_skin(
    body: _Body, other: _Body, person: _Person, to_target: Floats, solid: _Solid, shifts: Floats
) -> Floats:
    """Return shifts (2, N, 3) of wrists that put them as far from the skin as in the source.

    ``shifts``: (2, N, 3), those that are known without the skin.
    """
    result = np.empty_like(shifts)
    for number, arm in enumerate(_ARMS):
        own, is_held = body.at(arm[2]), person.holds[number] > 0.0
        total, weights = _LITTLE * shifts[number], np.full(len(own), _LITTLE)
        for name, gap in person.wrist[number].items():
            bones = [bone for bone in _bones(body.place) if _region(*bone) == name]
            found = [_from_bone(other, arm[2], *bone) for bone in bones]
            distances = np.linalg.norm([away for away, _ in found], axis=2)
            for (start, end), (away, along), distance in zip(bones, found, distances, strict=True):
                weight = _nearness(gap + distance - distances.min(axis=0))
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
    first, second = (body.at(arm[2]) + shift for arm, shift in zip(_ARMS, result, strict=True))
    between = (other.at(_ARMS[1][2]) - other.at(_ARMS[0][2])) @ to_target.T
    half = 0.5 * _together(other)[:, None] * (between - (second - first))
    return result + np.stack([-half, half])


def _to_skin(
    body: _Body, solid: _Solid, person: _Person, aims: Floats, sides: Floats, timing: Timing
) -> Floats:
    """Return smooth shifts (2, N, 3) of wrists with which hands keep the gaps of the source.

    ``aims``: (2, N, 3), first guesses; ``sides``: (2, N, 3), ways from the trunk to the hands.
    """
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
    gaps = person.hand - np.clip(person.hand, -_UNSURE, _UNSURE)
    arms = _Arms(body, np.flatnonzero(touches.any(axis=0)).astype(np.int32))
    arms.bend(result)
    near = [
        skin
        for number, touching in enumerate(touches)
        for skin in solid.near(
            number, np.flatnonzero(touching).astype(np.int32), result[number], arms
        )
    ]
    for _ in range(_ROUNDS if near else 0):
        farthest = 0.0
        for skin in near:
            number, rows = skin.number, skin.rows
            step = _steps(skin, result, arms, _FEWER * solid.area, gaps, sides)
            length = lengths_of(step)
            # The next curve starts from this one, so that steps which it smooths do not add up.
            part = np.where(length > _NONE, touches[number, rows], 0.0)
            wished = part[:, None] * (result[number, rows] + step)
            targets[number, rows] = (1.0 - part)[:, None] * targets[number, rows] + wished
            farthest = max(farthest, float((part * length).max()))
        if farthest < _NONE:
            break
        result = _faded(body, targets, pulls, timing)
        arms.bend(result)
    return result


def _faded(body: _Body, targets: Floats, pulls: Floats, timing: Timing) -> Floats:
    """Return curves (2, N, 3) through targets at the skin, which fade around them, within reach.

    ``pulls``: (2, N), weights of the targets, relative to the weight of staying.
    """
    result = np.empty_like(targets)
    for start, stop in spans_of(timing):
        rows = slice(start, stop)
        weights = 1.0 + pulls[:, rows]
        aims = (pulls[:, rows] / weights)[..., None] * targets[:, rows]
        result[:, rows] = smooth_curves(aims, weights, _FADE * timing.frame_rate)
    return np.stack(
        [_within_reach(body, arm, each) for arm, each in zip(_ARMS, result, strict=True)]
    )


def _side(other: _Body, number: int) -> Floats:
    """Return the direction of a wrist from the nearest bone of the trunk: (N, 3)."""
    bones = pairwise([name for name in _PARTS[0] if name in other.place])
    ways = np.stack([_from_bone(other, _ARMS[number][2], *bone)[0] for bone in bones])
    nearest = np.linalg.norm(ways, axis=2).argmin(axis=0)
    side: Floats = unit(ways[nearest, np.arange(ways.shape[1])])
    return side


class _Arms:
    """Arms of a body in some rows of its motion, as their wrists move."""

    def __init__(self, body: _Body, rows: Ints) -> None:
        self.rows = rows
        self.joints = [
            (body.at(shoulder)[rows], body.at(elbow)[rows], body.at(wrist)[rows])
            for shoulder, elbow, wrist in _ARMS
        ]
        across = self.joints[0][0] - self.joints[1][0]
        uppers = [unscaled(body.world[rows, body.place[arm[0]], :3, :3]) for arm in _ARMS]
        self.axes = [
            hinges(upper, points, across) for upper, points in zip(uppers, self.joints, strict=True)
        ]

    def bend(self, shifts: Floats) -> None:
        """Move the wrists by shifts (2, N, 3), of which those in the rows count."""
        self.shifts = shifts[:, self.rows]
        # Of each part of an arm, and of all others in the end: x' = A x + b.
        self.linear = np.tile(np.eye(3), (len(_ARMS), len(self.rows), 4, 1, 1))
        self.offsets = np.zeros((len(_ARMS), len(self.rows), 4, 3))
        for arm, (points, shift) in enumerate(zip(self.joints, self.shifts, strict=True)):
            shoulder, elbow, wrist = points
            turns = bend(*points, wrist + shift, self.axes[arm])
            upper, lower = (quaternion_to_matrix(turn) for turn in turns)
            bent = shoulder + np.einsum("rab,rb->ra", upper, elbow - shoulder)
            self.linear[arm, :, :2] = np.stack([upper, lower], axis=1)
            self.offsets[arm, :, 0] = shoulder - np.einsum("rab,rb->ra", upper, shoulder)
            self.offsets[arm, :, 1] = bent - np.einsum("rab,rb->ra", lower, elbow)
            self.offsets[arm, :, 2] = shift

    def moved(
        self, arm: int, rows: Ints, parts: Ints, points: Floats, normals: Floats
    ) -> tuple[Floats, Floats]:
        """Return points and normals (R, P, 3) of the skin, of which some parts (R, P) are an arm's.

        All are where they are without changes of the arms.
        """
        if (parts < 0).all():
            return points, normals
        index = np.searchsorted(self.rows, rows)[:, None]
        linear, offsets = self.linear[arm, index, parts], self.offsets[arm, index, parts]
        return (
            np.einsum("rpab,rpb->rpa", linear, points) + offsets,
            np.einsum("rpab,rpb->rpa", linear, normals),
        )

    def within_reach(self, arm: int, rows: Ints, steps: Floats) -> Floats:
        """Return steps (R, 3) of a wrist: straight arms can only swing about the shoulder."""
        index = np.searchsorted(self.rows, rows)
        shoulder, elbow, wrist = (each[index] for each in self.joints[arm])
        # The curve leaves arms exactly as long as this, but for rounding.
        longest = _ALMOST * _EXTENDED * (lengths_of(elbow - shoulder) + lengths_of(wrist - elbow))
        line = wrist + self.shifts[arm, index] - shoulder
        outward = np.einsum("ra,ra->r", unit(line), steps)
        # Along the tangent t, the way s out of the skin takes s^2 / t.
        swing = steps - outward[:, None] * unit(line)
        length = np.einsum("ra,ra->r", steps, steps) / np.maximum(lengths_of(swing), 1e-30)
        is_straight = (outward > 0.0) & (lengths_of(line) >= longest)
        swing = np.minimum(length, _FAST)[:, None] * unit(swing)
        return np.where(is_straight[:, None], swing, steps)


def _steps(
    skin: _NearSkin, shifts: Floats, arms: _Arms, area: float, gaps: Floats, sides: Floats
) -> Floats:
    """Return translations (R, 3) of a hand to its gaps from the skin near it.

    ``area``: of the pieces of the whole skin.
    """
    number, rows, parts = skin.number, skin.rows, skin.parts
    own, each = skin.own + shifts[number, rows, None], np.arange(len(rows))[:, None]
    others, normals = arms.moved(1 - number, rows, parts, skin.points, skin.normals)
    squares = np.einsum("rpa,rpa->rp", others, others)[:, None]
    nearest = (squares - 2.0 * own @ others.swapaxes(1, 2)).argmin(axis=2)
    away, outward = own - others[each, nearest], normals[each, nearest]
    heights = np.einsum("rha,rha->rh", away, outward)
    distances = lengths_of(away)
    aside = np.sqrt(np.maximum(distances**2 - heights**2, 0.0))
    is_inside = heights < -_BEHIND * distances
    # Behind the inner face of a piece of armour is no inside.
    deep = is_inside & (heights < -_UNSURE)
    unsure = np.flatnonzero(deep.any(axis=1))
    if len(unsure):
        whole, normals_there = skin.whole[:, unsure]
        is_enclosed = _encloses(whole, normals_there, area, own[unsure])
        is_inside[unsure] &= ~deep[unsure] | is_enclosed
    # Points of the skin are discs as wide as the distances between them.
    clear = np.where(is_inside, heights, np.hypot(heights, np.maximum(aside - _DISC, 0.0)))
    each, first = each[:, 0], clear.argmin(axis=1)
    missing = np.maximum(gaps[number, rows, None] - clear, 0.0)
    # What is farther is another part than the source's hand touches.
    excess = clear[each, first] - gaps[number, rows]
    near = falling((excess - _PULL[0]) / (_PULL[1] - _PULL[0]))
    pull = -(near * excess)[:, None] * unit(away[each, first])
    # The mean direction out, on the side of the part on which the hand is.
    ways = np.where((parts[each[:, None], nearest] < 0)[..., None], sides[number, rows, None], 0.0)
    inwards = np.minimum(np.einsum("rha,rha->rh", outward, ways), 0.0)
    way = unit(np.einsum("rh,rha->ra", missing, outward - inwards[..., None] * ways))
    cosine = np.maximum(np.einsum("ra,ra->r", way, outward[each, first]), 0.5)
    push = np.minimum(missing[each, first] / cosine, _FAST)[:, None] * way
    # Of two hands, each gives way by half.
    give = np.where(parts[each, nearest[each, first]] == 2, 0.5, 1.0)
    step = give[:, None] * np.where((missing[each, first] > 0.0)[:, None], push, pull)
    return arms.within_reach(number, rows, step)


def _spread(points: Floats, count: int) -> Ints:
    """Return the rows of at most ``count`` points, each the farthest from those before it."""
    rows = [int(np.linalg.norm(points - points.mean(axis=0), axis=1).argmax())]
    distances = np.linalg.norm(points - points[rows[0]], axis=1)
    while len(rows) < count and distances.max() > 0.0:
        rows.append(int(distances.argmax()))
        distances = np.minimum(distances, np.linalg.norm(points - points[rows[-1]], axis=1))
    return np.array(rows, dtype=np.int32)
