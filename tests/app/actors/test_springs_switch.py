"""The switch for spring joints in the Actors panel."""

import numpy as np
from formats.vrm.swinging import swinging
from numpy.testing import assert_allclose

import viewer
from viewer.app.actors.actors_panel import no_springs
from viewer.app.files.motion_export import save_motion
from viewer.loading import MotionSettings, load
from viewer.rig.motion.evaluation import pose_actors


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
