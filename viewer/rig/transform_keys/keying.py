"""Keying of a figure's whole pose as transforms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.rig.arrays import Floats, Ints
from viewer.rig.figure import Figure
from viewer.rig.geometry.rotation import matrix_to_quaternion
from viewer.rig.motion.transform_clip import TransformChannel, TransformClip, TransformPath
from viewer.rig.pose import Pose, joint_rotations, local_matrices
from viewer.rig.scene import figure_pose
from viewer.rig.skeleton import Skeleton
from viewer.rig.transform_keys.edit import added_key, value_at

_UNCHANGED = 1e-9  # tolerance within which lengths, factors and weights equal their curves

# Tolerance of the difference of unit quaternions, about half the angle in radians.
_SAME_ROTATION = 1e-9


def joint_values(skeleton: Skeleton, pose: Pose) -> dict[TransformPath, Floats]:
    """Return the local transforms of a pose as values of keys, by path: (J, 3) and (J, 4)."""
    return {
        "translation": local_matrices(skeleton, pose)[:, :3, 3],
        "rotation": matrix_to_quaternion(joint_rotations(skeleton, pose)),
        "scale": pose.scales.copy(),
    }


def key_transform_pose(
    clip: TransformClip, figure: Figure, pose: Pose, time: float, only_changed: bool = False
) -> TransformClip:
    """Return a clip with a key of the pose at one time.

    Properties that differ from the file's pose and have no channel get one.

    Parameters
    ----------
    clip : TransformClip
        The motion; its range is extended to contain the time.
    figure : Figure
        Figure of the pose.
    pose : Pose
        Its values become the keys.
    time : float
        Seconds.
    only_changed : bool
        Key only properties that differ from the clip at this time.
    """
    skeleton = figure.require_skeleton()
    now, rest = joint_values(skeleton, pose), figure_pose(figure)
    channels = []
    for channel in clip.channels:
        if channel.shapes is not None:
            value = pose.shape_weights[channel.shapes]
        else:
            value = now[channel.path][channel.joint]
        if not only_changed or _differs(channel.path, value_at(channel, time), value):
            channel = added_key(channel, time, value)[0]
        channels.append(channel)
    channels += _new_joints(clip, skeleton, now, joint_values(skeleton, rest), time)
    channels += _new_weights(clip, pose.shape_weights, rest.shape_weights, time)
    start, end = min(clip.start, time), max(clip.end, time)
    return replace(clip, channels=tuple(channels), start=start, end=end)


def _differs(path: TransformPath, one: Floats, other: Floats) -> bool:
    if path != "rotation":
        return bool(np.abs(one - other).max() > _UNCHANGED)
    apart = min(np.abs(one - other).max(), np.abs(one + other).max())
    return bool(apart > _SAME_ROTATION)


def _new_joints(
    clip: TransformClip,
    skeleton: Skeleton,
    now: dict[TransformPath, Floats],
    rest: dict[TransformPath, Floats],
    time: float,
) -> list[TransformChannel]:
    """Return channels for joints that differ from the file's pose and have none."""
    known = {(channel.path, channel.joint) for channel in clip.channels}
    return [
        TransformChannel(joint, path, np.array([time]), values[joint][None])
        for path, values in now.items()
        for joint in range(skeleton.n_joints)
        if (path, joint) not in known
        and not (skeleton.auxiliary is not None and skeleton.auxiliary[joint])
        and _differs(path, rest[path][joint], values[joint])
    ]


def _new_weights(
    clip: TransformClip, now: Floats, rest: Floats, time: float
) -> list[TransformChannel]:
    """Return a channel for blend shapes that differ from the file's weights and have none."""
    known = {
        shape
        for channel in clip.channels
        if channel.shapes is not None
        for shape in channel.shapes.tolist()
    }
    changed = np.flatnonzero(np.abs(now - rest) > _UNCHANGED).tolist()
    shapes: Ints = np.array([shape for shape in changed if shape not in known], dtype=np.int32)
    if not len(shapes):
        return []
    keys = now[shapes][None]
    return [TransformChannel(-1, "weights", np.array([time]), keys, shapes=shapes)]
