"""Curves of keyed transforms: the components of their channels, with rotations as Euler angles.

A rotation is shown as the Euler angles x, y, z of the joint relative to its rest rotation,
R = R_rest Rz Ry Rx, which are also the DOFs of a ball joint. Other channels are shown as they are
stored.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from viewer.data_classes import dataclass
from viewer.rigs.arrays import Floats
from viewer.rigs.geometry.rotation import (
    axis_rotations,
    matrix_to_euler,
    matrix_to_quaternion,
    quaternion_to_matrix,
)
from viewer.rigs.memo import Memo
from viewer.rigs.motion.samples import Samples
from viewer.rigs.motion.transform_clip import (
    TransformChannel,
    TransformClip,
    TransformPath,
    sample_transforms,
)
from viewer.rigs.skeleton import Skeleton

_rows: Memo[TransformClip, tuple[TransformRow, ...]] = Memo(kept=1)
_parts: Memo[TransformClip, TransformClip] = Memo(kept=2)


@dataclass(frozen=True, slots=True)
class TransformRow:
    """One curve of a clip."""

    path: TransformPath
    """Entry of ``TRANSFORM_PATHS``."""
    joint: int
    """Animated joint; -1 for weights."""
    component: int
    """0 to 2 for x, y, z, or the component of a channel of weights."""
    channel: int
    """Index of the channel; -1 for a rotation without keys."""
    shape: int = -1
    """Index of the blend shape of a weight; -1 for other curves."""


def rows_of(clip: TransformClip, skeleton: Skeleton) -> tuple[TransformRow, ...]:
    """Return the curves of a clip: each joint's rotation and keyed properties, then weights."""
    return _rows.get(clip, id(skeleton), lambda: _listed(clip, skeleton))


def _listed(clip: TransformClip, skeleton: Skeleton) -> tuple[TransformRow, ...]:
    owned = {(one.joint, one.path): index for index, one in enumerate(clip.channels)}
    paths: tuple[TransformPath, ...] = ("translation", "rotation", "scale")
    hidden = skeleton.auxiliary
    rows = [
        TransformRow(path, joint, component, owned.get((joint, path), -1))
        for joint in range(skeleton.n_joints)
        for path in paths
        if (joint, path) in owned or (path == "rotation" and (hidden is None or not hidden[joint]))
        for component in range(3)
    ]
    for index, channel in enumerate(clip.channels):
        if channel.shapes is not None:
            rows += [
                TransformRow("weights", -1, component, index, shape)
                for component, shape in enumerate(channel.shapes.tolist())
            ]
    return tuple(rows)


def angles_of(skeleton: Skeleton, joint: int, quaternions: Floats) -> Floats:
    """Return Euler angles x, y, z from rest in radians, (..., 3), for rotations (..., 4)."""
    base = quaternion_to_matrix(skeleton.rest_rotations[joint])
    return matrix_to_euler(base.T @ quaternion_to_matrix(quaternions))


def from_angles(skeleton: Skeleton, joint: int, angles: Floats) -> Floats:
    """Return a joint's rotation relative to its parent, (4,), for Euler angles from rest (3,)."""
    x, y, z = (axis_rotations(axis, angles[axis]) for axis in range(3))
    base = quaternion_to_matrix(skeleton.rest_rotations[joint])
    return matrix_to_quaternion(base @ z @ y @ x)


def key_values(channel: TransformChannel, skeleton: Skeleton) -> Floats:
    """Return the curve values of a channel's keys, (N, C): three angles for rotations."""
    if channel.path == "rotation":
        return angles_of(skeleton, channel.joint, channel.values)
    return channel.values


def row_values(
    clip: TransformClip, skeleton: Skeleton, chosen: Sequence[int], times: Floats
) -> Floats:
    """Return curves ``chosen`` of ``rows_of`` at times: (T, C); 0 for rotations without keys."""
    rows = [rows_of(clip, skeleton)[index] for index in chosen]
    used = tuple(sorted({row.channel for row in rows if row.channel >= 0}))

    def part() -> TransformClip:
        channels = tuple(clip.channels[index] for index in used)
        return TransformClip(clip.name, channels, clip.start, clip.end)

    found = sample_transforms(_parts.get(clip, used, part), times)
    result = np.zeros((len(times), len(rows)))
    for column, row in enumerate(rows):
        if row.channel >= 0:
            result[:, column] = _sampled(found, skeleton, row)
    return result


def _sampled(found: Samples, skeleton: Skeleton, row: TransformRow) -> Floats:
    """Return one curve from the samples of its channel: (T,)."""
    if row.path == "weights":
        return found.shape_weights[:, int(np.argmax(found.weighted == row.shape))]
    targets, values = {
        "rotation": (found.rotated, found.rotations),
        "translation": (found.translated, found.translations),
        "scale": (found.scaled, found.scales),
    }[row.path]
    own = values[:, int(np.argmax(targets == row.joint))]
    if row.path == "rotation":
        own = angles_of(skeleton, row.joint, own)
    return np.asarray(own[:, row.component])
