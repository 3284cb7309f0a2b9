"""Single poses of bodies of the SMPL family without a figure, as motions of one frame.

They are then shown like all captured bodies: with the user's model, or with the bundled body.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from viewer.loading.contents import Contents
from viewer.rig.arrays import Floats
from viewer.rig.motion.body_motion import BodyMotion
from viewer.rig.motion.timing import Timing
from viewer.rig.posing.pose_record import PARTS, PoseRecord
from viewer.rig.smpl_family import FAMILY, members_by_numbers, model_of_joints

__all__ = ["with_bodies"]

_RATE = 30.0  # of a motion with one frame, where it has no effect
_ANGLES = 45  # rotation vectors of the fingers of a hand; fewer numbers are coefficients
_HANDS = {"left_hand_pose": "left", "right_hand_pose": "right"}
_SINGLE = ("global_orient", "jaw_pose", "leye_pose", "reye_pose")  # rotations of one joint each
_READ = {*_SINGLE, *_HANDS, "body_pose"}
_MOST = len(FAMILY[24].names)  # maximum number of joints of body_pose and global_orient
_FINGERS = {"left": FAMILY[55].names[25:40], "right": FAMILY[55].names[40:]}


def with_bodies(contents: Contents) -> Contents:
    """Return contents in which poses of bodies are motions, if no figure or motion is with them.

    Parameters
    ----------
    contents : Contents
        Contents of the files.

    Returns
    -------
    Contents
        The contents themselves if there is a figure, or a pose is not one of a body.
    """
    if contents.figures or contents.has_motion or contents.morphs or not contents.poses:
        return contents
    found = [(path, _motion(path, record)) for path, record in contents.poses]
    bodies = [(path, motion) for path, motion in found if motion is not None]
    if len(bodies) < len(found):
        return contents
    return replace(contents, poses=[], body_motions=bodies)


def _motion(path: Path, record: PoseRecord) -> BodyMotion | None:
    """Return a pose as a motion of one frame; None if it is not a pose of a known body."""
    joints = _joints(record)
    if joints is None or record.scale not in (None, 1.0):
        return None
    names, vectors = joints
    space = record.shape_space
    hands: dict[str, Floats] = {}
    for part, side in _HANDS.items():
        numbers = record.parts.get(part)
        if numbers is None:
            continue
        if numbers.size == _ANGLES and record.hand_coefficients is not True:
            if record.flat_hands is False:  # angles relative to the mean hand of an unknown model
                return None
            names += _FINGERS[side]
            vectors = np.concatenate([vectors, numbers.reshape(-1, 3)])
        else:
            hands[side] = numbers.reshape(1, -1)
    return BodyMotion(
        path.stem,
        Timing(_RATE, np.zeros(1, dtype=np.int32)),
        names,
        vectors[None],
        np.zeros((1, 3)) if record.translation is None else record.translation[None],
        shape=None if record.shape is None else record.shape[None],
        expression=None if record.expression is None else record.expression[None],
        hands=hands,
        flat_hands=bool(record.flat_hands),
        shape_space=replace(space, model=space.model or model_of_joints(names)),
    )


def _joints(record: PoseRecord) -> tuple[tuple[str, ...], Floats] | None:
    """Return the joints other than fingers and their rotation vectors, (K, 3); None if unknown."""
    known, parts = members_by_numbers(), record.parts
    if record.dofs or record.joint_rotations is not None:
        own, vector = record.joint_rotations, record.vector
        # A pose of a model that this program has written: its numbers are the whole pose.
        is_whole = own is not None and not own.shifts.any() and own.scales is None
        names = known.get(0 if vector is None else vector.size)
        is_whole &= own is not None and names == own.names and bool(record.shape_space.model)
        return (
            None
            if names is None or vector is None or not is_whole
            else (names, vector.reshape(-1, 3))
        )
    if record.vector is not None:
        names = known.get(record.vector.size)
        return None if names is None or parts else (names, record.vector.reshape(-1, 3))
    body = parts.get("body_pose", np.zeros(0))
    rotated = {part: parts[part] for part in _SINGLE if part in parts}
    names = known.get(body.size + 3)
    is_known = names is not None and len(names) <= _MOST and set(parts) <= _READ
    if names is None or not is_known or any(part.size != 3 for part in rotated.values()):
        return None
    root = rotated.pop("global_orient", np.zeros(3))
    names += tuple(PARTS[part][0] for part in rotated)
    return names, np.concatenate([root, body, *rotated.values()]).reshape(-1, 3)
