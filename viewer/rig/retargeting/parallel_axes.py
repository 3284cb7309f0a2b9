"""Rest pose of skeletons whose joint axes are parallel to the body's in a T-pose.

Rigs with all bones along one axis in the zero pose (LAFAN1 along +x, Rokoko along -y) also choose
the other axes by a rule: in a T-pose, each axis of a joint points to the body's left, up or front,
or the opposite. If bones and bending axes of the limbs are close to coordinate axes of their
joints, this rule determines the rest pose, without the bias of a mean over the motion. Only the
slope of feet whose axes follow the bone to the toes depends on toes or soles.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import permutations, product

import numpy as np

from viewer.rig.arrays import Bools, Floats, Ints
from viewer.rig.geometry.rotation import nearest_rotations, rotation_vector_to_matrix
from viewer.rig.retargeting.limb_axes import LimbAxes
from viewer.rig.retargeting.postures import SIDES, Postures, unit
from viewer.rig.skeleton import Skeleton

__all__ = ["has_parallel_axes", "parallel_rest"]

_BONE = np.cos(np.radians(5.0))  # cosine of the maximum angle between a bone and an axis
# The same for bending axes, which are measured from the motion: of knees, and of elbows, which also
# twist.
_KNEE, _ELBOW = np.cos(np.radians(20.0)), np.cos(np.radians(40.0))
_SEEN = 3  # minimum number of limbs whose bending axis is measured
# Maximum rotation, in radians, between the mean pose and a rest pose with the parent's axes.
_SAME_AXES = np.radians(65.0)
_STIFF = np.radians(1.0)  # maximum rotation of toes that do not move
_SLOPE = np.radians(15.0)  # maximum difference between two estimates of a foot's slope
# Joints that have their parent's axes.
_CHAINS = ("spine2", "spine3", "neck", "head", "wrist")


def has_parallel_axes(limbs: Sequence[LimbAxes]) -> bool:
    """Return whether bones and bending axes of all limbs are close to axes of their joints.

    The bending axis is the same axis of both joints of a limb. Limbs with arbitrary roll, which a
    threshold alone would often accept, therefore differ: about one skeleton in 10,000 is accepted.

    Parameters
    ----------
    limbs : sequence of LimbAxes
        Both legs and both arms.
    """
    bones = np.abs([limb.bones for limb in limbs]).max(axis=-1)
    seen = [limb for limb in limbs if limb.is_seen]
    return bool((bones > _BONE).all() and len(seen) >= _SEEN and all(map(_has_one_axis, seen)))


def _has_one_axis(limb: LimbAxes) -> bool:
    """Return whether a limb bends about the same axis of both joints."""
    largest = np.abs(limb.bends).argmax(axis=-1)
    cosines = np.take_along_axis(limb.bends, largest[:, None], axis=-1)[:, 0]
    least = _KNEE if limb.upper.endswith("hip") else _ELBOW
    is_close = bool((np.abs(cosines) > least).all())
    return is_close and largest[0] == largest[1] and bool(cosines[0] * cosines[1] > 0.0)


def parallel_rest(
    estimate: Floats, postures: Postures, skeleton: Skeleton, stands: Floats
) -> Floats:
    """Return an estimated rest pose with the axes of trunk and limbs parallel to the body's.

    Parameters
    ----------
    estimate : (J, 3, 3)
        World rotations in the estimated rest pose.
    postures : Postures
        Poses of the motion.
    skeleton : Skeleton
        Its skeleton.
    stands : (3, 3)
        Axes of the standing body as columns: left, up and forward.

    Returns
    -------
    (J, 3, 3)
        World rotations. Joints beyond the last named ones keep their estimated local rotation.
    """
    parents = skeleton.parents
    names = {joint: name for name, joint in postures.joints.items()}
    inner = _above(parents, names)
    feet = _feet(estimate, postures, skeleton, stands)
    is_like_forearm = _angle_of_wrists(estimate, postures, parents) < _SAME_AXES
    result = np.empty_like(estimate)
    for joint, parent in enumerate(parents):
        name, local = names.get(joint, ""), estimate[parent].T @ estimate[joint]
        if joint in feet:
            result[joint] = feet[joint]
        elif parent < 0 or (name and not name.endswith(_CHAINS)):
            result[joint] = stands @ _nearest(stands.T @ estimate[joint])
        elif not inner[joint]:
            result[joint] = result[parent] @ local
        elif is_like_forearm if name.endswith("wrist") else _angle(local) < _SAME_AXES:
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
    """Return the smaller angle between a hand's axes and those of its parent joint, in radians.

    Both hands have the same convention, and forearms can be twisted in the whole motion.
    """
    wrists = [postures.joints[f"{side}_wrist"] for side in SIDES]
    return min(_angle(estimate[parents[wrist]].T @ estimate[wrist]) for wrist in wrists)


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
            if stated is not None and abs(stated - slope) < _SLOPE:
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
    if max(_angle(mean.T @ each) for each in local) > _STIFF:
        return None
    # Toes that do not move are level.
    return _pitch(level[1] @ mean.T @ level[0].T, stands)


def _pitch(rotation: Floats, stands: Floats) -> float:
    """Return the angle of the nearest rotation about the left axis."""
    own = stands.T @ rotation @ stands
    return float(np.arctan2(own[2, 1] - own[1, 2], own[1, 1] + own[2, 2]))


def _angle(rotation: Floats) -> float:
    return float(np.arccos(np.clip((np.trace(rotation) - 1.0) / 2.0, -1.0, 1.0)))


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
    return _ALL[np.einsum("kab,ab->k", _ALL, rotation).argmax()]
