"""The switch of spring joints in the Actors panel."""

import numpy as np
from formats.vrm.swinging import swinging

from viewer.app.actors.springs import no_springs
from viewer.loading import MotionSettings, load


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
    assert "has no joints that swing" in no_springs(hand.state)
