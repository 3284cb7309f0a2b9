"""Captured points at a fixed rate: frames, gaps, and upside-down worlds."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from viewer.errors import RigError
from viewer.rig.captures.points import PointClip, PointLayout
from viewer.rig.captures.sampled_points import sample_upright_points
from viewer.rig.figure import Figure
from viewer.rig.geometry.transform import rotation_transform
from viewer.rig.motion.timing import Timing
from viewer.rig.scene import Actor, Scene

LAYOUT = PointLayout("two", ("a", "b"), np.array([[0, 1]]), np.array([-1, 1]))
POINTS = np.array(
    [
        [[1, 2, 3, 0.5], [0, 0, 0, 0]],
        [[3, 2, 3, 1.0], [4, 5, 6, 0.25]],
    ]
)
NAN = np.nan


def scene_of(up="z", rows=(0, -1, 1), placement=None):
    clip = PointClip("take", Timing(10.0, np.array(rows), first_frame=7, holds=False), POINTS)
    actor = Actor(Figure("two", points=LAYOUT), clip=clip, person=4)
    actor.placement = np.eye(4) if placement is None else placement
    return Scene([actor], world_up=up), actor


def test_frames_are_returned_as_captured():
    animation, up = sample_upright_points(*scene_of())
    assert (animation.name, animation.layout, animation.frame_rate, up) == (
        "two 4",
        LAYOUT,
        10.0,
        "z",
    )
    assert (animation.first_frame, animation.times.tolist()) == (7, [0.0, 0.1, 0.2])
    assert animation.present.tolist() == [True, False, True]
    assert animation.confidences.tolist() == [[0.5, 0.0], [0.0, 0.0], [1.0, 0.25]]
    expected = [[[1, 2, 3], [NAN] * 3], [[NAN] * 3] * 2, [[3, 2, 3], [4, 5, 6]]]
    assert_array_equal(animation.points, expected)


def test_range_is_cut_and_gaps_are_interpolated():
    animation, _ = sample_upright_points(*scene_of(), frames=(1, 3), interpolate=True)
    assert (animation.first_frame, animation.present.tolist()) == (8, [True, True])
    # Point b is detected in only one of the adjacent frames.
    assert_array_equal(animation.points[0], [[2, 2, 3], [NAN] * 3])


def test_frames_at_another_rate_are_numbered_from_zero():
    animation, _ = sample_upright_points(*scene_of(rows=(0, 1)), rate=20.0)
    assert (animation.first_frame, animation.frame_rate) == (0, 20.0)
    assert animation.points[:, 0, 0].tolist() == [1.0, 2.0, 3.0]


def test_upside_down_world_is_rotated_upright():
    animation, up = sample_upright_points(*scene_of("y", placement=rotation_transform(0, np.pi)))
    assert up == "y"
    assert_array_equal(animation.points[2], [[3, -2, -3], [4, -5, -6]])


def test_rotation_between_up_axes_is_left_out():
    quarter = rotation_transform(0, -np.pi / 2)  # z in the capture is y in the scene
    animation, up = sample_upright_points(*scene_of("y", placement=quarter))
    assert up == "z"
    assert_array_equal(animation.points[2], POINTS[1, :, :3])


def test_ranges_outside_the_capture_and_actors_without_points_are_refused():
    scene, actor = scene_of()
    with pytest.raises(RigError, match=r"^frames: expected a range within 0 to 3, found 5 to 9$"):
        sample_upright_points(scene, actor, frames=(5, 9))
    actor.clip = None
    with pytest.raises(RigError, match=r"^two 4 has no motion of points$"):
        sample_upright_points(scene, actor)
