"""Retargeting of a motion to another skeleton: joints matched by name, rest poses aligned.

World rotations are transferred, not local ones, so that the rotations of unmatched joints between
matched joints are included. With all rotations in the figure's axes, and rest rotations R_s and R_t
of source and target::

    W_t(frame) = W_s(frame) R_s^-1 B R_t

where B rotates the figure's rest pose to the source's at that joint, for instance from a T-pose
to an A-pose. Lengths are the figure's; the path is scaled by the ratio of leg lengths.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from itertools import pairwise, product

import numpy as np

from viewer.data_classes import dataclass
from viewer.diagnostics import Diagnostic, Phrase, note
from viewer.errors import RigError
from viewer.phrases import Remedy, agree, counted, listed, one_of, rounded
from viewer.rigs.arrays import Bools, Floats
from viewer.rigs.expressions import OLD_PRESETS
from viewer.rigs.figure import Figure, figure_pose
from viewer.rigs.geometry.quaternion import align_signs, conjugate, multiply
from viewer.rigs.geometry.rotation import matrix_to_quaternion, quaternion_to_matrix, up_rotation
from viewer.rigs.hierarchy import path_to_root
from viewer.rigs.kinematics import joint_worlds
from viewer.rigs.motion.sampled_clip import SampledClip
from viewer.rigs.motion.skeleton_motion import SkeletonMotion
from viewer.rigs.retargeting.joint_map import JointMap
from viewer.rigs.retargeting.joint_matches import TIPS, Matches, match_joints
from viewer.rigs.retargeting.joint_names import LIMBS, joint_meanings
from viewer.rigs.retargeting.rest_alignment import (
    RestPose,
    alignment,
    is_same_rest,
    rest_of,
)
from viewer.rigs.retargeting.source_rest import (
    SourceRest,
    with_rest_rotations,
    with_source_rest,
    with_upright_rest,
)
from viewer.rigs.skeleton import Skeleton, joint_label, joint_labels, scaled_skeleton

_LIMBS = (("hip", "knee", "ankle"), ("shoulder", "elbow", "wrist"))
_SIDES = ("left", "right")

# Largest rotation of a joint that never moves, and least one of a joint that moves, in radians.
_NEVER, _MOVING = np.radians(0.01), np.radians(5.0)
_STILL = 1e-6  # minimum motion of used position channels, as a fraction of the skeleton's size
_FEET = ("left_foot", "right_foot", "left_ankle", "right_ankle")

# Cosine of the maximum angle between the up axis and the legs of a standing person, from the pelvis
# to the feet. The legs of some files, such as those of CMU, are 20 degrees apart in the zero pose.
_UPRIGHT = np.cos(np.radians(40.0))
# Lengths that forearms and shins may have, relative to upper arms and thighs. End Sites that some
# programs put next to the joint, or anywhere, are no wrists.
_LOWER = (0.5, 2.0)
# Difference of offsets in the axes of their parents that digits of files explain, relative to the
# root of the sum of their squares.
_ONE_RIG = 1e-5
_ROUNDING = 1e-9  # tolerance within which a ratio is treated as 1


def retarget(
    motion: SkeletonMotion,
    figure: Figure,
    joint_map: JointMap | None = None,
    source_rest: SourceRest = "zero",
) -> Retargeted:
    """Return a motion made for another skeleton as a clip of a figure, and how they match.

    Joints are matched by ``joint_map``, then by the names that many programs use for a body (see
    ``viewer.rigs.retargeting.joint_names``), then by equal names; a skeleton with the same names
    and hierarchy matches joint by joint. Limbs get exactly the directions of the source's limbs;
    spine, neck, head and feet keep the figure's bend unless the rest poses differ greatly. With
    the same hierarchy and nearly the same rest pose, or the same offsets in the axes of the
    parents, local rotations are copied unchanged. RigError if too few joints match, the map names a
    missing joint, or a frame is missing.
    """
    source, target = motion.figure.skeleton, figure.skeleton
    if source is None or target is None:
        named = motion.figure.name if source is None else figure.name
        raise RigError(note("F004.no-skeleton: {figure} has no skeleton to animate", figure=named))
    motion = _in_path_unit(motion)
    source = motion.figure.require_skeleton()
    matches = match_joints(source, target, joint_map, (motion.figure.name, figure.name))
    job = _job(motion, source, (target, figure.up), matches)
    rested: list[Diagnostic] = []
    has_one_up = motion.figure.up == figure.up
    if isinstance(source_rest, str) and has_one_up and _is_one_rig(source, target, matches):
        # Joints of one rig have the same axes, so they have the same local rotations whatever the
        # two files call the rest pose.
        rotations = source.rest_rotations.copy()
        rotations[matches.partners] = target.rest_rotations
        motion = with_rest_rotations(motion, rotations)
        job = _job(motion, motion.figure.require_skeleton(), (target, figure.up), matches)
    if not job.is_same:
        motion = with_upright_rest(motion)
        job = _job(motion, motion.figure.require_skeleton(), (target, figure.up), matches)
    if not (job.is_same and source_rest == "auto"):
        motion, rested = with_source_rest(motion, source_rest)
        job = _job(motion, motion.figure.skeleton or source, (target, figure.up), matches)
    worlds = job.clip.rotations.copy()
    for joint, parent in enumerate(job.source.parents):
        if parent >= 0:
            worlds[:, joint] = multiply(worlds[:, parent], worlds[:, joint])
    rotations = _target_rotations(job, worlds)
    scale, by = _path_scale(*job.rests, job.matches)
    shifts, notes = _shifts(job, worlds, rotations, scale)
    roots = np.flatnonzero(target.parents < 0)
    place: Floats | None = None
    if figure.mesh is not None and len(roots) == 1:
        place, shifts[:, 0] = shifts[:, 0].copy(), 0.0
    weights, missing = expression_weights(motion.expressions, figure)
    clip = SampledClip(
        motion.clip.name,
        motion.clip.timing,
        rotations,
        translations=shifts if shifts.any() else None,
        figure_translations=place,
        shape_weights=weights,
    )
    scaled = note(
        "F007.path-scaled: path of the root scaled by {scale}, {by}", scale=rounded(scale), by=by
    )
    idle = [] if joint_map is not None else _limbs_at_rest(motion, figure, matches, rotations)
    notes = [*matches.notes, *idle, *rested, scaled, *notes, *missing]
    return Retargeted(clip, notes, motion, matches, job.to_target, scale)


@dataclass(frozen=True, slots=True, eq=False)
class Retargeted:
    """Result of a retargeting, and how the two skeletons relate."""

    clip: SampledClip
    """Motion of the figure."""
    notes: list[Diagnostic]
    """Messages about matched joints, the rest pose, and the scale of the path."""
    source: SkeletonMotion
    """The motion, with the rest pose that was used."""
    matches: Matches
    """Joints of the source for joints of the figure."""
    to_target: Floats
    """(3, 3). Rotation from the source's axes to the figure's."""
    scale: float
    """Scale of the path."""


def scaled_motion(motion: SkeletonMotion, factor: float, unit: str = "") -> SkeletonMotion:
    """Return a motion with all lengths times a factor and in ``unit``; RigError unless positive."""
    if not 0.0 < factor < np.inf:
        raise RigError(f"expected a factor above 0, found {factor:g}")
    figure, clip = motion.figure, motion.clip
    skeleton = None if figure.skeleton is None else scaled_skeleton(figure.skeleton, factor)
    shifts, place = clip.translations, clip.figure_translations
    return replace(
        motion,
        figure=replace(figure, skeleton=skeleton, unit=unit),
        clip=replace(
            clip,
            translations=None if shifts is None else shifts * factor,
            figure_translations=None if place is None else place * factor,
        ),
    )


@dataclass(frozen=True, slots=True)
class _Job:
    """Inputs common to all steps of a retargeting."""

    clip: SampledClip
    source: Skeleton
    target: Skeleton
    rests: tuple[RestPose, RestPose]  # in the figure's axes
    matches: Matches
    to_target: Floats  # (3, 3), from the source's axes to the figure's
    is_same: bool
    hangs: bool  # whether the up axis of the frames, not that of the rest poses, points down


def _job(
    motion: SkeletonMotion, source: Skeleton, to: tuple[Skeleton, str], matches: Matches
) -> _Job:
    """Return the inputs of a retargeting; ``to`` is the figure's skeleton and up axis."""
    target, up = to
    to_target = up_rotation(motion.figure.up, up)
    rests = rest_of(source, to_target, up), rest_of(target, np.eye(3), up)
    is_same = matches.is_hierarchy and is_same_rest(*rests, matches, target.parents)
    return _Job(motion.clip, source, target, rests, matches, to_target, is_same, motion.hangs)


def _is_one_rig(source: Skeleton, target: Skeleton, matches: Matches) -> bool:
    """Return whether joints are at the same places in the axes of their parents, up to a scale."""
    if not matches.is_hierarchy:
        return False
    inner = target.parents >= 0
    mine = target.rest_translations[inner]
    theirs = source.rest_translations[matches.partners[inner]]
    sizes = np.linalg.norm(mine), np.linalg.norm(theirs)
    if min(sizes) == 0.0:
        return False
    return bool(np.abs(mine / sizes[0] - theirs / sizes[1]).max() < _ONE_RIG)


def _in_path_unit(motion: SkeletonMotion) -> SkeletonMotion:
    """Return the same motion of a skeleton in the unit of its path, such as metres for MHR."""
    clip, scales = motion.clip, motion.clip.figure_scales
    usual = 1.0 if scales is None or len(scales) == 0 else float(np.median(scales))
    if scales is None or usual == 1.0 or not 0.0 < usual < np.inf:
        return motion
    found = scaled_motion(motion, usual)
    left = None if (scales == usual).all() else scales / usual
    place = clip.figure_translations
    return replace(found, clip=replace(found.clip, figure_translations=place, figure_scales=left))


def with_tips(motion: SkeletonMotion) -> SkeletonMotion:
    """Return a motion whose forearms and shins without a hand or foot end in a joint.

    Without one, the direction of the bone is unknown: the figure's elbows and knees would keep the
    bend of its rest pose, and feet could not be planted. The End Sites of a BVH file show it.
    """
    skeleton, clip = motion.figure.require_skeleton(), motion.clip
    if skeleton.boxes is None or not skeleton.boxes_from_bones:
        return motion
    meanings, has_child = joint_meanings(skeleton), set(skeleton.parents.tolist())
    owners, tips, names = list[int](), list[Floats](), list[str]()
    for _, middle, end in LIMBS:
        if middle not in meanings or end in meanings:
            continue
        joint = meanings.index(middle)
        # An End Site is at twice the centre of its joint's box.
        tip = skeleton.boxes[joint].sum(axis=0)
        length = float(np.linalg.norm(skeleton.rest_translations[joint]))
        low, high = _LOWER
        if joint in has_child or not low * length < np.linalg.norm(tip) < high * length:
            continue
        owners.append(joint)
        tips.append(tip)
        names.append(skeleton.names[joint] + TIPS[end.partition("_")[2]])
    if not owners:
        return motion
    added = len(owners)

    def extended(rows: Floats | None, last: Floats) -> Floats | None:
        if rows is None:
            return None
        return np.concatenate([rows, np.tile(last, (len(rows), added, 1))], axis=1)

    still, one = np.array([0.0, 0.0, 0.0, 1.0]), np.ones(3)
    skeleton = replace(
        skeleton,
        names=(*skeleton.names, *names),
        parents=np.append(skeleton.parents, owners).astype(np.int32),
        rest_translations=np.concatenate([skeleton.rest_translations, tips]),
        rest_rotations=np.concatenate([skeleton.rest_rotations, np.tile(still, (added, 1))]),
        rest_scales=np.concatenate([skeleton.rest_scales, np.tile(one, (added, 1))]),
        boxes=None,
    )
    rotations = extended(clip.rotations, still)
    assert rotations is not None  # clips of skeletons have rotations
    clip = replace(
        clip,
        rotations=rotations,
        translations=extended(clip.translations, np.zeros(3)),
        scales=extended(clip.scales, one),
    )
    return replace(motion, figure=replace(motion.figure, skeleton=skeleton), clip=clip)


def _target_rotations(job: _Job, worlds: Floats) -> Floats:
    """Return the figure's local rotations: (N, J, 4)."""
    source, target = job.rests
    parents = job.target.parents
    corrections = np.tile(np.eye(3), (len(parents), 1, 1))
    if not job.is_same:
        corrections = alignment(source, target, job.matches, parents)
    rotation = matrix_to_quaternion(job.to_target)
    found = np.empty((len(worlds), job.target.n_joints, 4))
    local = np.empty_like(found)
    for joint, partner in enumerate(job.matches.partners):
        parent = parents[joint]
        above = found[:, parent] if parent >= 0 else np.array([0.0, 0.0, 0.0, 1.0])
        if partner < 0:
            rest = job.target.rest_rotations[joint]
            local[:, joint] = rest / np.linalg.norm(rest, axis=-1)
            found[:, joint] = multiply(above, local[:, joint])
            continue
        after = source.rotations[partner].T @ job.to_target.T @ corrections[joint]
        rest = matrix_to_quaternion(after @ target.rotations[joint])
        found[:, joint] = multiply(multiply(rotation, worlds[:, partner]), rest)
        local[:, joint] = multiply(conjugate(above), found[:, joint])
    align_signs(local)
    return local


def _path_scale(source: RestPose, target: RestPose, matches: Matches) -> tuple[float, Phrase]:
    """Return target over source length, of legs, else arms, else all joints; and of which."""
    partners, names = matches.partners, matches.names
    place = {name: joint for joint, name in enumerate(names) if name and partners[joint] >= 0}

    def length(pairs: list[tuple[int, int]]) -> tuple[float, float]:
        ends = np.array(pairs, dtype=np.int32).reshape(-1, 2).T
        mine = target.points[ends[1]] - target.points[ends[0]]
        theirs = source.points[partners[ends[1]]] - source.points[partners[ends[0]]]
        return float(np.linalg.norm(mine, axis=1).sum()), float(
            np.linalg.norm(theirs, axis=1).sum()
        )

    matched = np.flatnonzero(partners >= 0)
    bones = [(int(matched[0]), int(joint)) for joint in matched[1:]]
    choices = [
        ("the ratio of leg lengths", _pairs(_LIMBS[0], place)),
        ("the ratio of arm lengths", _pairs(_LIMBS[1], place)),
        ("the ratio of bone lengths", bones),
    ]
    for what, pairs in choices:
        mine, theirs = length(pairs)
        if mine > 0.0 and theirs > 0.0:
            ratio = mine / theirs
            return (1.0 if abs(ratio - 1.0) < _ROUNDING else ratio), Phrase(what)
    return 1.0, Phrase("because no lengths can be compared")


def _pairs(limb: tuple[str, ...], place: dict[str, int]) -> list[tuple[int, int]]:
    """Return the bones of a limb on both sides, as pairs of joints that are matched."""
    return [
        (place[start], place[end])
        for side in _SIDES
        for start, end in pairwise(f"{side}_{part}" for part in limb)
        if start in place and end in place
    ]


def _shifts(
    job: _Job, worlds: Floats, rotations: Floats, scale: float
) -> tuple[Floats, list[Diagnostic]]:
    """Return offsets to the target's rest translations, (N, J, 3), and messages."""
    shifts = np.zeros((len(worlds), job.target.n_joints, 3))
    places = _source_places(job, worlds)
    if job.is_same:
        _transfer_translations(job, scale, shifts)
        roots = np.flatnonzero(job.target.parents < 0)
        for root in roots:
            wanted = scale * places[:, job.matches.partners[root]] @ job.to_target.T
            shifts[:, root] = wanted - job.target.rest_translations[root]
        return shifts, []
    # Only the root translates, by the part that the joints between root and anchor do not
    # contribute.
    anchor = _anchor(job)
    path = path_to_root(job.target.parents, anchor)[::-1]
    linear = np.eye(3)
    reached = np.zeros((len(worlds), 3))
    for joint in path:
        reached = reached + linear @ job.target.rest_translations[joint]
        rotation = quaternion_to_matrix(rotations[:, joint])
        linear = linear @ rotation * job.target.rest_scales[joint]
    wanted = scale * places[:, job.matches.partners[anchor]] @ job.to_target.T
    offset = _ground_offset(job, scale)
    shifts[:, path[0]] = wanted + (-offset if job.hangs else offset) - reached
    return shifts, _dropped_translations(job)


def _anchor(job: _Job) -> int:
    """Return the joint that follows the source's path: the pelvis, or the first matched joint."""
    matched = job.matches.partners >= 0
    names = job.matches.names
    if "pelvis" in names and matched[names.index("pelvis")]:
        return names.index("pelvis")
    return int(np.flatnonzero(matched)[0])


def _source_places(job: _Job, worlds: Floats) -> Floats:
    """Return the positions of the source's joints in its own axes: (N, J, 3)."""
    clip, skeleton = job.clip, job.source
    places = np.tile(skeleton.rest_translations, (len(worlds), 1, 1))
    if clip.translations is not None:
        places += clip.translations
    scales = skeleton.rest_scales[None] if clip.scales is None else clip.scales
    if (scales != 1.0).any():
        linear = quaternion_to_matrix(job.clip.rotations) * scales[:, :, None, :]
        places = joint_worlds(job.source.parents, linear, places)[..., :3, 3].copy()
    else:
        for joint, parent in enumerate(skeleton.parents):
            if parent >= 0:
                parent_rotations = quaternion_to_matrix(worlds[:, parent])
                places[:, joint] = np.einsum("nab,nb->na", parent_rotations, places[:, joint])
                places[:, joint] += places[:, parent]
    if clip.figure_scales is not None:
        places *= clip.figure_scales[:, None, None]
    if clip.figure_translations is not None:
        places += clip.figure_translations[:, None]
    return places


def _transfer_translations(job: _Job, scale: float, shifts: Floats) -> None:
    """Transfer translations of joints below the root, in place; the parents' axes may differ."""
    if job.clip.translations is None:
        return
    source, target = job.rests
    for joint, parent in enumerate(job.target.parents):
        partner = job.matches.partners[joint]
        moves = job.clip.translations[:, partner]
        if parent >= 0 and moves.any():
            above = job.matches.partners[parent]
            axes = target.rotations[parent].T @ job.to_target @ source.rotations[above]
            shifts[:, joint] = scale * moves @ axes.T


def _dropped_translations(job: _Job) -> list[Diagnostic]:
    """Return messages about source joints whose translations are not transferred."""
    moves = job.clip.translations
    if moves is None:
        return []
    largest = np.linalg.norm(moves, axis=2).max(axis=0)
    size = float(np.ptp(job.rests[0].points, axis=0).max()) or 1.0
    largest[path_to_root(job.source.parents, int(job.matches.partners[_anchor(job)]))] = 0.0
    found = np.flatnonzero(largest > _STILL * size)
    if not len(found):
        return []
    worst = int(found[largest[found].argmax()])
    values = {
        "n": counted(len(found), "joint"),
        "most": rounded(float(largest[worst])),
        "joint": joint_label(job.source, worst),
        "their": agree(len(found), "its parent", "their parents"),
    }
    return [
        note(
            "F007.joint-positions-left-out: translations of {n} relative to {their} omitted "
            "(largest: {most} at {joint})",
            **values,
        )
    ]


def _ground_offset(job: _Job, scale: float) -> Floats:
    """Return ``ground_offset`` of the two skeletons, both in the source's rest pose."""
    still = matrix_to_quaternion(job.rests[0].rotations)[None]
    rotations = quaternion_to_matrix(_target_rotations(job, still)[0])
    linear = rotations * job.target.rest_scales[:, None, :]
    worlds = joint_worlds(job.target.parents, linear, job.target.rest_translations)
    points = worlds[:, :3, 3]
    source, _ = job.rests
    return ground_offset(source.points, points, job.matches, source.up, scale)


def ground_offset(
    source: Floats, target: Floats, matches: Matches, up: Floats, scale: float
) -> Floats:
    """Return the offset (3,) along ``up`` that brings the target's feet to the scaled source's.

    ``source`` (J', 3), ``target`` (J, 3): joints in the source's rest pose, common axes. 0 if
    pelvis or feet are unmatched, or the source does not stand.
    """
    # The path is scaled by the ratio of leg lengths from hip to ankle, but feet and hips may have
    # another ratio: without the offset, a body with high ankles sinks into the ground.
    place = {
        name: joint for joint, name in enumerate(matches.names) if matches.partners[joint] >= 0
    }
    feet = [place[name] for name in _FEET if name in place]
    if "pelvis" not in place or not feet:
        return 0.0 * up
    pelvis, partners = place["pelvis"], matches.partners
    legs = source[partners[pelvis]] - source[partners[feet]]
    theirs = (legs @ up).max()
    if theirs < _UPRIGHT * np.linalg.norm(legs, axis=1).max():
        return 0.0 * up
    mine = ((target[pelvis] - target[feet]) @ up).max()
    return (mine - scale * theirs) * up


def expression_weights(
    expressions: Mapping[str, Floats], figure: Figure
) -> tuple[Floats | None, list[Diagnostic]]:
    """Return blend shape weights (N, S), None if none moves, and notes on missing expressions."""
    found = expression_columns(expressions, figure)
    missing = [name for name, rows in expressions.items() if name not in found and rows.any()]
    notes = (
        [
            note(
                "F007.expressions-unmatched: the figure lacks expressions: {names}",
                names=listed(missing, 12),
            )
        ]
        if missing
        else []
    )
    if not found:
        return None, notes
    count = len(next(iter(expressions.values())))
    weights = np.tile(figure_pose(figure).shape_weights, (count, 1))
    for name, column in found.items():
        weights[:, column] = expressions[name]
    return weights, notes


def expression_columns(names: Iterable[str], figure: Figure) -> dict[str, int]:
    """Return the blend shapes of expressions that a figure has, by their names in VRM 0 or 1."""
    shapes = figure.blend_shapes
    own = () if shapes is None else shapes.names
    # Expressions come after the morph targets, whose names they may share.
    columns = {_plain(name): column for column, name in enumerate(own)}
    rules = None if shapes is None else shapes.rules
    for row, preset in zip(rules.rows, rules.presets, strict=False) if rules is not None else ():
        if preset:
            columns[_plain(preset)] = int(row)
    return {name: columns[_plain(name)] for name in names if _plain(name) in columns}


def _plain(name: str) -> str:
    lower = name.lower()
    return OLD_PRESETS.get(lower, lower).lower()


def _limbs_at_rest(
    motion: SkeletonMotion, figure: Figure, matches: Matches, rotations: Floats
) -> list[Diagnostic]:
    """Warn of limbs that never move: their names mostly have no known meaning, or a wrong one."""
    source, target = motion.figure.require_skeleton(), figure.require_skeleton()
    mine, theirs = joint_labels(target), joint_labels(source)
    places = {name: joint for joint, name in enumerate(matches.names) if name}
    meanings = joint_meanings(source)
    called = {"motion": motion.figure.name, "figure": figure.name}
    unmatched, unknown = [], []
    for limb, side in product(_LIMBS, _SIDES):
        has_limb = any(f"{side}_{part}" in places for part in limb)
        # Hands may stay at rest; feet that do not follow cannot stand.
        parts = limb if limb == _LIMBS[0] else limb[:2]
        for name in (f"{side}_{part}" for part in parts):
            if name in places and matches.partners[places[name]] < 0:
                unmatched.append(mine[places[name]])
            elif name not in places and name in meanings and has_limb:
                unknown.append(name.replace("_", " "))
    found, remedy = list[Diagnostic](), Remedy("", " or with --joint-map")

    def warn(key: str, **values: object) -> None:
        found.append(note(key, **values))

    if unmatched:
        used = set(matches.partners.tolist())
        # Joints without a meaning are the likely ones.
        unused = [name for j, name in enumerate(theirs) if j not in used and not meanings[j]]
        warn(
            "C018.limbs-unmatched: {names} of {figure} {stay} at rest: nothing in {motion} is "
            "recognised as {these} (unused: {unused}); match {them} in the Joint match "
            "panel{remedy}"
            if unused
            else "C018.limbs-absent: {names} of {figure} {stay} at rest: {motion} has no such "
            "{limbs}",
            **called,
            limbs=agree(len(unmatched), "joint", "joints"),
            n=len(unmatched),
            names=listed(unmatched),
            unused=listed(unused),
            stay=agree(len(unmatched), "stays", "stay"),
            these=agree(len(unmatched), "this joint", "these joints"),
            them=agree(len(unmatched), "it", "them"),
            remedy=remedy,
        )
    idle = [mine[j] for j in np.flatnonzero(matches.partners < 0) if not matches.names[j]]
    if unknown and idle:
        warn(
            "C018.limbs-unknown: no joint of {figure} is recognised as {parts}: {motion} "
            "cannot move {them} (at rest: {idle}); match {them} in the Joint match panel{remedy}",
            **called,
            n=len(unknown),
            parts=one_of(unknown),
            idle=listed(idle),
            them=agree(len(unknown), "it", "them"),
            remedy=remedy,
        )
    is_still, is_moving = _extent(rotations)
    for upper, lower, _ in _LIMBS:
        pairs = [[places.get(f"{side}_{part}", -1) for part in (upper, lower)] for side in _SIDES]
        stiff = [
            end
            for start, end in pairs
            if min(start, end) >= 0 and is_moving[start] and is_still[end]
            if min(matches.partners[start], matches.partners[end]) >= 0
        ]
        if stiff:
            warn(
                "C018.limbs-still: {names} of {figure} never {bend}, because {partners} of "
                "{motion} never {do}; if this is wrong, match other joints in the Joint match "
                "panel{remedy}",
                **called,
                n=len(stiff),
                names=listed([mine[joint] for joint in stiff]),
                partners=listed([theirs[matches.partners[joint]] for joint in stiff]),
                bend=agree(len(stiff), "bends", "bend"),
                do=agree(len(stiff), "does", "do"),
                remedy=remedy,
            )
    return found


def _extent(rotations: Floats) -> tuple[Bools, Bools]:
    """Return which joints never move, and which do: (J,) each; neither if there are no frames."""
    if not len(rotations):
        still = np.zeros(rotations.shape[1], dtype=bool)
        return still, still
    # The chord of two unit quaternions is half the angle between small rotations.
    first = rotations[:1]
    chords = np.minimum(
        np.linalg.norm(rotations - first, axis=2), np.linalg.norm(rotations + first, axis=2)
    ).max(axis=0)
    return chords < 0.5 * _NEVER, chords > 0.5 * _MOVING
