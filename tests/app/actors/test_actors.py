"""Parts that are shown, and the switch of springs, of each actor."""

from dataclasses import replace

import numpy as np
import pytest
from formats.vrm.swinging import swinging
from numpy.testing import assert_allclose

import viewer
from viewer.app.actors.actors_panel import no_springs
from viewer.app.context_menu import ContextMenu
from viewer.app.core.reasons import no_panel
from viewer.app.files.motion_export import save_motion
from viewer.loading import MotionSettings, load
from viewer.rigs.scene import Actor, Scene, pose_actors


@pytest.fixture
def parts(drive, rig):
    """A test driver on the tiny column, which has three parts: lid, foot and walls."""
    figure = viewer.load(*rig).actors[0].figure
    listed = np.array([0, 0, 1, 1, *[2] * 16])
    mesh = replace(figure.mesh, parts=("lid", "", "walls"), triangle_parts=listed)
    hand = drive(scene=Scene([Actor(replace(figure, mesh=mesh))]), size=(1000, 1000))
    hand.show_panel("Parts")
    hand.step(3)
    return hand


def test_check_boxes_hide_parts_and_undo_shows_them(parts):
    actor = parts.state.actor
    parts.click("part 2")
    parts.click("part 0")
    assert actor.hidden_parts == {0, 2}
    parts.key("z", "ctrl")
    assert actor.hidden_parts == {2}
    parts.click("Invert")
    assert actor.hidden_parts == {0, 1}
    parts.click("Show all")
    assert not actor.hidden_parts
    parts.click("part 1", button=1)
    parts.step(2)
    parts.click("Show only this part")
    assert actor.hidden_parts == {0, 2}


def test_right_click_hides_the_part_under_the_pointer(parts):
    parts.click(parts.middle, button=1)
    parts.step(3)
    assert parts.state.of(ContextMenu).spot.part == 2
    parts.click("Hide part")
    assert parts.state.actor.hidden_parts == {2}
    parts.key("z", "ctrl")
    assert not parts.state.actor.hidden_parts


def test_panel_requires_several_parts(hand):
    assert no_panel(hand.state, "parts") == "this figure has only one part"


def test_check_box_switches_springs_and_undo_restores_them(drive, tmp_path):
    path = tmp_path / "ada.vrm"
    path.write_bytes(swinging().glb())
    hand = drive(scene=load(path, motion=MotionSettings(springs=True)), size=(1000, 1000))
    state = hand.state
    actor, hair = state.actor, state.actor.figure.require_skeleton().springs.joints
    state.clock.seek(0.5)
    hand.show_panel("Actors")
    hand.step(3)

    def swing():
        rows = np.isin(actor.figure.require_skeleton().dof_joints, hair)
        return float(np.abs(actor.pose.dofs[rows]).max())

    assert swing() > 0.1
    hand.click("Springs")
    hand.step(2)
    assert actor.springs is None and swing() == 0.0
    hand.key("z", "ctrl")
    hand.step(2)
    assert actor.springs is not None and swing() > 0.1
    assert no_springs(state) == ""


def test_figures_without_springs_have_no_switch(hand):
    assert "has no spring joints" in no_springs(hand.state)


def test_exported_motions_do_not_contain_the_pose_of_springs(drive, tmp_path):
    path, out = tmp_path / "ada.vrm", tmp_path / "out.glb"
    path.write_bytes(swinging().glb())
    hand = drive(scene=load(path, motion=MotionSettings(springs=True)), size=(400, 300))
    hand.state.clock.seek(0.5)
    hand.step(2)
    save_motion(hand.state, out)
    hand.finish_job()
    assert hand.says("viewer convert can write the simulated ones")
    (plain,), (found,) = load(path).actors, load(out).actors
    for actor in (plain, found):
        pose_actors([actor], 0.5)
    hair = plain.figure.require_skeleton().springs.joints
    matrices = [viewer.joint_matrices(actor.figure, actor.pose)[hair] for actor in (plain, found)]
    # The file is in single precision.
    assert_allclose(matrices[1], matrices[0], rtol=0, atol=1e-6)
