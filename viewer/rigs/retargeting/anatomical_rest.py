"""Rest pose of a body from its anatomy, for motions without a frame in a T- or A-pose.

The trunk stands upright in its mean posture, the legs hang straight down with the knees' axes
sideways, the arms point straight to the sides with the elbows' axes vertical, and the soles are
level. Hands are straight if shoulder, elbow and wrist are collinear in the zero pose. All other
joints keep their mean rotation. A bend of the spine or a twist of the forearms that never changes
cannot be detected and becomes part of the rest pose, unless the axes of the joints are parallel to
the body's: see ``_parallel_axes``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise, permutations, product

import numpy as np

from viewer.data_classes import dataclass
from viewer.rigs.arrays import Bools, Floats, Ints
from viewer.rigs.geometry.rotation import (
    nearest_rotations,
    quaternion_to_matrix,
    rotation_distance,
    rotation_vector_to_matrix,
)
from viewer.rigs.geometry.vectors import Up, axes_along, axis_vector, unit
from viewer.rigs.hierarchy import path_to_root, with_ancestors
from viewer.rigs.kinematics import joint_worlds
from viewer.rigs.motion.skeleton_motion import SkeletonMotion
from viewer.rigs.retargeting.joint_names import joint_meanings
from viewer.rigs.retargeting.rest_alignment import shortest_arc
from viewer.rigs.skeleton import Skeleton

_TRUNK = ("pelvis", "spine", "neck", "head", "collar")

# Cosines of the angles of the trunk from the up axis, below which a person is upright, and beyond
# which a person bends or lies. People walk and run within 15 degrees. If less than _ENOUGH of the
# frames are upright, as of a person who stoops all the time, stooped ones are used as well.
_UPRIGHT, _STOOPED = np.cos(np.radians(30.0)), np.cos(np.radians(60.0))
_ENOUGH = 0.05

# Of the zero pose: cosines of the angles between the bones of a straight arm, and between forearm
# and fingers of a straight hand, which bend by a few degrees in models of relaxed hands.
_COLLINEAR, _ALONG = np.cos(np.radians(10.0)), np.cos(np.radians(30.0))

# Cosine of the mean bend of a wrist beyond which its zero pose is not straight: wrists bend by at
# most 80 degrees, so a mean beyond that is a matter of the axes, not of the anatomy.
_BENT = np.cos(np.radians(85.0))

# Slope from the ankle, 80 mm above the sole, down to the ball, about 140 mm ahead, of a standing
# foot. Used only if the person never stands.
_SLOPE = np.radians(30.0)

# Percentage of the frames in which a foot is lowest and its sole level. A walker's foot stands for
# 60 % of the time, but heel and toes are both on the ground for only half of that.
_STANCE = 25.0
SIDES = ("left", "right")
_NEEDED = ("hip", "knee", "ankle", "shoulder", "elbow", "wrist")  # joints of limbs with names
_MOST = 4000  # maximum number of frames; for longer motions, every n-th frame is used


@dataclass(frozen=True, slots=True, eq=False)
class Postures:
    """Poses of a human body whose limbs have known names."""

    rows: Ints
    """(F,). Row of each pose in the clip."""
    rotations: Floats
    """(F, J, 3, 3). World rotations, in the skeleton's axes."""
    points: Floats
    """(F, J, 3). World positions, relative to the root, in the skeleton's axes."""
    joints: dict[str, int]
    """Joints by their names in SMPL."""
    up: Floats
    """(3,). The up axis of the file; the up axis of the body if it is upside down."""

    def direction(self, start: str, end: str) -> Floats:
        """Return unit vectors from one joint to another: (F, 3)."""
        return unit(self.points[:, self.joints[end]] - self.points[:, self.joints[start]])

    def trunk(self) -> Floats:
        """Return unit vectors from the middle of the hips to the neck: (F, 3)."""
        hips = self.points[:, [self.joints["left_hip"], self.joints["right_hip"]]].mean(axis=1)
        top = self.joints["neck" if "neck" in self.joints else "head"]
        return unit(self.points[:, top] - hips)

    def left(self) -> Floats:
        """Return horizontal unit vectors to the body's left: (F, 3)."""
        side = self.direction("right_hip", "left_hip")
        return unit(side - (side @ self.up)[:, None] * self.up)

    def forward(self) -> Floats:
        """Return horizontal unit vectors to the front of the body: (F, 3)."""
        return np.cross(self.left(), self.up)

    @property
    def stands(self) -> Floats:
        """Left, up and forward of the standing body as columns: (3, 3)."""
        left = np.array([1.0, 0.0, 0.0])
        return np.stack([left, self.up, np.cross(left, self.up)], axis=1)

    def righted(self) -> Postures:
        """Return the poses rotated as a whole, with the trunk along ``up`` and the left along x."""
        trunk, side = self.trunk(), self.direction("right_hip", "left_hip")
        ahead = unit(np.cross(side, trunk))
        own = np.stack([np.cross(trunk, ahead), trunk, ahead], axis=2)
        turns = self.stands @ np.swapaxes(own, 1, 2)
        return replace(
            self,
            rotations=turns[:, None] @ self.rotations,
            points=np.einsum("fab,fjb->fja", turns, self.points),
        )

    def chosen(self, frames: Bools) -> Postures:
        """Return the poses at the given indices."""
        return replace(
            self,
            rows=self.rows[frames],
            rotations=self.rotations[frames],
            points=self.points[frames],
        )


def postures_of(motion: SkeletonMotion) -> Postures | None:
    """Return the poses of a motion; None if its limbs or its head have no known names."""
    skeleton = motion.figure.skeleton
    rows = motion.clip.timing.rows
    rows = rows[rows >= 0]
    if skeleton is None or not len(rows):
        return None
    rows = rows[:: -(-len(rows) // _MOST)]
    return _postures(skeleton, motion.figure.up, rows, motion.clip.rotations[rows])


def rest_posture(skeleton: Skeleton, up: Up) -> Postures | None:
    """Return the rest pose of a skeleton, with all DOFs at 0, as a single pose."""
    return _postures(skeleton, up, np.zeros(1, dtype=np.int32), skeleton.rest_rotations[None])


def _postures(skeleton: Skeleton, up: Up, rows: Ints, local: Floats) -> Postures | None:
    joints: dict[str, int] = {}
    for joint, name in enumerate(joint_meanings(skeleton)):
        if name:
            joints.setdefault(name, joint)
    needed = {f"{side}_{part}" for side in SIDES for part in _NEEDED}
    if not needed <= set(joints) or not {"neck", "head"} & set(joints):
        return None
    # Positions are relative to the root.
    offsets = np.where(skeleton.parents[:, None] < 0, 0.0, skeleton.rest_translations)
    worlds = joint_worlds(skeleton.parents, quaternion_to_matrix(local), offsets)
    rotations, points = worlds[..., :3, :3].copy(), worlds[..., :3, 3].copy()
    found = Postures(rows, rotations, points, joints, axis_vector(up))
    is_over = float(np.median(found.trunk() @ found.up)) < 0.0
    return replace(found, up=-found.up) if is_over else found


@dataclass(frozen=True, slots=True, eq=False)
class AnatomicalRest:
    """A standing pose found from the anatomy."""

    rotations: Floats
    """(J, 3, 3). World rotations of the joints, in the skeleton's axes."""
    unseen: tuple[str, ...]
    """Joints of limbs whose roll is assumed, because the motion does not show it."""
    is_parallel: bool
    """Whether the axes of the joints are parallel to the body's."""


def upright_frames(postures: Postures) -> Postures | None:
    """Return the poses with an upright trunk; None if most poses are not upright."""
    heights = postures.trunk() @ postures.up
    if np.median(heights) < _STOOPED:
        return None
    chosen = heights > _UPRIGHT
    return postures.chosen(chosen if chosen.mean() > _ENOUGH else heights > _STOOPED)


def anatomical_rest(
    postures: Postures, skeleton: Skeleton, has_stances: bool = True
) -> AnatomicalRest:
    """Return the rotations of the joints in a standing pose."""
    # Searched: for every joint, its world rotation R in a standing pose that the file does not
    # contain. What is known of that pose is a few directions in the world (legs hang down, knees
    # bend about the left axis, soles are level); what the motion tells is the same directions in
    # the axes of the joint (the bone points along its x, the knee bends about its z). If W holds
    # directions in the world as columns, and B the same ones in the axes of the joint, then R B = W
    # and R = W B^T. Joints without such knowledge keep their mean rotation relative to the parent.
    # Left, up and forward as columns: of the body in each frame, and of the standing body.
    up = np.broadcast_to(postures.up, (len(postures.rows), 3))
    body = np.stack([postures.left(), up, postures.forward()], axis=2)
    stands = postures.stands
    limbs = limb_axes(postures)
    fixed = _trunk(postures, skeleton, body, stands)
    for limb in limbs:
        fixed |= _limb(limb, stands, postures.joints)
    for side, limb in zip(SIDES, limbs, strict=False):
        foot = _foot(postures, side, stands) if has_stances else _toes(postures, limb, stands)
        fixed |= foot
    result = _with_means(fixed, postures, skeleton, (body, stands))
    if _has_parallel_axes(limbs):
        return AnatomicalRest(_parallel_rest(result, postures, skeleton, stands), (), True)
    unseen = tuple(
        skeleton.names[postures.joints[limb.lower]] for limb in limbs if not limb.is_seen
    )
    return AnatomicalRest(result, unseen, False)


def _with_means(
    fixed: dict[int, Floats], postures: Postures, skeleton: Skeleton, axes: tuple[Floats, Floats]
) -> Floats:
    """Return all joints' rotations, where joints not ``fixed`` have their mean local rotation."""
    parents, (body, stands) = skeleton.parents, axes
    hands = _hands(skeleton, postures.joints)
    result = np.empty((len(parents), 3, 3))
    for joint, parent in enumerate(parents):
        if joint in fixed:
            result[joint] = fixed[joint]
        elif parent < 0:
            result[joint] = stands @ _mean(body, postures.rotations[:, joint])
        else:
            mean = _mean(postures.rotations[:, parent], postures.rotations[:, joint])
            result[joint] = result[parent] @ (
                _straight(mean, *hands[joint]) if joint in hands else mean
            )
    return result


def _mean(axes: Floats, rotations: Floats) -> Floats:
    """Return the mean of rotations relative to axes, both (F, 3, 3)."""
    # The rotation nearest to the mean matrix has the smallest sum of squared chordal distances to
    # all rotations (Hartley et al. 2013, Rotation Averaging).
    return nearest_rotations(np.einsum("fba,fbc->ac", axes, rotations) / len(axes))[0]


def _trunk(
    postures: Postures, skeleton: Skeleton, body: Floats, stands: Floats
) -> dict[int, Floats]:
    """Return the mean rotations of the trunk's joints, with the neck above the hips."""
    # Relative to the body's own left, up and forward, so that walking in a circle does not matter,
    # the trunk varies little: its mean is a posture that the person had. The joints are those with
    # names of a trunk, and all unnamed ones between the root and the neck or a hip.
    joints = {j for name, j in postures.joints.items() if name.startswith(_TRUNK)}
    joints |= {
        postures.joints[f"{side}_collar"] for side in SIDES if f"{side}_collar" in postures.joints
    }
    top = postures.joints["neck" if "neck" in postures.joints else "head"]
    hips = [postures.joints[f"{side}_hip"] for side in SIDES]
    joints |= with_ancestors(skeleton.parents.tolist(), (top, *hips)) - {top, *hips}
    found = {joint: stands @ _mean(body, postures.rotations[:, joint]) for joint in joints}
    # The mean trunk may lean. As a whole, it is rotated until the line from the hips to the neck is
    # vertical and the line between the hips sideways.
    place = {joint: _place(skeleton, found, joint) for joint in (top, *hips)}
    height = unit(place[top] - (place[hips[0]] + place[hips[1]]) / 2.0)
    side = place[hips[0]] - place[hips[1]]
    tilt = stands @ axes_along(height, side).T
    return {joint: tilt @ rotation for joint, rotation in found.items()}


def _place(skeleton: Skeleton, rotations: dict[int, Floats], joint: int) -> Floats:
    """Return a joint's position relative to the root."""
    place = np.zeros(3)
    for each, parent in pairwise(path_to_root(skeleton.parents, joint)):
        place = place + rotations[parent] @ skeleton.rest_translations[each]
    return place


def _limb(limb: LimbAxes, stands: Floats, joints: dict[str, int]) -> dict[int, Floats]:
    """Return the rotations of a limb's two joints, straight and with its axis as in a T-pose."""
    # In a T-pose, a leg hangs down and its knee bends about the left axis; an arm points to its
    # side, and its elbow bends forwards, about cross(side, forward), the vertical axis.
    left, up, forward = stands.T
    if limb.upper.endswith("hip"):
        wanted = axes_along(-up, left)
    else:
        side = left if limb.upper.startswith("left") else -left
        wanted = axes_along(side, np.cross(side, forward))
    # R B = W: bone and bending axis, B in the axes of the joint, point in the wanted directions W.
    return {
        joints[name]: wanted @ axes_along(bone, bend).T
        for name, bone, bend in zip((limb.upper, limb.lower), limb.bones, limb.bends, strict=True)
    }


def _foot(postures: Postures, side: str, stands: Floats) -> dict[int, Floats]:
    """Return the rotation of a foot with a level sole and the toes forward."""
    # In the quarter of the frames with the lowest ankle, relative to the hip, the person stands on
    # the foot and its sole is level. The up axis of these frames, in the axes of the ankle, is the
    # normal of the sole; their mean direction to the toes, made perpendicular to it, is the front.
    ankle, toes = postures.joints[f"{side}_ankle"], postures.joints.get(f"{side}_foot")
    hips = postures.points[:, postures.joints[f"{side}_hip"]]
    heights = (postures.points[:, ankle] - hips) @ postures.up
    low = postures.chosen(heights <= np.percentile(heights, _STANCE))
    axes = low.rotations[:, ankle]
    ahead = low.forward() if toes is None else low.points[:, toes] - low.points[:, ankle]
    front = np.einsum("fba,fb->a", axes, ahead)
    sole = np.einsum("fba,b->a", axes, low.up)
    left, up, _ = stands.T
    return {ankle: axes_along(up, left) @ axes_along(sole, np.cross(sole, front)).T}


def _toes(postures: Postures, limb: LimbAxes, stands: Floats) -> dict[int, Floats]:
    """Return the rotation of a foot: side axis parallel to the knee's, toes forward."""
    side = limb.upper.partition("_")[0]
    ankle, toes = postures.joints[f"{side}_ankle"], postures.joints.get(f"{side}_foot")
    if toes is None:
        return {}
    axes = postures.rotations[:, ankle]
    ahead = postures.points[:, toes] - postures.points[:, ankle]
    front = np.einsum("fba,fb->a", axes, ahead)
    bends = postures.rotations[:, postures.joints[limb.lower]] @ limb.bends[1]
    left, up, forward = stands.T
    wanted = np.cos(_SLOPE) * forward - np.sin(_SLOPE) * up
    across = np.einsum("fba,fb->a", axes, bends)
    return {ankle: axes_along(wanted, left) @ axes_along(front, across).T}


def _hands(skeleton: Skeleton, joints: dict[str, int]) -> dict[int, tuple[Floats, Floats]]:
    """Return the forearm's direction in the axes of forearm and hand, of straight arms' wrists."""
    parents, found = skeleton.parents, {}
    turns, offsets = quaternion_to_matrix(skeleton.rest_rotations), skeleton.rest_translations
    for side in SIDES:
        shoulder, elbow, wrist = (
            joints[f"{side}_{part}"] for part in ("shoulder", "elbow", "wrist")
        )
        if parents[wrist] != elbow or parents[elbow] != shoulder:
            continue
        forearm = unit(offsets[wrist])
        fingers = unit(turns[wrist] @ offsets[parents == wrist].sum(axis=0))
        is_straight = unit(offsets[elbow]) @ turns[elbow] @ forearm > _COLLINEAR
        if is_straight and (not fingers.any() or fingers @ forearm > _ALONG):
            found[wrist] = forearm, turns[wrist].T @ forearm
    return found


def _straight(mean: Floats, forearm: Floats, hand: Floats) -> Floats:
    """Return the mean rotation of a hand without its bend, unless the bend is too large."""
    bent = mean @ hand
    return shortest_arc(bent, forearm) @ mean if bent @ forearm > _BENT else mean


# Rest pose of skeletons whose joint axes are parallel to the body's in a T-pose.
#
# Rigs with all bones along one axis in the zero pose (LAFAN1 along +x, Rokoko along -y) also
# choose the other axes by a rule: in a T-pose, each axis of a joint points to the body's left, up
# or front, or the opposite. If bones and bending axes of the limbs are close to coordinate axes
# of their joints, this rule determines the rest pose, without the bias of a mean over the motion.
# Only the slope of feet whose axes follow the bone to the toes depends on toes or soles.

# Cosine of the maximum angle between a bone and an axis. Bones follow the rule exactly; files round
# them to hundredths of a degree, and some rigs give the forearm or foot a slight offset.
_BONE = np.cos(np.radians(5.0))

# The same for bending axes, which are measured from the motion: of knees, which are hinges, and of
# elbows, whose plane also tilts as the forearm twists. Both are below 45 degrees, half the angle
# between two axes, at which the nearest axis is undecided.
_KNEE, _ELBOW = np.cos(np.radians(20.0)), np.cos(np.radians(40.0))
_SEEN = 3  # minimum number of limbs whose bending axis is measured: one may stay straight

# Maximum rotation, in radians, between the mean pose and a rest pose with the parent's axes. Other
# axes are at least 90 degrees from the parent's, and a mean posture (a bent neck, a hanging hand)
# takes at most 25 of these away.
_SAME_AXES = np.radians(65.0)
_STIFF = np.radians(1.0)  # maximum rotation of toes that do not move: the rounding of files

# Maximum difference between two estimates of a foot's slope. They err independently by a few
# degrees; a larger difference shows that the toes are not level, and do not state the slope.
_PARALLEL_SLOPE = np.radians(15.0)

# Joints that have their parent's axes.
_CHAINS = ("spine2", "spine3", "neck", "head", "wrist")


def _has_parallel_axes(limbs: Sequence[LimbAxes]) -> bool:
    """Return whether bones and bending axes of all limbs are close to axes of their joints."""
    # A threshold alone would often accept limbs with arbitrary roll. Together with the same bending
    # axis at both joints of a limb, about one skeleton in 10,000 passes by chance.
    bones = np.abs([limb.bones for limb in limbs]).max(axis=-1)
    seen = [limb for limb in limbs if limb.is_seen]
    return bool((bones > _BONE).all() and len(seen) >= _SEEN and all(map(_has_one_axis, seen)))


def _has_one_axis(limb: LimbAxes) -> bool:
    """Return whether a limb bends about the same axis of both joints."""
    # A rotation about an axis is the same in the axes of both joints that it connects. If the rig
    # follows the rule, both see the bending axis as the same coordinate axis with the same sign;
    # two arbitrary rolls agree so in one of 6 cases, and within 20 or 40 degrees in few of these.
    largest = np.abs(limb.bends).argmax(axis=-1)
    cosines = np.take_along_axis(limb.bends, largest[:, None], axis=-1)[:, 0]
    least = _KNEE if limb.upper.endswith("hip") else _ELBOW
    is_close = bool((np.abs(cosines) > least).all())
    return is_close and largest[0] == largest[1] and bool(cosines[0] * cosines[1] > 0.0)


def _parallel_rest(
    estimate: Floats, postures: Postures, skeleton: Skeleton, stands: Floats
) -> Floats:
    """Return world rotations (J, 3, 3) with trunk and limbs parallel to the body's ``stands``."""
    # The estimate is a few degrees off, as a mean over a motion is. Rounded to the nearest of the
    # 24 orientations whose axes are those of the body, it is exact. Trunk and limbs are rounded in
    # the world; a chain such as spine or hand has the axes of its parent unless it differs from
    # them by more than an estimate can err; unnamed joints in between are rounded relative to their
    # parent. Joints beyond the last named ones keep their estimated local rotation.
    parents = skeleton.parents
    names = {joint: name for name, joint in postures.joints.items()}
    inner = _above(parents, names)
    feet = _feet(estimate, postures, skeleton, stands)
    is_like_forearm = _angle_of_wrists(estimate, postures, parents) < _SAME_AXES
    turned = rotation_distance(estimate[parents], estimate)
    result = np.empty_like(estimate)
    for joint, parent in enumerate(parents):
        name, local = names.get(joint, ""), estimate[parent].T @ estimate[joint]
        if joint in feet:
            result[joint] = feet[joint]
        elif parent < 0 or (name and not name.endswith(_CHAINS)):
            result[joint] = stands @ _nearest(stands.T @ estimate[joint])
        elif not inner[joint]:
            result[joint] = result[parent] @ local
        elif is_like_forearm if name.endswith("wrist") else turned[joint] < _SAME_AXES:
            result[joint] = result[parent]
        else:
            result[joint] = result[parent] @ _nearest(local)
    return result


def _above(parents: Ints, names: dict[int, str]) -> Bools:
    """Return a mask of the trunk and limb joints, and of the joints above them: (J,)."""
    result = np.zeros(len(parents), dtype=bool)
    for joint in range(len(parents) - 1, -1, -1):
        result[joint] |= joint in names and not _is_finger(names[joint])
        if parents[joint] >= 0 and result[joint]:
            result[parents[joint]] = True
    return result


def _is_finger(name: str) -> bool:
    return name[-1].isdigit() and not name.startswith("spine")


def _angle_of_wrists(estimate: Floats, postures: Postures, parents: Ints) -> float:
    """Return the smaller angle between a hand's and its parent's axes: forearms may be twisted."""
    wrists = [postures.joints[f"{side}_wrist"] for side in SIDES]
    above = estimate[[parents[wrist] for wrist in wrists]]
    return float(rotation_distance(above, estimate[wrists]).min())


def _feet(
    estimate: Floats, postures: Postures, skeleton: Skeleton, stands: Floats
) -> dict[int, Floats]:
    """Return the rotations of ankles and toes."""
    result = {}
    for side in SIDES:
        ankle, toes = postures.joints[f"{side}_ankle"], postures.joints.get(f"{side}_foot")
        level = stands @ _nearest(stands.T @ estimate[ankle])
        slope = _pitch(estimate[ankle] @ level.T, stands)
        if toes is not None:
            result[toes] = stands @ _nearest(stands.T @ estimate[toes])
            stated = _stated_slope(postures, (ankle, toes), (level, result[toes]), stands)
            if stated is not None and abs(stated - slope) < _PARALLEL_SLOPE:
                slope = stated
        result[ankle] = rotation_vector_to_matrix(slope * stands[:, 0]) @ level
    return result


def _stated_slope(
    postures: Postures, joints: tuple[int, int], level: tuple[Floats, Floats], stands: Floats
) -> float | None:
    """Return the slope of a foot's axes that its toes state; None if they do not."""
    ankle, toes = joints
    axes = np.swapaxes(postures.rotations[:, ankle], 1, 2)
    bone = unit(np.einsum("fab,fb->a", axes, postures.points[:, toes] - postures.points[:, ankle]))
    if np.abs(bone).max() < _BONE:
        # The axes do not follow the sloping bone: they are level.
        return 0.0
    local = axes @ postures.rotations[:, toes]
    mean = nearest_rotations(local.mean(axis=0))[0]
    if rotation_distance(local, mean).max() > _STIFF:
        return None
    # Toes that do not move are level.
    return _pitch(level[1] @ mean.T @ level[0].T, stands)


def _pitch(rotation: Floats, stands: Floats) -> float:
    """Return the angle of the nearest rotation about the left axis."""
    # In body axes (left, up, forward), a rotation by a about left is [1 0 0; 0 c -s; 0 s c]. The
    # one nearest to a rotation R maximises c (R_11 + R_22) + s (R_21 - R_12), so tan a is their
    # ratio.
    own = stands.T @ rotation @ stands
    return float(np.arctan2(own[2, 1] - own[1, 2], own[1, 1] + own[2, 2]))


def _all_axes() -> Floats:
    """Return the 24 rotations whose columns are coordinate axes or their opposites."""
    found = [
        np.eye(3)[list(order)] * signs
        for order in permutations(range(3))
        for signs in product((1.0, -1.0), repeat=3)
    ]
    return np.array([axes for axes in found if np.linalg.det(axes) > 0.0])


_ALL = _all_axes()


def _nearest(rotation: Floats) -> Floats:
    """Return the nearest rotation whose columns are coordinate axes or their opposites."""
    # The angle between rotations A and R falls with trace(A^T R) = sum of A_ij R_ij.
    return _ALL[np.einsum("kab,ab->k", _ALL, rotation).argmax()]


# Bending axes of knees and elbows, found from the motion.
#
# A joint bends about the normal of its two bones, cross(upper, lower), whose length is the sine
# of the angle. Knees bend backwards and elbows forwards, so the sign of the normal distinguishes
# left from right. Its mean over the motion, in the axes of a joint, is the bending axis of the
# joint.

_LIMBS = (("hip", "knee", "ankle", -1.0), ("shoulder", "elbow", "wrist", 1.0))

# Sine of the minimum bend that shows the axis of a joint: with less, noise of 1 degree in the
# bones moves their normal by 1 / sin(15 degrees), 4 degrees, and more.
_LIMB_BENT = np.sin(np.radians(15.0))

# Minimum ratio of the length of the mean normal to the mean length of the normals: the mean cosine
# of their angles to the mean normal. It is 1 for a hinge, 0.7 if all are 45 degrees off, and 0 if
# they point everywhere.
_COHERENT = 0.7


@dataclass(frozen=True, slots=True, eq=False)
class LimbAxes:
    """Directions of a limb's two bones and its bending axis, in the axes of two joints."""

    upper: str
    lower: str
    """The joints at the start of the two bones, such as ``left_hip`` and ``left_knee``."""
    bones: Floats
    """(2, 3). Unit vectors along the bones, each in the axes of its joint."""
    bends: Floats
    """(2, 3). The bending axis in the axes of both joints."""
    is_seen: bool
    """Whether the motion shows the axis; otherwise it is assumed to be sideways to the body."""


def limb_axes(postures: Postures) -> list[LimbAxes]:
    """Return the axes of both legs and both arms."""
    return [
        _axes_of_limb(postures, tuple(f"{side}_{part}" for part in parts), front)
        for *parts, front in _LIMBS
        for side in SIDES
    ]


def _axes_of_limb(postures: Postures, names: tuple[str, ...], front: float) -> LimbAxes:
    # The mean of normals, not of unit normals: a limb that is nearly straight has a short normal,
    # of which the direction is noise, so it hardly counts. If the roll of the joint followed no
    # rule (normals in all directions), the mean would be much shorter than the normals are on
    # average.
    upper, lower, end = names
    bones = postures.direction(upper, lower), postures.direction(lower, end)
    normals = np.cross(*bones)
    frames = [postures.rotations[:, postures.joints[name]] for name in (upper, lower)]
    bends = [_mean_direction(axes, normals) for axes in frames]
    sines = np.linalg.norm(normals, axis=1)
    lengths = [float(np.linalg.norm(bend)) for bend in bends]
    is_seen = bool(sines.max() > _LIMB_BENT and min(lengths) > _COHERENT * sines.mean())
    if not is_seen:
        sideways = [np.cross(bone, front * postures.forward()) for bone in bones]
        bends = [_mean_direction(axes, side) for axes, side in zip(frames, sideways, strict=True)]
    means = [_mean_direction(axes, bone) for axes, bone in zip(frames, bones, strict=True)]
    return LimbAxes(upper, lower, unit(np.array(means)), unit(np.array(bends)), is_seen)


def _mean_direction(axes: Floats, vectors: Floats) -> Floats:
    """Return the mean of world vectors, (F, 3), in the axes of a joint, (F, 3, 3)."""
    return np.einsum("fba,fb->a", axes, vectors) / len(axes)
