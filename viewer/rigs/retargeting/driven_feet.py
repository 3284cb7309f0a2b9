"""Feet of a driven figure: planted while the feet of its source are on the ground.

Retargeting preserves the directions of limbs, so feet slide and sink if proportions differ. The
contacts are those of the source; see ``viewer.rigs.feet.planting``.
"""

from __future__ import annotations

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, note
from viewer.phrases import Remedy, counted
from viewer.progress import report
from viewer.rigs.arrays import Floats
from viewer.rigs.cleanup.frames import in_frame_order
from viewer.rigs.feet.body import body_legs, chain_worlds, chains_to, is_solvable, rest_worlds
from viewer.rigs.feet.contacts import FootPath
from viewer.rigs.feet.legs import Leg, animal_legs, legs_of
from viewer.rigs.feet.planting import STEPS, PlantedFeet, plant
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.vectors import axis_vector
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.retargeting.rest_alignment import rest_of
from viewer.rigs.retargeting.retarget import Retargeted
from viewer.rigs.scalars import length_text

_ALIKE = 1e-4  # tolerance for equal lengths, relative to the body
_STEEP = 0.9  # maximum sine of the slope of a standing person's foot
# Percentage of the heights of two feet that are lower where a foot stands: lower ones are noise.
_STANDING = 5.0
# Height of a ground above which it is no ground at height 0, if the soles are not known, relative
# to the body: ankles of chibis are as high as half of their legs, a quarter of this size.
_LOW_GROUND = 0.2
# Distance of the ground from height 0 that is said, as a fraction of the body's height: a motion
# whose origin is the hip is half of it below, wrong heights of ankles or shoes are 5 % of it.
_FAR = 0.1
_ROUNDING = 1e-6  # length below which 0 is shown, as a fraction of the body's height


def plant_feet(found: Retargeted, figure: Figure) -> tuple[SampledClip, PlantedFeet | None]:
    """Plant a driven figure's feet; no changes without legs or if proportions are the source's."""
    pairs = _leg_pairs(found, figure)
    rest_up = axis_vector(figure.up)
    up = -rest_up if found.source.hangs else rest_up
    clip = in_frame_order(found.clip)
    body = body_legs(figure, clip, [pair.leg for pair in pairs], rest_up) if pairs else None
    if body is None or body.size <= 0.0 or clip.n_rows == 0:
        return found.clip, None
    if _has_source_proportions(found, figure, pairs, body.size):
        return found.clip, None
    report(1, STEPS, "steps", "planting the feet")
    source = in_frame_order(found.source.clip)
    worlds = body.worlds(clip)
    own = body.feet_from_ankles(worlds)
    feet = _source_paths(found, source, pairs, own, (rest_up, up), body.size)
    planted, changes = plant(clip, body, worlds, up, feet)
    return (planted if changes.is_better or changes.raised else found.clip), changes


@dataclass(frozen=True, slots=True)
class _LegPair:
    """A leg of the figure, and the joints of the source's foot that drives it."""

    leg: Leg
    """Joints of the figure."""
    hip: int
    ankle: int
    toe: int
    """Joints of the source; ankle and toe are equal if the foot has no ball joint."""
    is_digitigrade: bool = False
    """Whether the foot stands on its toes, like an animal's, and never on its heel."""


def _leg_pairs(found: Retargeted, figure: Figure) -> list[_LegPair]:
    """Return the legs of the figure whose hips and ankles are driven, left before right."""
    source, skeleton = found.source.figure.require_skeleton(), figure.require_skeleton()
    partners, up = found.matches.partners, axis_vector(figure.up)
    animal = animal_legs(skeleton.parents, rest_of(skeleton, np.eye(3), figure.up).points, up)
    toes = {leg.ankle: leg.toe for leg in legs_of(source)}
    pairs = []
    for leg in animal or legs_of(skeleton):
        hip, ankle, toe = (int(partners[joint]) for joint in (leg.hip, leg.ankle, leg.toe))
        if min(hip, ankle) < 0:
            continue
        chosen = (toe if toe >= 0 else ankle) if animal else toes.get(ankle, ankle)
        pairs.append(_LegPair(leg, hip, ankle, chosen, bool(animal)))
    return pairs


def _has_source_proportions(
    found: Retargeted, figure: Figure, pairs: list[_LegPair], size: float
) -> bool:
    """Return whether the legs of a figure are as long as the scaled legs of the source."""
    partners = found.matches.partners
    target, source = figure.require_skeleton(), found.source.figure.require_skeleton()
    joints = [
        joint
        for pair in pairs
        for joint in (pair.leg.hip, pair.leg.knee, pair.leg.ankle, pair.leg.toe)
        if partners[joint] >= 0
    ]
    bones = []
    for skeleton, chosen in ((target, joints), (source, partners[joints])):
        points = rest_of(skeleton, np.eye(3), "y").points[chosen]
        bones.append(np.linalg.norm(np.diff(points, axis=0), axis=1))
    return bool(np.abs(bones[0] - found.scale * bones[1]).max() < _ALIKE * size)


def _source_paths(
    found: Retargeted,
    clip: SampledClip,
    pairs: list[_LegPair],
    vectors: list[tuple[Floats, Floats]],
    ups: tuple[Floats, Floats],
    size: float,
) -> list[FootPath]:
    """Return the source's feet in the figure's axes and unit, shaped as the figure's if unknown.

    ``ups``: the up axes of the rest pose and of the frames, (3,) each.
    """
    rest_up, up = ups
    skeleton = found.source.figure.require_skeleton()
    chains = chains_to(
        skeleton, [joint for pair in pairs for joint in (pair.hip, pair.ankle, pair.toe)]
    )
    rests = np.stack([skeleton.rest_translations, skeleton.rest_scales])
    rest = rest_worlds(skeleton, chains, rests)
    world = chain_worlds(clip, chains, *rests)
    axes, result, ankles = found.scale * found.to_target, list[FootPath](), list[Floats]()
    for pair, own in zip(pairs, vectors, strict=True):
        ends = (pair.hip, pair.ankle, pair.toe)
        hip, ankle, toe = (int(chains.place[joint]) for joint in ends)
        above = world[:, hip, :3, 3] @ axes.T
        place, ball = (world[:, joint, :3, 3] @ axes.T for joint in (ankle, toe))
        if pair.is_digitigrade:
            ball = ball if toe != ankle else place + own[0]
            result.append(FootPath(ball, ball, above))
            continue
        height = (axes @ (rest[ankle, :3, 3] - rest[toe, :3, 3])) @ rest_up
        length = np.linalg.norm(axes @ (rest[ankle, :3, 3] - rest[toe, :3, 3]))
        linear = rest[ankle, :3, :3]
        if not (0.0 < height < _STEEP * length and is_solvable(linear)):
            result.append(FootPath(place + own[0], place + own[1], above))
            ankles.append(place @ up)
            continue
        upward = np.linalg.solve(linear, found.to_target.T @ rest_up)
        heel = world[:, ankle, :3] @ np.append(-height / found.scale * upward, 1.0)
        result.append(FootPath(ball, heel @ axes.T, above))
    if len(ankles) < len(pairs):
        return result
    # The feet of the figure may be higher or lower than those of the source, whose soles are not
    # known: if its ankles are a little above height 0, the ground is there.
    low = float(np.percentile([path.lowest(up) for path in result], _STANDING))
    if not (np.percentile(ankles, _STANDING) > 0.0 and low < _LOW_GROUND * size):
        return result
    return [FootPath(path.toe - low * up, path.heel - low * up, path.hip) for path in result]


def feet_notes(changes: PlantedFeet | None, found: Retargeted, figure: Figure) -> list[Diagnostic]:
    """Return messages about the changes made by planting the feet."""
    if changes is None:
        return []
    called = {"motion": found.source.figure.name, "figure": figure.name}
    is_far = abs(changes.ground) > _FAR * changes.size
    far = note(
        "F007.feet-far: feet of {figure} stand {length} {below} height 0, as those of {motion} "
        "do{remedy}"
        if changes.n_contacts
        else "F007.feet-far-lowest: feet of {figure} are {length} {below} height 0 at their "
        "lowest, as those of {motion} are{remedy}",
        **called,
        length=length_text(figure, abs(changes.ground)),
        below="below" if changes.ground < 0.0 else "above",
        remedy=Remedy("", "; --ground of viewer view, render and convert moves them there"),
    )
    if not changes.is_better:
        key = (
            "F007.feet-kept: feet of {figure} not planted: they already slide as little as "
            "those of {motion}"
            if changes.n_contacts
            else "F007.feet-no-contacts: feet of {figure} not planted: no ground contacts found in "
            "{motion}"
        )
        notes = [note(key, **called)]
        if changes.raised:
            notes.append(
                note(
                    "F007.feet-level: {figure} is {moved} by {length}, so that its feet are as low "
                    "as those of {motion}; {remedy} disables this",
                    **called,
                    moved="raised" if changes.raised > 0.0 else "lowered",
                    length=length_text(figure, abs(changes.raised)),
                    remedy=Remedy("Feet on the ground in the Actors panel", "--feet off"),
                )
            )
        return [*notes, far] if is_far else notes

    def text(length: float) -> str:
        return length_text(figure, length if length > _ROUNDING * changes.size else 0.0)

    notes = []

    def add(key: str, **values: object) -> None:
        notes.append(note(key, **values))

    add(
        "F007.feet-planted: feet of {figure} planted during {n}: they slide by {after}; "
        "without planting, by {before} (in {motion}, by {source}); {remedy} disables this",
        **called,
        n=counted(changes.n_contacts, "contact"),
        source=text(changes.source),
        before=text(changes.before),
        after=text(changes.after),
        remedy=Remedy("Feet on the ground in the Actors panel", "--feet off"),
    )
    add(
        "F007.feet-gap: soles of {figure} are within {gap} of the ground during contacts; "
        "without planting, within {gap_before}",
        figure=figure.name,
        gap_before=text(changes.gap_before),
        gap=text(changes.gap_after),
    )
    if changes.lowered > _ROUNDING * changes.size:
        add(
            "F007.feet-lowered: {figure} is lowered by up to {length}, so that its feet reach "
            "the ground",
            figure=figure.name,
            length=text(changes.lowered),
        )
    if changes.ground_speed:
        add(
            "F007.feet-ground: ground moves at {speed}, as on a treadmill: planted feet of "
            "{figure} move with it",
            figure=figure.name,
            speed=f"{text(changes.ground_speed)}/s",
        )
    return [*notes, far] if is_far else notes
