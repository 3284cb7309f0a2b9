"""A walk of the bundled body, from joint angles in textbooks on gait."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.rotation import matrix_to_rotation_vector, rotation_vector_to_matrix
from viewer.rigs.kinematics import world_matrices
from viewer.rigs.pose import Pose, rest_pose, set_joint_rotations
from viewer.rigs.skinning import deform

__all__ = ["Gait", "Walk", "walk"]

_N_JOINTS = 24
_HIPS, _KNEES, _ANKLES, _TOES = (1, 2), (4, 5), (7, 8), (10, 11)
_SHOULDERS, _ELBOWS = (16, 17), (18, 19)


@dataclass(frozen=True, slots=True)
class Gait:
    """Parameters of a walk.

    Attributes
    ----------
    start : (float, float)
        Position on the ground at the first frame, x and z, metres.
    heading : float
        Direction of walking about +Y, degrees; 0 is +Z.
    period : float
        Seconds of two steps.
    phase : float
        Phase of the first frame, 0 to 1; the left leg is ahead at 0.25.
    arms : float
        Multiplier for the swing of the arms.
    """

    start: tuple[float, float] = (0.0, 0.0)
    heading: float = 0.0
    period: float = 1.1
    phase: float = 0.0
    arms: float = 1.0


@dataclass(frozen=True, slots=True)
class Walk:
    """Rotation vectors of the joints, radians, and translations of the body, metres.

    ``poses`` is (F, 24, 3); the pelvis is first, and the body rotates about it: V = X(poses) +
    translations, as in AMASS.
    """

    poses: Floats
    translations: Floats


def walk(body: Figure, n_frames: int, rate: float, gait: Gait) -> Walk:
    """Return a walk on y = 0.

    Parameters
    ----------
    body : Figure
        Figure with SMPL's joints, +Y up, facing +Z.
    n_frames : int
        Number of frames.
    rate : float
        Frames per second.
    gait : Gait
        Parameters of the walk.
    """
    heading = _about(1, gait.heading)
    angles = 2.0 * np.pi * (gait.phase + np.arange(n_frames) / rate / gait.period)
    poses = np.array([_pose(angle, gait.arms) for angle in angles])
    steps, heights = np.zeros(n_frames), np.zeros(n_frames)
    before: Floats | None = None
    for frame, rotations in enumerate(poses):
        pose = _posed(body, rotations)
        heights[frame] = -deform(body, pose)[0][:, 1].min()
        feet = world_matrices(body.require_skeleton(), pose)[list(_TOES), :3, 3]
        if before is not None:
            # The lower foot does not move.
            lower = int(np.argmin(feet[:, 1]))
            steps[frame] = before[lower, 2] - feet[lower, 2]
        before = feet
    # A constant speed looks better than one with the small errors of the angles.
    steps[1:] = 0.5 * steps[1:] + 0.5 * steps[1:].mean()
    travelled = np.cumsum(steps)[:, None] * heading[:, 2]
    translations = travelled + np.array([gait.start[0], 0.0, gait.start[1]])
    translations[:, 1] = heights
    poses[:, 0] = [_vector(heading @ rotation_vector_to_matrix(root)) for root in poses[:, 0]]
    return Walk(poses, translations)


def _pose(angle: float, arms: float) -> Floats:
    """Return the rotation vectors at a phase of the walk, radians: (24, 3)."""
    found = np.zeros((_N_JOINTS, 3))
    swing = np.sin(angle)
    found[0] = _vector(_about(1, -5.0 * swing) @ _about(0, 2.0))
    found[3] = _vector(_about(1, 4.0 * swing) @ _about(0, 2.0))
    found[9] = _vector(_about(1, 6.0 * swing))
    found[12] = _vector(_about(1, -4.0 * swing))
    for side, sign in enumerate((1.0, -1.0)):
        leg = angle + (0.0 if side == 0 else np.pi)
        hip = -(26.0 * np.sin(leg) + 4.0)
        knee = 6.0 + 46.0 * max(np.cos(leg + 0.45), 0.0) ** 2 + 10.0 * max(np.cos(leg - 2.4), 0.0)
        push = 16.0 * max(np.cos(leg - 4.55), 0.0) ** 4
        ankle = np.clip(-(hip + knee), -14.0, 12.0) + push
        found[_HIPS[side]] = _vector(_about(0, hip) @ _about(2, -2.0 * sign))
        found[_KNEES[side]] = _vector(_about(0, knee))
        found[_ANKLES[side]] = _vector(_about(0, ankle))
        found[_TOES[side]] = _vector(_about(0, -1.2 * push))
        # An arm swings with the opposite leg.
        arm = arms * 22.0 * np.sin(leg)
        found[_SHOULDERS[side]] = _vector(_about(0, arm + 4.0) @ _about(2, -74.0 * sign))
        bend = 18.0 + arms * 14.0 * max(-np.sin(leg), 0.0)
        found[_ELBOWS[side]] = _vector(_about(1, -bend * sign))
    return found


def _posed(body: Figure, rotations: Floats) -> Pose:
    skeleton = body.require_skeleton()
    pose = rest_pose(skeleton)
    pose.shape_weights = np.zeros(body.n_shapes)
    set_joint_rotations(
        skeleton, pose, np.arange(_N_JOINTS, dtype=np.int32), rotation_vector_to_matrix(rotations)
    )
    return pose


def _about(axis: int, degrees: float) -> Floats:
    return rotation_vector_to_matrix(np.radians(degrees) * np.eye(3)[axis])


def _vector(matrix: Floats) -> Floats:
    return matrix_to_rotation_vector(matrix)
