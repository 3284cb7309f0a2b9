"""Rest pose of a body from its anatomy, for motions without a frame in a T- or A-pose.

The trunk stands upright in its mean posture, the legs hang straight down with the knees' axes
sideways, the arms point straight to the sides with the elbows' axes vertical, and the soles are
level. Hands are straight if shoulder, elbow and wrist are collinear in the zero pose. All other
joints keep their mean rotation. A bend of the spine or a twist of the forearms that never changes
cannot be detected and becomes part of the rest pose, unless the axes of the joints are parallel to
the body's: see ``viewer.rig.retargeting.parallel_axes``.
"""

from __future__ import annotations

import numpy as np

from viewer.data_classes import dataclass
from viewer.rig.arrays import Floats, Ints
from viewer.rig.geometry.rotation import nearest_rotations, quaternion_to_matrix
from viewer.rig.retargeting.limb_axes import LimbAxes, limb_axes
from viewer.rig.retargeting.parallel_axes import has_parallel_axes, parallel_rest
from viewer.rig.retargeting.postures import SIDES, Postures, unit
from viewer.rig.retargeting.rest_poses import shortest_arc
from viewer.rig.skeleton import Skeleton

__all__ = ["AnatomicalRest", "anatomical_rest", "upright_frames"]

_TRUNK = ("pelvis", "spine", "neck", "head", "collar")
_UPRIGHT = np.cos(np.radians(30.0))
_STOOPED = np.cos(np.radians(60.0))
_ENOUGH = 0.05  # minimum fraction of upright frames
_COLLINEAR = np.cos(np.radians(10.0))  # between the bones of an arm that is straight
_ALONG = np.cos(np.radians(30.0))  # between a forearm and the fingers of a straight hand
_BENT = np.cos(np.radians(85.0))  # mean bend of a wrist beyond which its zero pose is not straight
_SLOPE = np.radians(30.0)  # slope from the ankle down to the ball of a standing foot
_STANCE = 25.0  # percentage of the frames in which a foot is lowest and its sole level


@dataclass(frozen=True, slots=True, eq=False)
class AnatomicalRest:
    """A standing pose found from the anatomy.

    Attributes
    ----------
    rotations : (J, 3, 3)
        World rotations of the joints, in the skeleton's axes.
    unseen : tuple of str
        Joints of limbs whose roll is assumed, because the motion does not show it.
    is_parallel : bool
        Whether the axes of the joints are parallel to the body's.
    """

    rotations: Floats
    unseen: tuple[str, ...]
    is_parallel: bool


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
    """Return the rotations of the joints in a standing pose.

    Parameters
    ----------
    postures : Postures
        Poses of the motion, upright or rotated upright.
    skeleton : Skeleton
        Its skeleton.
    has_stances : bool
        Whether the poses are upright and show the soles; otherwise the feet point forwards.
    """
    body = _body_axes(postures)
    stands = _stands(postures.up)
    limbs = limb_axes(postures)
    fixed = _trunk(postures, skeleton, body, stands)
    for limb in limbs:
        fixed |= _limb(limb, stands, postures.joints)
    for side, limb in zip(SIDES, limbs, strict=False):
        foot = _foot(postures, side, stands) if has_stances else _toes(postures, limb, stands)
        fixed |= foot
    result = _with_means(fixed, postures, skeleton, (body, stands))
    if has_parallel_axes(limbs):
        return AnatomicalRest(parallel_rest(result, postures, skeleton, stands), (), True)
    unseen = tuple(
        skeleton.names[postures.joints[limb.lower]] for limb in limbs if not limb.is_seen
    )
    return AnatomicalRest(result, unseen, False)


def _with_means(
    fixed: dict[int, Floats], postures: Postures, skeleton: Skeleton, axes: tuple[Floats, Floats]
) -> Floats:
    """Return the rotations of all joints, of which most have their mean local rotation.

    ``axes``: those of the body in each frame, (F, 3, 3), and of the standing body, (3, 3).
    """
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


def _stands(up: Floats) -> Floats:
    """Return axes of the standing body as columns: left, up and forward: (3, 3)."""
    left = np.array([1.0, 0.0, 0.0])
    return np.stack([left, up, np.cross(left, up)], axis=1)


def _body_axes(postures: Postures) -> Floats:
    """Return the body's axes in each frame as columns: left, up and forward: (F, 3, 3)."""
    up = np.broadcast_to(postures.up, (len(postures.rows), 3))
    return np.stack([postures.left(), up, postures.forward()], axis=2)


def _mean(axes: Floats, rotations: Floats) -> Floats:
    """Return the mean of rotations relative to axes, both (F, 3, 3)."""
    return nearest_rotations(np.einsum("fba,fbc->ac", axes, rotations) / len(axes))[0]


def _trunk(
    postures: Postures, skeleton: Skeleton, body: Floats, stands: Floats
) -> dict[int, Floats]:
    """Return the mean rotations of the trunk's joints, with the neck above the hips."""
    joints = {j for name, j in postures.joints.items() if name.startswith(_TRUNK)}
    joints |= {
        postures.joints[f"{side}_collar"] for side in SIDES if f"{side}_collar" in postures.joints
    }
    top = postures.joints["neck" if "neck" in postures.joints else "head"]
    hips = [postures.joints[f"{side}_hip"] for side in SIDES]
    above = {joint for end in (top, *hips) for joint in _ancestors(skeleton.parents, end)}
    joints |= above - set(hips)
    found = {joint: stands @ _mean(body, postures.rotations[:, joint]) for joint in joints}
    place = {joint: _place(skeleton, found, joint) for joint in (top, *hips)}
    height = unit(place[top] - (place[hips[0]] + place[hips[1]]) / 2.0)
    side = place[hips[0]] - place[hips[1]]
    tilt = stands @ _axes_along(height, side).T
    return {joint: tilt @ rotation for joint, rotation in found.items()}


def _ancestors(parents: Ints, joint: int) -> list[int]:
    found = []
    while parents[joint] >= 0:
        joint = int(parents[joint])
        found.append(joint)
    return found


def _place(skeleton: Skeleton, rotations: dict[int, Floats], joint: int) -> Floats:
    """Return a joint's position relative to the root."""
    place = np.zeros(3)
    while skeleton.parents[joint] >= 0:
        parent = int(skeleton.parents[joint])
        place = place + rotations[parent] @ skeleton.rest_translations[joint]
        joint = parent
    return place


def _limb(limb: LimbAxes, stands: Floats, joints: dict[str, int]) -> dict[int, Floats]:
    """Return the rotations of a limb's two joints, straight and with its axis as in a T-pose."""
    left, up, forward = stands.T
    if limb.upper.endswith("hip"):
        wanted = _axes_along(-up, left)
    else:
        side = left if limb.upper.startswith("left") else -left
        wanted = _axes_along(side, np.cross(side, forward))
    return {
        joints[name]: wanted @ _axes_along(bone, bend).T
        for name, bone, bend in zip((limb.upper, limb.lower), limb.bones, limb.bends, strict=True)
    }


def _foot(postures: Postures, side: str, stands: Floats) -> dict[int, Floats]:
    """Return the rotation of a foot with a level sole and the toes forward."""
    ankle, toes = postures.joints[f"{side}_ankle"], postures.joints.get(f"{side}_foot")
    hips = postures.points[:, postures.joints[f"{side}_hip"]]
    heights = (postures.points[:, ankle] - hips) @ postures.up
    low = postures.chosen(heights <= np.percentile(heights, _STANCE))
    axes = low.rotations[:, ankle]
    ahead = low.forward() if toes is None else low.points[:, toes] - low.points[:, ankle]
    front = np.einsum("fba,fb->a", axes, ahead)
    sole = np.einsum("fba,b->a", axes, low.up)
    left, up, _ = stands.T
    return {ankle: _axes_along(up, left) @ _axes_along(sole, np.cross(sole, front)).T}


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
    return {ankle: _axes_along(wanted, left) @ _axes_along(front, across).T}


def _hands(skeleton: Skeleton, joints: dict[str, int]) -> dict[int, tuple[Floats, Floats]]:
    """Return the directions of hands whose arms are straight in the zero pose.

    For each wrist, this is the direction of the forearm in the axes of forearm and hand.
    """
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


def _axes_along(main: Floats, side: Floats) -> Floats:
    """Return axes as columns: near ``side``, along ``main``, and across."""
    second, third = unit(main), unit(np.cross(side, main))
    return np.stack([np.cross(second, third), second, third], axis=1)
