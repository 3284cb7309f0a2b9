"""The switch for planted feet of driven figures in the Actors panel."""

from __future__ import annotations

import numpy as np
import pytest
from rig.retargeting.rest_twins import t_pose, written
from rig.retargeting.two_people import BODY, figure_of
from rig.retargeting.walking import RATE, walk

from viewer.app.retargeting.drive_changes import no_edit
from viewer.app.retargeting.feet import plants_feet, toggle_feet
from viewer.rig.retargeting.drive import Drive
from viewer.rig.retargeting.driven_clip import driven_clip
from viewer.rig.retargeting.retarget import retarget
from viewer.rig.scene import Actor, Scene


@pytest.fixture
def walker(drive):
    figure = figure_of(BODY, "body")
    motion = Drive(written(t_pose(), *walk(), rate=RATE))
    clip, _ = driven_clip(motion, figure)
    hand = drive(scene=Scene([Actor(figure, clip=clip, drive=motion)]), size=(1000, 1000))
    hand.show_panel("Actors")
    hand.step(3)
    return hand


def test_check_box_turns_planted_feet_off_and_undo_restores_them(walker):
    hand, actor = walker, walker.state.actor
    before = actor.clip
    plain, _ = retarget(actor.drive.motion, actor.figure)
    assert plants_feet(hand.state) and no_edit(hand.state) == ""
    hand.state.clock.seek(0.5)
    hand.step(2)
    pose = actor.pose.dofs.copy()
    hand.click("Feet on the ground")
    hand.step(2)
    assert not plants_feet(hand.state)
    np.testing.assert_array_equal(actor.clip.rotations, plain.rotations)
    assert np.abs(actor.pose.dofs - pose).max() > 1e-3
    hand.key("z", "ctrl")
    hand.step(2)
    assert actor.clip is before and plants_feet(hand.state)
    np.testing.assert_array_equal(actor.pose.dofs, pose)
    toggle_feet(hand.state)
    assert not plants_feet(hand.state) and hand.says("Feet: as retargeted")


def test_figures_without_a_motion_of_another_skeleton_have_no_switch(hand):
    toggle_feet(hand.state)
    assert not plants_feet(hand.state)
    assert hand.says("no motion of another skeleton drives this figure")
