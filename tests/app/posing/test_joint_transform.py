"""Translation and scale of joints in the Joints panel: unlocked or animated, undone and reset."""

import numpy as np
import pytest

from viewer.app.posing.joint_transform import moved_joints
from viewer.rig.motion.transform_clip import TransformChannel, TransformClip


@pytest.fixture
def unlocked(drive, rig):
    """A test driver on a rig whose arm has sliders for translation and scale."""
    hand = drive(*rig, size=(1000, 1000))
    hand.click("joint arm", button=1)
    hand.step(2)
    hand.click("Translation and scale")
    hand.step(3)
    return hand


def test_unlocked_joint_is_moved_and_scaled(unlocked):
    pose = unlocked.state.actor.pose
    assert moved_joints(unlocked.state) == {1}
    x, y = unlocked.place("arm.translation y")
    unlocked.pull((x, y), (x + 40.0, y))
    assert pose.translations[1, 1] > 0.0
    assert not pose.translations[1, [0, 2]].any() and not pose.translations[0].any()
    x, y = unlocked.place("arm.scale x")
    unlocked.pull((x, y), (x + 40.0, y))
    assert pose.scales[1, 0] > 1.0
    unlocked.key("z", "ctrl")
    unlocked.key("z", "ctrl")
    pose = unlocked.state.actor.pose
    assert not pose.translations.any() and (pose.scales == 1.0).all()


def test_reset_of_a_joint_covers_translation_and_scale(unlocked):
    pose = unlocked.state.actor.pose
    pose.translations[1], pose.scales[1] = 1.0, 2.0
    unlocked.step(2)
    unlocked.click("joint arm", button=1)
    unlocked.step(2)
    unlocked.click("Reset this joint")
    pose = unlocked.state.actor.pose
    assert not pose.translations.any() and (pose.scales == 1.0).all()


def test_joints_that_an_animation_moves_or_scales_are_listed(hand):
    times, skeleton = np.array([0.0, 1.0]), hand.state.actor.figure.skeleton
    rest = np.tile(skeleton.rest_translations[0], (2, 1))
    moved = TransformChannel(0, "translation", times, np.add(rest, [[0, 0, 0], [0, 1, 0]]))
    still = TransformChannel(1, "scale", times, np.tile(skeleton.rest_scales[1], (2, 1)))
    turned = TransformChannel(1, "rotation", times, np.tile([0.0, 0.0, 0.0, 1.0], (2, 1)))
    hand.state.actor.clip = TransformClip("walk", (moved, still, turned), 0.0, 1.0)
    assert moved_joints(hand.state) == {0}
