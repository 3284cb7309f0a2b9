"""Rest poses of two skeletons, aligned joint by joint."""

from __future__ import annotations

import numpy as np

from viewer.data_classes import dataclass
from viewer.rigs.arrays import Floats, Ints
from viewer.rigs.geometry.quaternion import between
from viewer.rigs.geometry.rotation import (
    nearest_rotations,
    quaternion_to_matrix,
)
from viewer.rigs.geometry.vectors import axes_along, axis_vector, unit
from viewer.rigs.kinematics import joint_worlds, world_matrices
from viewer.rigs.pose import zero_pose
from viewer.rigs.retargeting.joint_matches import Matches
from viewer.rigs.skeleton import Skeleton

# The rest poses of six standing skeletons were compared in pairs: the bundled body, SMPL, Mixamo,
# MakeHuman, MHR and a character with short legs. Thighs and shins differ by at most 11 degrees,
# upper arms of a T- and an A-pose by 42 to 48. Feet and spines differ by up to 25 in nine of ten
# pairs and by 37 at most; feet of a rest pose that does not stand (SOMA) by 43 and more.

# Cosine of the maximum angle between the bones of equal rest poses. Only skeletons of one hierarchy
# are compared, mostly one rig in several shapes: each of the ten shape weights of the bundled body
# and of an SMPL body, at 2 and -2, changes bones by at most 14 degrees. A T- and an A-pose differ
# by more. If one bone exceeds the limit, the rest poses are aligned.
_SAME = np.cos(np.radians(20.0))

# Cosine of the maximum difference for which a torso or foot keeps its bend.
_NATURAL = np.cos(np.radians(25.0))

# Cosine of the maximum angle of an upright body from the up axis: the line from the hips to the
# neck leans by as much as a spine bends.
_UPRIGHT = np.cos(np.radians(25.0))

# The same for bones of a trunk that is as upright as the other's from pelvis to head.
_SLANTED = np.cos(np.radians(60.0))

# Minimum length of bones with a reliable direction, as a fraction of the skeleton's size: far above
# the rounding of files in single precision (6e-8), far below any bone (1e-3 for a finger's).
_SHORT = 1e-6

# Weight of the reference, relative to that of a bone, in the rotation that fits several bones. It
# decides what the bones leave open; see ``_at_joint`` for what it changes otherwise.
_SLIGHT = 1e-6

# Cosine of the bend of a knee up to which a leg points down as a whole.
_UNFOLDED = np.cos(np.radians(60.0))

# Sine of the angle below which two directions are parallel and define no plane.
_PARALLEL = 1e-6

# Parts whose bend is a matter of the character; see ``_at_joint``.
_NATURALLY_BENT = ("pelvis", "spine", "neck", "head", "jaw", "collar", "ankle", "foot", "eye")
_SPINE = ("spine", "neck", "head")
_FACE = ("eye", "jaw")  # joints that do not indicate the direction of the head
_FINGERS = ("index", "middle", "pinky", "ring", "thumb")


@dataclass(frozen=True, slots=True, eq=False)
class RestPose:
    """Positions and rotations of joints at rest."""

    points: Floats
    """(J, 3). World positions, in the common axes of the two skeletons."""
    rotations: Floats
    """(J, 3, 3). World rotations, in the skeleton's own axes."""
    up: Floats
    """(3,). The up axis in the common axes."""


def rest_of(skeleton: Skeleton, to_common: Floats, up: str) -> RestPose:
    """Return the rest pose with DOFs at 0; ``to_common`` (3, 3) rotates points to common axes."""
    points = world_matrices(skeleton, zero_pose(skeleton))[:, :3, 3]
    local = quaternion_to_matrix(skeleton.rest_rotations)
    axis = axis_vector(up)
    # Translations do not change world rotations.
    worlds = joint_worlds(skeleton.parents, local, np.zeros(3))[:, :3, :3]
    return RestPose(points @ to_common.T, worlds, axis)


def is_same_rest(source: RestPose, target: RestPose, matches: Matches, parents: Ints) -> bool:
    """Return whether all bones point the same way in both; needs ``matches.is_hierarchy``."""
    # Every joint has a partner then: -1, no partner, would be taken for the last joint. Lengths may
    # differ: |a| |b| cos is compared with |a| |b| times the limit.
    inner = np.flatnonzero(parents >= 0)
    bones = target.points[inner] - target.points[parents[inner]]
    partners = matches.partners
    others = source.points[partners[inner]] - source.points[partners[parents[inner]]]
    lengths = np.linalg.norm(bones, axis=1) * np.linalg.norm(others, axis=1)
    cosines = np.einsum("ja,ja->j", bones, others)
    return bool((cosines >= _SAME * lengths).all())


def alignment(source: RestPose, target: RestPose, matches: Matches, parents: Ints) -> Floats:
    """Return rotations (J, 3, 3) from the target's rest pose to the source's, in common axes."""
    # B of the module retarget: W_t = W_s R_s^-1 B R_t with the world rotations W of a joint in a
    # frame and R at rest, of the source s and the target t, all in the common axes. If the target's
    # rest pose, rotated by B at each joint, is the source's rest pose, then the target shows the
    # source's pose in every frame. A bone gives two of the three degrees of freedom of B, its
    # direction; the rest, the twist about the bone, comes from a rotation that is already known: of
    # the whole body or of the nearest matched ancestor (reference). Joints are visited from the
    # root down, so that the reference is known. So limbs rotate from the body without twist, a
    # finger's joint from the one above it; hands with fingers also align the knuckle line; trunk
    # and feet follow the body unless they differ greatly, and the last joint of a limb follows the
    # one before it.
    whole_body = _standing(source, target, matches)
    is_trunk_alike = _is_trunk_alike(source, target, matches, whole_body)
    result = np.tile(np.eye(3), (len(parents), 1, 1))
    above = _matched_above(matches, parents)
    short = _SHORT * max(float(np.ptp(rest.points, axis=0).max()) for rest in (source, target))
    for joint in np.flatnonzero(matches.partners >= 0):
        reference = whole_body if above[joint] < 0 else result[above[joint]]
        children = [int(child) for child in np.flatnonzero(above == joint)]
        children = [child for child in children if not matches.names[child].endswith(_FACE)]
        mine, theirs = _bones(source, target, matches, int(joint), children)
        # Joints attached to the side of a spine do not indicate its direction.
        spine = np.array([matches.names[child].startswith(_SPINE) for child in children])
        if matches.names[joint].startswith(_SPINE) and spine.any():
            mine, theirs = mine[spine], theirs[spine]
            children = [child for child, is_spine in zip(children, spine, strict=True) if is_spine]
        long = np.minimum(np.linalg.norm(mine, axis=1), np.linalg.norm(theirs, axis=1)) > short
        chosen = [child for child, is_long in zip(children, long, strict=True) if is_long]
        if not chosen and matches.names[joint].endswith("_ankle"):
            reference = _with_leg(source, target, matches, int(joint), whole_body, reference)
        slants = is_trunk_alike and matches.names[joint].startswith(_SPINE)
        natural = _SLANTED if slants else _NATURAL
        result[joint] = _at_joint(
            matches, int(joint), chosen, (mine[long], theirs[long]), whole_body, reference, natural
        )
    return result


def _is_trunk_alike(
    source: RestPose, target: RestPose, matches: Matches, whole_body: Floats
) -> bool:
    """Return whether two bodies hold trunk and head alike: from pelvis to head, else to neck."""
    # A single bone does not tell. Below a head that looks straight ahead, the neck slants by up to
    # 40 degrees if it is short, or its joint at the nape: were such a bone aligned, the head would
    # bow. The whole line is long, so the exact places of its ends matter little.
    used = {name for name, p in zip(matches.names, matches.partners, strict=True) if p >= 0}
    top = next((name for name in ("head", "neck") if name in used), "")
    if "pelvis" not in used or not top:
        return False
    ends = [matches.names.index(name) for name in ("pelvis", top)]
    mine, theirs = (
        unit(np.diff(points, axis=0)[0])
        for points in (target.points[ends], source.points[matches.partners[ends]])
    )
    return bool(whole_body @ mine @ theirs > _NATURAL)


def _at_joint(
    matches: Matches,
    joint: int,
    children: list[int],
    bones: tuple[Floats, Floats],
    whole_body: Floats,
    reference: Floats,
    natural: float,
) -> Floats:
    """Return one joint's rotation; ``reference`` is the nearest matched ancestor's rotation.

    ``natural``: cosine of the maximum difference for which the joint keeps its bend.
    """
    part = matches.names[joint].removeprefix("left_").removeprefix("right_")
    mine, theirs = (bone / np.linalg.norm(bone, axis=-1, keepdims=True) for bone in bones)
    # The end of a chain has no direction of its own: a head or a foot without toes moves with the
    # joint above it.
    if not children:
        return reference
    # Spines and feet of two characters bend differently by nature. If B aligned them, a stooped
    # character would be straightened, and soles would tilt, so they keep their bend relative to the
    # body. Beyond 25 degrees, which nine of ten pairs of standing bodies keep to, the difference is
    # due to another rest pose, as of a body with hanging feet, and is aligned. Bones of two trunks
    # that are alike as a whole may slant by more.
    if part.startswith(_NATURALLY_BENT):
        near = np.einsum("ab,kb,ka->k", whole_body, mine, theirs)
        if part == "pelvis" or (near > natural).all():
            return whole_body
    if part == "wrist":
        knuckles = _knuckles(matches, children, bones)
        if knuckles is not None:
            return knuckles
    if len(children) > 1:
        # The rotation B that minimises sum_k |theirs_k - B mine_k|^2 maximises the trace of B^T M
        # with M = sum_k theirs_k mine_k^T, and is the rotation nearest to M (Kabsch 1976; Horn
        # 1987). M has rank 1 if all directions are parallel, and then leaves the twist open: a
        # millionth of the reference decides it. It also changes the twist where directions are not
        # parallel: two directions at an angle f give M the singular values 1 + cos f, 1 - cos f and
        # 0, and the resistance to twist is the sum of the last two, about f^2 / 2. The reference
        # pulls with at most 2e-6, so it twists by up to 4e-6 / f^2 radians: 0.008 degrees at f = 10
        # degrees. Below about 0.1 degrees it decides, as it should; bones are never rotated by more
        # than about 1e-3 radians.
        sums = np.einsum("ka,kb->ab", theirs, mine) + _SLIGHT * reference
        return nearest_rotations(sums)[0]
    # B = A S: S brings the target's bone near, A is the smallest rotation from there to the
    # source's bone. A rotates about an axis perpendicular to both, so it adds no twist to that of
    # S. Limbs start from the body, so that an upper arm's rotation does not twist the forearm.
    #
    # Fingers start from the joint above, so that the axis about which a finger curls is carried
    # along. A finger that curls in one plane is not twisted. One that is spread by 10 degrees and
    # then points 20, 60 and 90 degrees down is twisted by 1.8 degrees in all three joints; if each
    # started from the hand, by 1.8, 5.8 and 10. If the spread itself differs between the joints
    # (10, 5 and 0 degrees), the twist reaches 7 degrees, from the hand 3.
    start = reference if part.startswith(_FINGERS) else whole_body
    return shortest_arc(start @ mine[0], theirs[0]) @ start


def _with_leg(
    source: RestPose,
    target: RestPose,
    matches: Matches,
    ankle: int,
    whole_body: Floats,
    reference: Floats,
) -> Floats:
    """Return the rotation of a foot without toes: that of its leg as a whole, from hip to ankle.

    ``reference`` if a leg is folded, or its joints are not matched.
    """
    # Where legs stand apart at rest, so do the feet. But knees are bent at rest in one skeleton and
    # not in the other, with the feet level in both: the shin is no reference for the foot.
    side = matches.names[ankle].removesuffix("ankle")
    upper = [side + part for part in ("hip", "knee")]
    if not set(upper) <= set(matches.names):
        return reference
    joints = [*(matches.names.index(name) for name in upper), ankle]
    partners = matches.partners[joints]
    if (partners < 0).any():
        return reference
    lines = []
    for points in (target.points[joints], source.points[partners]):
        thigh, shin = np.diff(points, axis=0)
        if not thigh @ shin > _UNFOLDED * np.linalg.norm(thigh) * np.linalg.norm(shin):
            return reference
        lines.append(thigh + shin)
    mine, theirs = (line / np.linalg.norm(line) for line in lines)
    return shortest_arc(whole_body @ mine, theirs) @ whole_body


def _bones(
    source: RestPose, target: RestPose, matches: Matches, joint: int, children: list[int]
) -> tuple[Floats, Floats]:
    """Return vectors from a joint to joints below it, in the target and in the source: (K, 3)."""
    # A partner is the source's joint that drives a joint of the target. Unmatched joints in between
    # do not matter: these vectors lead from one matched joint to the next one.
    partners = matches.partners
    mine = target.points[children] - target.points[joint]
    return mine, source.points[partners[children]] - source.points[partners[joint]]


def _knuckles(matches: Matches, children: list[int], bones: tuple[Floats, Floats]) -> Floats | None:
    """Return the rotation of a hand from the mean finger direction and the knuckle line."""
    rows = {matches.names[child].rpartition("_")[2]: row for row, child in enumerate(children)}
    fingers = [rows[f"{name}1"] for name in _FINGERS[:4] if f"{name}1" in rows]
    if "index1" not in rows or not ({"pinky1", "ring1"} & set(rows)):
        return None
    last = rows.get("pinky1", rows.get("ring1"))
    # The axes of a hand are those of its knuckle line (from index to little finger) and its mean
    # finger. If F_s and F_t have those of source and target as columns, F_s F_t^T maps one hand to
    # the other.
    frames = [
        _frame(bone[last] - bone[rows["index1"]], bone[fingers].mean(axis=0)) for bone in bones
    ]
    if frames[0] is None or frames[1] is None:
        return None
    return frames[1] @ frames[0].T


def _matched_above(matches: Matches, parents: Ints) -> Ints:
    """Return each joint's nearest matched ancestor (J,): -1 for none, -2 for unmatched joints."""
    above = np.full(len(parents), -1, dtype=np.int32)
    for joint, parent in enumerate(parents):  # parents precede children
        if parent >= 0:
            above[joint] = parent if matches.partners[parent] >= 0 else above[parent]
    above[matches.partners < 0] = -2  # unmatched joints are not children of any joint
    return above


def _standing(source: RestPose, target: RestPose, matches: Matches) -> Floats:
    """Return the rotation of the target's whole body, from its sides and the up axis."""
    # Each body gets a frame F of its own axes (left, up, forward) from the joints that are matched,
    # so that both see the same ones. F_s F_t^T then rotates the target's axes to the source's.
    joints = {
        name: joint
        for joint, name in enumerate(matches.names)
        if name and matches.partners[joint] >= 0
    }
    frames = []
    for rest, of in ((target, lambda joint: joint), (source, lambda j: int(matches.partners[j]))):
        places = {name: rest.points[of(joint)] for name, joint in joints.items()}
        frames.append(_body_frame(places, rest.up))
    if frames[0] is None or frames[1] is None:
        # Without sides, as of a snake, all that is known is that both have common axes.
        return np.eye(3)
    return frames[1] @ frames[0].T


def _body_frame(places: dict[str, Floats], up: Floats) -> Floats | None:
    """Return the axes of a body: left, up along its height, and forward."""
    # Hips first: the pelvis between them is one bone. Shoulders and collars move against each
    # other, knees and elbows with legs and arms.
    parts = ("hip", "shoulder", "collar", "knee", "elbow")
    pairs = (part for part in parts if {f"left_{part}", f"right_{part}"} <= set(places))
    part = next(pairs, None)
    high = [places[name] for name in ("neck", "head", "left_shoulder", "right_shoulder", "spine3")
            if name in places]  # fmt: skip
    low = [places[name] for name in ("left_hip", "right_hip", "pelvis") if name in places]
    if part is None or not high or not low:
        return None
    height = np.mean(high, axis=0) - np.mean(low, axis=0)
    # The bend of the spine must not tilt an upright body. ``retarget`` has already rotated a lying
    # source upright, so both bodies are upright as a rule. If one leans by more than 25 degrees,
    # its rest pose is taken to lean as a whole: B contains all of its lean, and nothing of the
    # other's, which is at most 25 (the bundled body leans by 2, SMPL by 1).
    is_upright = height @ up > _UPRIGHT * np.linalg.norm(height)
    return _frame(places[f"left_{part}"] - places[f"right_{part}"], up if is_upright else height)


def _frame(side: Floats, main: Floats) -> Floats | None:
    """Return ``axes_along``; None if the vectors are parallel."""
    # |side x main| = |side| |main| sin(angle between them).
    least = _PARALLEL * np.linalg.norm(side) * np.linalg.norm(main)
    return axes_along(main, side) if np.linalg.norm(np.cross(side, main)) > least else None


def shortest_arc(start: Floats, end: Floats) -> Floats:
    """Return the smallest rotation from one direction to another: (3, 3)."""
    return quaternion_to_matrix(between(start, end))
