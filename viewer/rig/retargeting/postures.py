"""World rotations and positions of a body's joints in the frames of a motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from viewer.data_classes import dataclass
from viewer.rig.arrays import Bools, Floats, Ints
from viewer.rig.geometry.rotation import quaternion_to_matrix
from viewer.rig.motion.skeleton_motion import SkeletonMotion
from viewer.rig.retargeting.joint_names import joint_meanings
from viewer.rig.skeleton import Skeleton

__all__ = ["SIDES", "Postures", "postures_of", "rest_posture", "unit"]

SIDES = ("left", "right")
_LIMBS = ("hip", "knee", "ankle", "shoulder", "elbow", "wrist")
_MOST = 4000  # maximum number of frames; for longer motions, every n-th frame is used


@dataclass(frozen=True, slots=True, eq=False)
class Postures:
    """Poses of a human body whose limbs have known names.

    Attributes
    ----------
    rows : (F,)
        Row of each pose in the clip.
    rotations : (F, J, 3, 3)
        World rotations, in the skeleton's axes.
    points : (F, J, 3)
        World positions, relative to the root, in the skeleton's axes.
    joints : dict of str to int
        Joints by their names in SMPL.
    up : (3,)
        The up axis of the file; the up axis of the body if it is upside down.
    """

    rows: Ints
    rotations: Floats
    points: Floats
    joints: dict[str, int]
    up: Floats

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

    def righted(self) -> Postures:
        """Return the poses rotated as a whole, with the trunk along ``up`` and the left along x."""
        trunk, side = self.trunk(), self.direction("right_hip", "left_hip")
        ahead = unit(np.cross(side, trunk))
        own = np.stack([np.cross(trunk, ahead), trunk, ahead], axis=2)
        left = np.array([1.0, 0.0, 0.0])
        stands = np.stack([left, self.up, np.cross(left, self.up)], axis=1)
        turns = stands @ np.swapaxes(own, 1, 2)
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


def rest_posture(skeleton: Skeleton, up: str) -> Postures | None:
    """Return the rest pose of a skeleton, with all DOFs at 0, as a single pose."""
    return _postures(skeleton, up, np.zeros(1, dtype=np.int32), skeleton.rest_rotations[None])


def unit(vectors: Floats) -> Floats:
    """Return normalised vectors; zero vectors are unchanged."""
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(lengths > 0.0, lengths, 1.0)


def _postures(skeleton: Skeleton, up: str, rows: Ints, local: Floats) -> Postures | None:
    joints: dict[str, int] = {}
    for joint, name in enumerate(joint_meanings(skeleton)):
        if name:
            joints.setdefault(name, joint)
    needed = {f"{side}_{part}" for side in SIDES for part in _LIMBS}
    if not needed <= set(joints) or not {"neck", "head"} & set(joints):
        return None
    rotations = quaternion_to_matrix(local)
    points = np.zeros((len(rows), skeleton.n_joints, 3))
    for joint, parent in enumerate(skeleton.parents):
        if parent >= 0:
            above, offset = rotations[:, parent], skeleton.rest_translations[joint]
            points[:, joint] = points[:, parent] + above @ offset
            rotations[:, joint] = above @ rotations[:, joint]
    found = Postures(rows, rotations, points, joints, np.eye(3)["xyz".index(up)])
    is_over = float(np.median(found.trunk() @ found.up)) < 0.0
    return replace(found, up=-found.up) if is_over else found
