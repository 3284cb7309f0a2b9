"""Hands of a driven figure: kept at its body where those of its source are at their own.

Retargeting preserves the directions of limbs, so hands that rest on a hip, touch the head or clap
miss if proportions differ. Near a part of the body, a wrist gets the place relative to that part
that it has in the source, scaled by the height; elbow and shoulder follow. Hands that are at the
trunk, at the head or at each other in the source are then moved out of the skin. Hands of long arms
stay above the ground if those of the source do.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np

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
from viewer.rigs.feet.legs import Leg, leg_rotations
from viewer.rigs.feet.soles import Soles, soles_of_feet
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.samples import sample_surface
from viewer.rigs.geometry.vectors import axis_vector, unit
from viewer.rigs.hierarchy import descendants
from viewer.rigs.mesh import area_vectors
from viewer.rigs.motion.evaluation import rest_translations_of
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.timing import Timing
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
_SHORT = 0.005  # smallest miss of straight arms that is reported: a fifth of _SLACK
# Height of the crown above the head's joint where nothing shows it: 0.11 to 0.2 for people, of whom
# most files have the joint at the ears, some at the chin.
_CROWN = 0.15

_GIRTH = 75.0  # percentile of the distances of the skin from a thigh that is taken as its radius

# Distances of a wrist of the motion from the axis of the trunk or the head: up to the first, the
# hand is on it and may be moved out of the skin, beyond the second it may not. The wrist is up to
# 0.17 away with the hand on a hip or on the belly, 0.19 to 0.23 where the arm swings beside the
# body: there, a way out would only shake it.
_ON, _OFF = 0.16, 0.19
# Points of the skin, between which a person has about 3 cm, and those of a hand that are kept
# outside the others.
_POINTS, _HAND_POINTS = 2000, 24
_DEEP = 0.3  # depth up to which hands are moved out: more than half the width of a stout body
# Cosine of the angle to the normal of the nearest point from which a point is inside. Beyond the
# edge of something thin, or of an open mesh, the nearest point is aside.
_BEHIND = 0.5
# Winding number between that of points of a closed skin, 1/2, and of an open sheet, 0.
_SOLID = 0.25
# Hands are moved out in rounds, each smoothed over that many seconds before and after a frame, so
# that they begin to give way before they would enter the body: a tenth of a second is the time in
# which a person's hand stops.
_ROUNDS, _WIDTH = 8, 0.1


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
    moved_out: float = 0.0
    """Largest distance, in figure units, by which a hand was moved out of the skin."""


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
    other = _Body(source, in_frame_order(found.source.clip), theirs, own_rests)
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
    # The distances that are left to two hands add up.
    slack = _SLACK * (1.0 - 0.5 * together)
    shifts = _eased(shifts, nearness, clip.timing)
    shifts = [
        _within_reach(body, arm, _beyond_slack(shift, slack))
        for arm, shift in zip(_ARMS, shifts, strict=True)
    ]
    up = axis_vector(figure.up) * (-1.0 if found.source.hangs else 1.0)
    given_way = np.zeros((len(_ARMS), *shifts[0].shape))
    if points is not None and differs:
        rests_on = _rests_on(body, other, together)
        given_way = _ways_out(points, body, shifts, rests_on, clip.timing)
        shifts = [shift + each for shift, each in zip(shifts, given_way, strict=True)]
    lifts = _lifts(body, other, found, skin, up, shifts)
    if not (any(shift.any() for shift in shifts) or lifts.any()):
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
    farthest = (np.linalg.norm(given_way, axis=2).max(), lifts.max())
    moved_out, lifted = (body.height * float(each) for each in farthest)
    if not touches:
        return kept, KeptHands(0.0, 0.0, lifted=lifted, moved_out=moved_out)
    reached = _Body(skeleton, kept, mine, rests, crown=crown)
    wished, _, _ = _shifts(reached, other, found.to_target, radii)
    # Where a hand was moved out of the skin, it should be outside.
    missed = [shift + each for shift, each in zip(wished, given_way, strict=True)]
    return kept, KeptHands(before, _error(missed, nearness), least, lifted, moved_out)


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
    if kept.moved_out:
        notes.append(
            note(
                "F007.hands-outside: hands of {figure} moved out of its body by up to {length}; "
                "{remedy} disables this",
                **called,
                length=length_text(figure, kept.moved_out),
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
    weight = falling((np.linalg.norm(between, axis=1) - _TOGETHER) / (_APART - _TOGETHER))
    half = 0.5 * weight[:, None] * (between - (ends[1] - ends[0]))
    shifts = [shifts[0] - half, shifts[1] + half]
    return shifts, [np.maximum(near, weight) for near in nearness], weight


def _from_bone(body: _Body, wrist: str, start: str, end: str) -> tuple[Floats, Floats]:
    """Return a wrist relative to the nearest point a + t (b - a) of a bone, (N, 3), and t, (N,)."""
    first, bone = body.at(start), body.at(end) - body.at(start)
    away = body.at(wrist) - first
    along = np.einsum("na,na->n", away, bone)
    part = np.clip(along / np.maximum(np.einsum("na,na->n", bone, bone), 1e-30), 0, 1)
    return away - part[:, None] * bone, part


def _rests_on(body: _Body, other: _Body, together: Floats) -> Floats:
    """Return how much hands of the source are on trunk, head or each other, 0 to 1: (2, N)."""
    bones = [each for each in _bones(body.place) if each not in _PARTS[1:]]
    result = []
    for arm in _ARMS:
        ways = [_from_bone(other, arm[2], *bone)[0] for bone in bones]
        distance = np.linalg.norm(ways, axis=2).min(axis=0)
        result.append(np.maximum(falling((distance - _ON) / (_OFF - _ON)), together))
    return np.stack(result)


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
    """(P,) int32. The joints of the skeleton."""
    places: Floats
    normals: Floats
    """(P, 3). Positions, and outward normals, in the space of the joints."""
    arms: Ints
    """(P,). 0 and 1 for points of the arms, as of ``_ARMS``, else -1."""
    hands: Ints
    """(P,). The same for hands."""
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
    arms, hands = np.full((2, len(movers)), -1)
    for number, arm in enumerate(_ARMS):
        shoulder, elbow, wrist = (joints[name] for name in arm)
        arms[descendants(parents, shoulder)[movers]] = number
        # A hand is at most as long as its forearm; beyond it are things that it holds.
        reach = np.linalg.norm(rest[wrist] - rest[elbow])
        is_hand = descendants(parents, wrist)[movers]
        hands[is_hand & (np.linalg.norm(points - rest[wrist], axis=1) < reach)] = number
    if not {0, 1} <= set(hands.tolist()):
        return None
    kept = np.flatnonzero((hands >= 0) | _is_solid(points, normals, area / _POINTS))
    movers, arms, hands = movers[kept], arms[kept], hands[kept]
    points, normals = points[kept], normals[kept]
    crown = None
    if "head" in joints:
        own = descendants(parents, joints["head"])[movers]
        top = next(joints[name] for name in _TOPS if name in joints)
        trunk = unit(rest[top] - rest[joints["pelvis"]])
        if own.any():
            crown = float(np.quantile((points[own] - rest[joints["head"]]) @ trunk, 0.98))
    bind = skin.inverse_bind[movers]
    places = np.einsum("pab,pb->pa", bind[:, :3, :3], points) + bind[:, :3, 3]
    normals = unit(np.einsum("pab,pb->pa", bind[:, :3, :3], normals))
    return _SkinPoints(movers.astype(np.int32), places, normals, arms, hands, crown)


def _is_solid(points: Floats, normals: Floats, area: float) -> Bools:
    """Return which points (P, 3) of a skin, each with an area, have an inside behind them: (P,).

    The winding number (Barill et al. 2018) sums the solid angles of all pieces of the skin, as
    fractions of the sphere: 1 inside, 0 outside. It is 1/2 at a point of a closed skin, or of one
    with small openings, but 0 at one of an open sheet, such as a cape.
    """
    # Single precision, around the middle, takes half the time.
    points = (points - points.mean(axis=0)).astype(np.float32)
    normals = normals.astype(np.float32)
    squares = (points**2).sum(axis=1)
    distances = np.maximum(squares[:, None] + squares - 2.0 * points @ points.T, 0.0)
    # Pieces have a width, so that those next to a point subtend less than a small one would.
    distances += area
    heights = (points * normals).sum(axis=1) - points @ normals.T
    angles = (heights / (distances * np.sqrt(distances))).sum(axis=1)
    is_solid: Bools = area / (4.0 * np.pi) * angles > _SOLID
    return is_solid


def _ways_out(
    skin: _SkinPoints, body: _Body, shifts: list[Floats], rests_on: Floats, timing: Timing
) -> Floats:
    """Return how far shifted wrists should move to keep hands outside the skin: (2, N, 3).

    ``rests_on``: (2, N), the part of the way that is gone. All lengths are relative to the height.
    Hands translate, as their world rotations stay.
    """
    result = np.zeros((len(_ARMS), *shifts[0].shape))
    every = [np.flatnonzero(skin.hands == number).astype(np.int32) for number in range(len(_ARMS))]
    chosen = [rows[_spread(skin.places[rows], _HAND_POINTS)] for rows in every]
    # 1 for points that move with the other hand. The rest of its arm moves in another way.
    with_other = [(skin.hands == 1 - number).astype(np.float64) for number in range(len(_ARMS))]
    place = body.chains.place[skin.joints]

    def posed(row: int, rows: Ints) -> tuple[Floats, Floats]:
        """Return the positions and normals of some points in a frame."""
        world = body.world[row, place[rows], :3]
        points = np.einsum("pab,pb->pa", world[..., :3], skin.places[rows]) + world[..., 3]
        return points / body.height, unit(
            np.einsum("pab,pb->pa", world[..., :3], skin.normals[rows])
        )

    def step(row: int, number: int, near: Ints) -> Floats:
        """Return how far a hand, moved as far as it is now, should go on."""
        hands = [shifts[each][row] + result[each, row] for each in range(len(_ARMS))]
        others, normals = posed(row, near)
        belongs = with_other[number][near, None]
        own = posed(row, chosen[number])[0] + hands[number]
        # Of two hands, each gives way by half.
        return _way_out(own, others + belongs * hands[1 - number], normals, 1.0 - 0.5 * belongs)

    everything = np.arange(len(place), dtype=np.int32)
    cases = []
    for row in np.flatnonzero(rests_on.any(axis=0)).tolist():
        points, _ = posed(row, everything)
        for number in np.flatnonzero(rests_on[:, row]).tolist():
            hand = chosen[number]
            others = points + with_other[number][:, None] * shifts[1 - number][row]
            own = points[hand] + shifts[number][row]
            centre = own.mean(axis=0)
            reach = np.linalg.norm(own - centre, axis=1).max() + _DEEP
            is_near = ((others - centre) ** 2).sum(axis=1) < reach**2
            is_near &= (skin.arms < 0) | (with_other[number] > 0.0)
            near = np.flatnonzero(is_near).astype(np.int32)
            if len(near) and step(row, number, near).any():
                cases.append((row, number, near))
    for _ in range(_ROUNDS):
        steps = np.zeros_like(result)
        for row, number, near in cases:
            steps[number, row] = step(row, number, near)
        if not steps.any():
            break
        result += steps
        for start, stop in spans_of(timing):
            result[:, start:stop] = _smoothed(result[:, start:stop], _WIDTH * timing.frame_rate)
        for number, arm in enumerate(_ARMS):
            wanted = shifts[number] + result[number]
            result[number] = _within_reach(body, arm, wanted) - shifts[number]
    parts = rests_on[..., None].copy()
    for start, stop in spans_of(timing):
        parts[:, start:stop] = _smoothed(parts[:, start:stop], _WIDTH * timing.frame_rate)
    return parts * result


def _smoothed(curves: Floats, width: float) -> Floats:
    """Return the moving averages of curves (..., N, 3), with weights that fall linearly."""
    from scipy.ndimage import convolve1d  # loads slowly, and only hands at the body need it

    half = max(1, round(width))
    weights = 1.0 - np.abs(np.arange(-half, half + 1)) / (half + 1.0)
    return np.asarray(convolve1d(curves, weights / weights.sum(), axis=-2, mode="nearest"))


def _way_out(points: Floats, others: Floats, normals: Floats, fractions: Floats) -> Floats:
    """Return a translation (3,) of points (H, 3) out of the skin at other points (P, 3).

    ``fractions``: (P, 1), how much of the way is gone.
    """
    nearest = ((others**2).sum(axis=1) - 2.0 * points @ others.T).argmin(axis=1)
    away, outward = points - others[nearest], normals[nearest]
    heights = np.einsum("ha,ha->h", away, outward)
    inside = np.flatnonzero(heights < -_BEHIND * np.linalg.norm(away, axis=1))
    result = np.zeros(3)
    # The smallest translation out of the deepest point's plane, then out of those that are left.
    for point in inside[heights[inside].argsort()]:
        missing = -heights[point] - outward[point] @ result
        result += max(missing, 0.0) * fractions[nearest[point]] * outward[point]
    return result


def _spread(points: Floats, count: int) -> Ints:
    """Return the rows of at most ``count`` points, each the farthest from those before it."""
    rows = [int(np.linalg.norm(points - points.mean(axis=0), axis=1).argmax())]
    distances = np.linalg.norm(points - points[rows[0]], axis=1)
    while len(rows) < count and distances.max() > 0.0:
        rows.append(int(distances.argmax()))
        distances = np.minimum(distances, np.linalg.norm(points - points[rows[-1]], axis=1))
    return np.array(rows, dtype=np.int32)
