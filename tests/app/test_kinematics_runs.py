"""The number of forward kinematics runs: once per frame, even if several panels show the pose."""

import pytest

from viewer.app.actors.following import start_following
from viewer.app.posing.joint_tree import select_joint
from viewer.app.posing.toolbar import choose_tool
from viewer.app.weights.weights_panel import pin_vertex, show_scalar
from viewer.rig import kinematics


@pytest.fixture
def runs(monkeypatch):
    """The number of poses for which forward kinematics ran."""
    counted, run = [], kinematics.forward_kinematics

    def count(parents, local, root=None):
        counted.extend([1] * (local.shape[1] if local.ndim == 4 else 1))
        return run(parents, local, root)

    monkeypatch.setattr("viewer.rig.kinematics.forward_kinematics", count)
    return counted


def show_everything(state):
    """Show a pose as skin, boxes, bones, names, axes, rings, an explained vertex and numbers."""
    options = state.options
    options.show, options.xray, options.joint_names, options.joint_axes = "both", True, True, True
    options.keypoints = True
    choose_tool(state, "rotate")
    select_joint(state, 1)
    pin_vertex(state, 0, 0)
    show_scalar(state, "field" if state.actor.figure.fields else "weight")
    start_following(state, 0, 1)


def test_edited_pose_runs_kinematics_once(hand, runs):
    show_everything(hand.state)
    hand.step(4)
    runs.clear()
    hand.state.actor.pose.dofs[hand.dof_index("arm.x")] += 0.1
    hand.step(1)
    assert runs == [1]
    hand.step(2)
    assert runs == [1]


def test_edited_pose_of_a_body_model_runs_kinematics_once(box, runs):
    show_everything(box.state)
    box.step(4)
    runs.clear()
    box.state.actor.pose.dofs[-1] += 0.1
    box.step(1)
    assert runs == [1]


def test_moved_camera_runs_no_kinematics(hand, runs):
    show_everything(hand.state)
    hand.step(4)
    runs.clear()
    hand.state.camera.azimuth += 5.0
    hand.step(2)
    assert runs == []
