"""Displacement of joints and points between known motions."""

from dataclasses import replace

import numpy as np

from viewer.rig.captures.points import PointClip
from viewer.rig.cleanup.displacement import joint_displacement, point_displacement
from viewer.rig.figure import Figure
from viewer.rig.geometry.quaternion import rotation_vector_to_quaternion
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.motion.timing import Timing
from viewer.rig.skeleton import Skeleton

POLE = Figure(
    "pole",
    skeleton=Skeleton(
        names=("foot", "knee"),
        parents=np.array([-1, 0]),
        rest_translations=np.array([[0.0, 0, 0], [0, 2, 0]]),
        rest_rotations=np.tile([0.0, 0.0, 0.0, 1.0], (2, 1)),
        rest_scales=np.ones((2, 3)),
        dof_joints=np.zeros(0, dtype=np.int32),
        dof_kinds=np.zeros(0, dtype=np.int32),
        rest_dofs=np.zeros(0),
        dof_limits=np.zeros((0, 2)),
    ),
)
"""Two joints, the second at height 2 above the first."""


def _clip(angle: float, rows) -> SampledClip:
    vectors = np.zeros((3, 2, 3))
    vectors[1, 0, 2] = angle
    rows = np.asarray(rows, dtype=np.int32)
    return SampledClip(
        "c", Timing(30.0, rows, first_frame=5), rotation_vector_to_quaternion(vectors)
    )


def test_root_rotation_displaces_the_joint_above_by_the_chord():
    # The joint at height 2 moves along the chord 4 sin(angle / 2) in one of three frames.
    still, bent = _clip(0.0, [0, 1, 2]), _clip(0.6, [0, 1, 2])
    found = joint_displacement(POLE, still, bent)
    chord = 4.0 * np.sin(0.3)
    assert np.isclose(found.largest, chord) and (found.joint, found.frame) == (1, 6)
    assert np.isclose(found.mean, chord / 6.0) and found.n_frames == 3


def test_frames_missing_in_either_motion_are_ignored():
    still, bent = _clip(0.0, [0, 1, 2]), _clip(0.6, [0, -1, 2])
    found = joint_displacement(POLE, still, bent)
    assert found.largest == 0.0 and found.n_frames == 2


def test_points_are_compared_only_if_visible_in_both_motions():
    points = np.ones((3, 2, 4))
    moved = points.copy()
    moved[1, 0, 0] += 3.0
    moved[2, 1, :3] += 9.0
    moved[2, 1, 3] = 0.0
    timing = _clip(0.0, [0, 1, 2]).timing
    before = PointClip("p", timing, points)
    found = point_displacement(before, replace(before, points=moved))
    assert (found.largest, found.joint, found.frame) == (3.0, 0, 6)
    assert np.isclose(found.mean, 3.0 / 5.0)
