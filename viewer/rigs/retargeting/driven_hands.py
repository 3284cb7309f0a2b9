"""Hands of a driven figure: kept at its body where those of its source are at their own.

Retargeting preserves the directions of limbs, so hands that rest on a hip, touch the head or clap
miss if proportions differ. Near a part of the body, a wrist gets the place relative to that part
that it has in the source, scaled by the height; elbow and shoulder follow. If the figure has a
skin, what counts is the gap between the hand and the skin instead: hands come as near to it as
those of the source do, whose skin is estimated from the joints, and touch it where those do. Hands
of long arms stay above the ground if those of the source do.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, note
from viewer.phrases import Remedy
from viewer.rigs.arrays import Floats
from viewer.rigs.cleanup.frames import in_frame_order
from viewer.rigs.feet.body import is_solvable, shape_of, spans_of
from viewer.rigs.feet.curves import falling, smooth_curves, strength
from viewer.rigs.feet.legs import Leg, leg_rotations
from viewer.rigs.feet.soles import Soles, soles_of_feet
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.vectors import axis_vector
from viewer.rigs.hierarchy import descendants
from viewer.rigs.kinematics import world_matrices
from viewer.rigs.motion.evaluation import rest_translations_of
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing
from viewer.rigs.pose import rest_pose
from viewer.rigs.retargeting.body_joints import (
    ARMS,
    FEET,
    LEG,
    PARTS,
    THIGHS,
    TOPS,
    Body,
    bones,
    from_bone,
    together_in,
    within_reach,
)
from viewer.rigs.retargeting.figure_skin import Solid, points_of
from viewer.rigs.retargeting.hands_at_skin import UNCHANGED, shifts_at_skin
from viewer.rigs.retargeting.person_skin import Person
from viewer.rigs.retargeting.retarget import Retargeted
from viewer.rigs.scalars import length_text
from viewer.rigs.shape import rest_joints, shaped
from viewer.rigs.skeleton import Skeleton
from viewer.rigs.skin import owners, strongest_influences

# Distances of a wrist from the axis of a part, relative to the height from ankles to neck: up to
# the first, it touches the part, beyond the second it is free. A person's wrist is 0.12 to 0.14
# away with the hand on a hip or on the head, and 0.13 to 0.17 where the arm hangs beside a thigh.
_NEAR, _FAR = 0.14, 0.24
# Distance from where a hand should be that is left, so that limbs keep their directions: about 2 %
# of the height of a person.
_SLACK = 0.025
# The length s of the smooth curve of a hand's shift, seconds; as for feet, see ``planting``.
_EASE = 0.15
_SHORT = 0.005  # smallest miss of straight arms that is reported: a fifth of _SLACK
_GIRTH = 75.0  # percentile of the distances of the skin from a thigh that is taken as its radius


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
    skin, points = _skin_of_ends(shape, mine), points_of(shape, mine)
    movers = [*(() if skin is None else skin.movers), *(() if points is None else points.joints)]
    crown = None if points is None else points.crown
    body = Body(skeleton, clip, mine, rests, movers, crown)
    theirs = {name: int(found.matches.partners[joint]) for name, joint in mine.items()}
    own_rests = np.stack([source.rest_translations, source.rest_scales])
    tips = _fingertips(source, theirs)
    other = Body(source, in_frame_order(found.source.clip), theirs, own_rests, tips)
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
        person = Person(other, tips)
    if points is not None and person is not None and person.holds.any():
        known = person, found.to_target, np.stack(shifts), clip.timing
        shifts = list(shifts_at_skin(body, Solid(points, body), other, *known))
        moved = body.height * float(np.linalg.norm(shifts, axis=2).max())
    else:
        # The distances that are left to two hands add up.
        slack = _SLACK * (1.0 - 0.5 * together)
        shifts = [
            within_reach(body, arm, _beyond_slack(shift, slack))
            for arm, shift in zip(ARMS, _eased(shifts, nearness, clip.timing), strict=True)
        ]
    up = axis_vector(figure.up) * (-1.0 if found.source.hangs else 1.0)
    lifts = _lifts(body, other, found, skin, up, shifts)
    if not touches and max(float(np.abs(shifts).max()), float(lifts.max())) < UNCHANGED:
        return given, None
    shifts = [shift + lift[:, None] * up for shift, lift in zip(shifts, lifts, strict=True)]
    joints = body.chains.joints
    arms = [Leg(*(body.place[name] for name in (*arm, arm[2]))) for arm in ARMS]
    rotations = clip.rotations.copy()
    rotations[:, joints] = leg_rotations(
        rotations[:, joints], body.world, body.chains.parents, arms,
        np.zeros((len(rotations), 3)), [body.height * shift for shift in shifts],
    )  # fmt: skip
    kept = replace(clip, rotations=rotations)
    lifted = body.height * float(lifts.max())
    if not touches or moved:
        return kept, KeptHands(0.0, 0.0, least, lifted, moved)
    reached = Body(skeleton, kept, mine, rests, crown=crown)
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
    needed = {"pelvis", *LEG, *ARMS[0], *ARMS[1]}
    wanted = needed.union(*PARTS, *FEET)
    names, is_driven = found.matches.names, found.matches.partners >= 0
    mine = {name: j for j, name in enumerate(names) if name in wanted and is_driven[j]}
    return {} if not needed <= mine.keys() or mine.keys().isdisjoint(TOPS) else mine


def _fingertips(skeleton: Skeleton, joints: dict[str, int]) -> list[int]:
    """Return the joint of each hand that is farthest from its wrist, as of ``ARMS``."""
    points = world_matrices(skeleton, rest_pose(skeleton))[:, :3, 3]
    result = []
    for arm in ARMS:
        rows = np.flatnonzero(descendants(skeleton.parents, joints[arm[2]]))
        result.append(
            int(rows[np.linalg.norm(points[rows] - points[joints[arm[2]]], axis=1).argmax()])
        )
    return result


def _shifts(
    body: Body, other: Body, to_target: Floats, radii: dict[str, float]
) -> tuple[list[Floats], list[Floats], Floats]:
    """Return how far the wrists should move, (N, 3) each, and how near they are to the body, (N,).

    The last item is how near they are to each other, (N,). 1: they touch, 0: they are far.
    """
    shifts, nearness = [], []
    for arm in ARMS:
        own = body.at(arm[2])
        total, weights = np.zeros_like(own), np.zeros(len(own))
        most = np.zeros(len(own))
        for start, end in bones(body.place):
            away, part = from_bone(other, arm[2], start, end)
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
    weight = together_in(other)
    between = other.between_wrists() @ to_target.T
    half = 0.5 * weight[:, None] * (between - (body.between_wrists() + shifts[1] - shifts[0]))
    shifts = [shifts[0] - half, shifts[1] + half]
    return shifts, [np.maximum(near, weight) for near in nearness], weight


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


def _skin_of_ends(figure: Figure, joints: dict[str, int]) -> Soles | None:
    """Return the skin of the hands, as of ``ARMS``, and of the feet; None if any has none."""
    feet = [[joints[name] for name in foot if name in joints] for foot in FEET]
    if figure.mesh is None or figure.skin is None or not figure.is_attached or not all(feet):
        return None
    skin = soles_of_feet(figure, [*([joints[arm[2]]] for arm in ARMS), *feet], is_bound=True)
    return None if skin.above.any() else skin


def _lifts(
    body: Body,
    other: Body,
    found: Retargeted,
    skin: Soles | None,
    up: Floats,
    shifts: list[Floats],
) -> Floats:
    """Return how far moved hands should rise, relative to the height: (2, N)."""
    if skin is None:
        return np.zeros((len(ARMS), len(body.world)))
    # Below the feet is the ground, or air that the source's hands do not enter either. These have
    # no skin: they are taken to reach as far below their wrists as the figure's, so that squatting
    # and handstands, in which the source's would sink too, are left alone.
    skin = replace(skin, movers=body.chains.place[skin.movers])
    heights = skin.heights(body.world, np.append(up, 0.0), 1.0) / body.height
    ground = heights[:, len(ARMS) :].min(axis=1)
    scale = found.scale * other.height / body.height
    feet = [name for foot in FEET for name in foot if name in other.place]
    level = np.min([other.at(name) @ found.to_target.T @ up for name in feet], axis=0)
    lifts = []
    for arm, shift, low in zip(ARMS, shifts, heights.T, strict=False):
        length = body.at(arm[2]) @ up - low
        theirs = scale * (other.at(arm[2]) @ found.to_target.T @ up - level) - length
        lifts.append(np.maximum(ground + np.minimum(theirs, 0.0) - low - shift @ up, 0.0))
    return np.stack(lifts)


def _out_of_reach(body: Body, shifts: list[Floats]) -> list[Floats]:
    """Return the parts of shifts (N, 3) that are left where arms are straight.

    By the triangle inequality, no elbow brings the wrist nearer to a place than the distance from
    the shoulder less the lengths of both bones.
    """
    left = []
    for arm, shift in zip(ARMS, shifts, strict=True):
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
    for start, end in THIGHS:
        own = vertices[strongest[skin.joints[strongest] == joints[start]]]
        bone = points[joints[end]] - points[joints[start]]
        length = float(np.linalg.norm(bone))
        if not len(own) or length <= 0.0:
            continue
        away = mesh.positions[own] - points[joints[start]]
        across = np.linalg.norm(np.cross(away, bone / length), axis=1)
        result[start] = float(np.percentile(across, _GIRTH)) / height
    return result
