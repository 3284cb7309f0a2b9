"""The Move tool: two-link chains in closed form, arrows, and translations of roots and figures."""

import numpy as np
import pytest
from app.posing_rigs import arm_figure
from numpy.testing import assert_allclose

from viewer.app.core.view_frame import ViewFrame
from viewer.app.posing.move_tool import (
    LENGTH,
    Arrow,
    MoveHandle,
    ReachHandle,
    arrows,
    grab_arrow,
    longest_chain,
    shifts,
    translation_dofs,
    used_chain,
)
from viewer.app.posing.posed_joint import posed_joint
from viewer.rendering.camera import Camera
from viewer.rig.scene import Actor

BOX = np.array([[-1.0, -1, -1], [3, 1, 1]])


def frame(azimuth=0.0, inclination=0.0, parallel=False) -> ViewFrame:
    camera = Camera(distance=6.0, azimuth=azimuth, inclination=inclination, orthographic=parallel)
    matrix = camera.projection_matrix(1.0, BOX) @ camera.view_matrix()
    return ViewFrame(matrix, (0.0, 0.0, 600.0, 600.0))


def bent_arm(**settings):
    actor = Actor(arm_figure(orders=("z", "z", ""), **settings))
    actor.pose.dofs[-2:] = 0.4, 0.8
    return actor


def hand_of(actor, pose):
    return posed_joint(actor, 2, pose).center


@pytest.mark.parametrize("scale", [1.0, 0.25])
def test_joint_moves_to_the_pointer_at_constant_depth(scale) -> None:
    actor, view = bent_arm(), frame()
    actor.pose.figure_scale = scale
    actor.placement[:3, 3] = 0.2, -0.1, 0.5
    posed = posed_joint(actor, 2)
    start = view.place(posed.center)
    target = actor.placement[:3, 3] + scale * np.array([0.5, 1.2, 0])
    outcome = ReachHandle(posed, actor.pose, start, 2).follow(view, view.place(target), False)
    assert_allclose(hand_of(actor, outcome.pose), target, atol=1e-5)
    # Law of cosines: two unit links and |(0.5, 1.2)| = 1.3, so cos(elbow) = 1.3^2 / 2 - 1.
    assert abs(outcome.pose.dofs[1]) == pytest.approx(np.arccos(1.69 / 2 - 1), abs=1e-4)
    assert outcome.target is None and outcome.text == "hand"


def test_joint_grabbed_off_its_centre_keeps_the_offset() -> None:
    actor, view = bent_arm(), frame(parallel=True)
    posed = posed_joint(actor, 2)
    x, y = view.place(posed.center)
    handle = ReachHandle(posed, actor.pose, (x + 5, y - 3), 2)
    outcome = handle.follow(view, (x + 5, y - 3), False)
    assert_allclose(outcome.pose.dofs, actor.pose.dofs, atol=1e-6)


def test_drag_there_and_back_leaves_no_drift() -> None:
    actor, view = bent_arm(), frame()
    posed = posed_joint(actor, 2)
    x, y = view.place(posed.center)
    handle = ReachHandle(posed, actor.pose, (x, y), 2)
    first = handle.follow(view, (x - 40, y + 10), False).pose.dofs
    for place in ((x + 200, y - 300), (x - 250, y), (x, y + 90)):
        handle.follow(view, place, False)
    assert (handle.follow(view, (x - 40, y + 10), False).pose.dofs == first).all()
    assert_allclose(handle.follow(view, (x, y), False).pose.dofs, actor.pose.dofs, atol=1e-9)


def test_unreachable_target_reports_its_distance() -> None:
    actor, view = bent_arm(), frame()
    posed = posed_joint(actor, 2)
    far = np.array([0.0, 2.9, 0.0])
    outcome = ReachHandle(posed, actor.pose, view.place(posed.center), 2).follow(
        view, view.place(far), False
    )
    # The straight arm is 2 long, so 0.9 remain.
    left = np.linalg.norm(hand_of(actor, outcome.pose) - far)
    assert left == pytest.approx(0.9, abs=0.01)
    assert outcome.text == f"hand   {left:.3g} away"
    assert_allclose(outcome.target, far, atol=1e-9)


def test_limits_are_kept_and_reported() -> None:
    actor, view = bent_arm(limits={(1, "z"): (0.5, 1.0)}), frame()
    posed = posed_joint(actor, 2)
    outcome = ReachHandle(posed, actor.pose, view.place(posed.center), 2).follow(
        view, view.place(np.array([0.1, 0.1, 0])), False
    )
    assert outcome.pose.dofs[1] == 1.0 and outcome.limited == (1,)


def test_chain_of_one_rotates_only_the_elbow() -> None:
    actor, view = bent_arm(), frame()
    posed = posed_joint(actor, 2)
    x, y = view.place(posed.center)
    outcome = ReachHandle(posed, actor.pose, (x, y), 1).follow(view, (x - 80, y), False)
    assert outcome.pose.dofs[0] == 0.4 and outcome.pose.dofs[1] != 0.8
    skeleton = actor.figure.skeleton
    assert [longest_chain(skeleton, joint) for joint in (-1, 0, 1, 2)] == [0, 0, 1, 2]


def test_default_chain_does_not_move_the_root() -> None:
    skeleton = bent_arm().figure.skeleton
    assert used_chain(skeleton, 2, 0).tolist() == [1]
    assert used_chain(skeleton, 2, 2).tolist() == [1, 0]
    assert used_chain(skeleton, 1, 0).tolist() == [0]  # no other joint can rotate
    assert used_chain(skeleton, 0, 0).tolist() == []


def test_only_roots_and_translating_joints_have_arrows() -> None:
    skeleton = arm_figure(root="xyz").skeleton
    assert shifts(skeleton, 0) and not shifts(skeleton, 1)
    assert translation_dofs(skeleton, 0).tolist() == [0, 1, 2]
    actor = Actor(arm_figure(root="y"))
    found = arrows(posed_joint(actor, 0), "world")
    assert [arrow.color for arrow in found] == [1]
    assert arrows(posed_joint(actor, 1), "world") == []


def test_arrow_is_picked_along_its_shaft_unless_it_points_at_the_eye() -> None:
    actor, view = Actor(arm_figure()), frame(parallel=True)
    found, center = arrows(posed_joint(actor, 0), "world"), np.zeros(3)
    assert grab_arrow(found, center, view, (300 + 0.7 * LENGTH, 302)).color == 0
    assert grab_arrow(found, center, view, (299, 300 - 0.7 * LENGTH)).color == 1
    assert grab_arrow(found, center, view, (304, 300)) is None
    assert grab_arrow(found, center, view, (300 - 0.7 * LENGTH, 300)) is None
    assert grab_arrow(found[2:], center, view, (300, 300)) is None


def test_arrow_moves_the_figure_only_along_its_axis() -> None:
    actor, view = Actor(arm_figure()), frame(azimuth=30, inclination=20)
    actor.placement[:3, :3] *= 2.0
    posed = posed_joint(actor, 0)
    ends = [view.place(np.array([x, 0.0, 0.0])) for x in (0.3, 0.8)]
    arrow = Arrow(np.array([1.0, 0, 0]), 0)
    outcome = MoveHandle(posed, actor.pose, ends[0], arrow).follow(view, ends[1], False)
    # Half a unit of the scene is a quarter of a unit of the figure, which is drawn at twice its
    # size.
    assert_allclose(outcome.pose.figure_translation, [0.25, 0, 0], atol=1e-9)
    assert outcome.text == "figure   +0.5 +0 +0"


def test_root_with_translations_moves_by_its_dofs_within_their_limits() -> None:
    actor = Actor(arm_figure(root="xyz", limits={(0, "Y"): (-0.1, 0.1)}))
    view = frame()
    posed = posed_joint(actor, 0)
    end = view.place(np.array([0.4, 0.6, 0.0]))
    outcome = MoveHandle(posed, actor.pose, view.place(np.zeros(3))).follow(view, end, False)
    assert_allclose(outcome.pose.dofs[:3], [0.4, 0.1, 0], atol=1e-9)
    assert outcome.limited == (1,) and not outcome.pose.figure_translation.any()
    assert not actor.pose.dofs.any()
