"""What motions set, and what they leave to the pose."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from rig.animated import about, channel, clip_of
from rig.hand_made import skeleton

from viewer.rig.captures.points import PointClip
from viewer.rig.figure import Figure
from viewer.rig.motion.clip import Channel, Clip
from viewer.rig.motion.evaluation import pose_actors, still_pose
from viewer.rig.motion.sampled_clip import SampledClip
from viewer.rig.motion.timing import Timing
from viewer.rig.scene import Actor

BALLS = [(joint, axis, 0.0) for joint in range(2) for axis in ("tx", "x", "y", "z")]
ONCE = Timing(30.0, [0])
TURN = channel(1, "rotation", [0.0], [about(0, 90.0)])


def curves() -> Clip:
    """Return a curve of the second joint's angle about x, DOF 5."""
    return Clip("curves", (Channel(5, [0.0], [0.25], (("flat", "flat"),)),), 0.0, 1.0)


def frames() -> SampledClip:
    """Return one frame at rest without translations."""
    return SampledClip("frames", ONCE, np.tile([0.0, 0, 0, 1], (1, 2, 1)))


def actor(clip) -> Actor:
    """Return an actor of two ball joints, with 1 everywhere in its pose."""
    made = Actor(Figure("two", skeleton=skeleton([-1, 0], BALLS)), clip=clip)
    made.pose.dofs[:] = made.pose.translations[:] = made.pose.scales[:] = 1.0
    made.pose.figure_scale = 3.0
    return made


def test_frames_without_translations_put_joints_at_rest():
    moved = actor(frames())
    pose_actors([moved], 0.0)
    assert not moved.pose.translations.any() and not moved.pose.dofs.any()
    assert moved.pose.figure_scale == 3.0 and (moved.pose.scales == 1.0).all()


def test_still_pose_resets_only_what_curves_set():
    found = still_pose(actor(curves()))
    assert_array_equal(found.dofs, [1, 1, 1, 1, 1, 0, 1, 1])
    assert (found.translations == 1.0).all()


def test_still_pose_resets_only_what_keys_of_transforms_set():
    found = still_pose(actor(clip_of(TURN, channel(0, "translation", [0.0], [[2.0, 0, 0]]))))
    # The first joint keeps its angles, the second one its translation.
    assert_array_equal(found.dofs, [0, 1, 1, 1, 1, 0, 0, 0])
    assert_array_equal(found.translations, [[0, 0, 0], [1, 1, 1]])


def test_still_pose_resets_all_joints_that_frames_set():
    found = still_pose(actor(frames()))
    assert not found.dofs.any() and not found.translations.any()
    assert (found.scales == 1.0).all() and found.figure_scale == 3.0


@pytest.mark.parametrize(
    ("clip", "names"),
    [
        (curves(), ["joint_motion", "keyed"]),
        (clip_of(TURN), ["joint_motion", "keyed", "transforms"]),
        (frames(), ["joint_motion", "captured"]),
        (PointClip("points", ONCE, np.zeros((1, 3, 4))), ["captured"]),
        (None, []),
    ],
)
def test_actor_names_its_motion_by_what_it_is(clip, names):
    made = actor(clip)
    every = ["joint_motion", "keyed", "captured", "transforms"]
    assert [name for name in every if getattr(made, name) is not None] == names
    assert all(getattr(made, name) is clip for name in names)
    assert made.moves_points == (names == ["captured"])
