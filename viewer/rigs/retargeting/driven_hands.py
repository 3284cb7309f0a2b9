"""Hands of a driven figure: kept at its body where those of its source are at their own.

Retargeting preserves the directions of limbs, so hands that rest on a hip, touch the head or clap
miss if proportions differ. Near a part of the body, a wrist gets the place relative to that part
that it has in the source, scaled by the height; elbow and shoulder follow. Hands of long arms stay
above the ground if those of the source do.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, note
from viewer.phrases import Remedy
from viewer.rigs.arrays import Floats
from viewer.rigs.cleanup.frames import in_frame_order
from viewer.rigs.feet.body import chain_worlds, chains_to, is_solvable, rest_worlds, shape_of
from viewer.rigs.feet.curves import falling
from viewer.rigs.feet.legs import Leg, leg_rotations
from viewer.rigs.feet.soles import Soles, soles_of_feet
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.vectors import axis_vector
from viewer.rigs.motion.evaluation import rest_translations_of
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.retargeting.retarget import Retargeted
from viewer.rigs.scalars import length_text
from viewer.rigs.shape import rest_joints, shaped
from viewer.rigs.skeleton import Skeleton
from viewer.rigs.skin import owners, strongest_influences

# Parts of the body as chains of joints; the bones between those that are matched count.
_PARTS = (
    ("pelvis", "spine1", "spine2", "spine3", "neck", "head"),
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
_EXTENDED = 0.97  # maximum extension of an arm: its elbow is bent by 28 degrees
_SHORT = 0.005  # smallest miss of straight arms that is reported: a fifth of _SLACK
_GIRTH = 75.0  # percentile of the distances of the skin from a bone that is taken as its radius


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


class _Body:
    """Joints of a body by meaning, in all rows of a motion, without its place and scale."""

    def __init__(
        self,
        skeleton: Skeleton,
        clip: SampledClip,
        joints: dict[str, int],
        rests: Floats,
        others: Iterable[int] = (),
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

    def at(self, name: str) -> Floats:
        """Return the positions of a joint relative to the height: (N, 3)."""
        return self.world[:, self.place[name], :3, 3] / self.height


def keep_hands(
    found: Retargeted, clip: SampledClip, figure: Figure, hangs: bool = False
) -> tuple[SampledClip, KeptHands | None]:
    """Return a clip of a driven figure with hands that touch its body; None if none were moved.

    ``hangs``: whether the up axis of the motion points down.
    """
    skeleton, source = figure.require_skeleton(), found.source.figure.require_skeleton()
    mine = _driven_joints(found)
    if not mine or not clip.n_rows:
        return clip, None
    given, clip = clip, in_frame_order(clip)
    weights = shape_of(figure, clip)
    rests = np.stack([rest_translations_of(figure, weights[None])[0], skeleton.rest_scales])
    shape = shaped(figure, weights)
    skin = _skin_of_ends(shape, mine)
    body = _Body(skeleton, clip, mine, rests, () if skin is None else skin.movers)
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
    # The distances that are left to two hands add up.
    slack = _SLACK * (1.0 - 0.5 * together)
    shifts = [
        _within_reach(body, arm, _beyond_slack(shift, slack))
        for arm, shift in zip(_ARMS, shifts, strict=True)
    ]
    touches = any(shift.any() for shift in shifts)
    up = -axis_vector(figure.up) if hangs else axis_vector(figure.up)
    lifts = _lifts(body, other, found, skin, up, shifts)
    if not (touches or lifts.any()):
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
    reached = _Body(skeleton, kept, mine, rests)
    wished, _, _ = _shifts(reached, other, found.to_target, radii)
    lifted = body.height * float(lifts.max())
    if not touches:
        return kept, KeptHands(0.0, 0.0, lifted=lifted)
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
        wrist, own = other.at(arm[2]) @ to_target.T, body.at(arm[2])
        total, weights = np.zeros_like(own), np.zeros(len(own))
        most = np.zeros(len(own))
        for start, end in _bones(body.place):
            first, last = (other.at(name) @ to_target.T for name in (start, end))
            # The nearest point a + t (b - a) of the bone.
            bone = last - first
            along = np.einsum("na,na->n", wrist - first, bone)
            part = np.clip(along / np.maximum(np.einsum("na,na->n", bone, bone), 1e-30), 0, 1)
            away = wrist - first - part[:, None] * bone
            distance = np.linalg.norm(away, axis=1)
            nearest = body.at(start) + part[:, None] * (body.at(end) - body.at(start))
            # A stout body keeps the hand outside: no nearer than its skin, unless it is already.
            outside = np.minimum(radii.get(start, 0.0), np.linalg.norm(own - nearest, axis=1))
            longer = np.maximum(outside / np.maximum(distance, 1e-30), 1.0)
            weight = falling((distance - _NEAR) / (_FAR - _NEAR))
            goal = nearest + longer[:, None] * away
            total += weight[:, None] ** 2 * (goal - own)
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


def _bones(joints: dict[str, int]) -> Iterator[tuple[str, str]]:
    for part in _PARTS:
        yield from pairwise([name for name in part if name in joints])


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
    """Return the distance of the skin from the bone that begins at each joint, if it has a skin."""
    mesh, skin = figure.mesh, figure.skin
    if mesh is None or skin is None or not figure.is_attached:
        return {}
    vertices, strongest = owners(skin), strongest_influences(skin)
    points, result = rest_joints(figure), {}
    for start, end in _bones(joints):
        own = vertices[strongest[skin.joints[strongest] == joints[start]]]
        bone = points[joints[end]] - points[joints[start]]
        length = float(np.linalg.norm(bone))
        if not len(own) or length <= 0.0:
            continue
        away = mesh.positions[own] - points[joints[start]]
        across = np.linalg.norm(np.cross(away, bone / length), axis=1)
        result[start] = float(np.percentile(across, _GIRTH)) / height
    return result
