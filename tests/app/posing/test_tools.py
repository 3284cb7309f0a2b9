"""Joints that are moved and rotated by dragging in the view."""

from dataclasses import replace

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
from viewer.app.posing.rotate_tool import RADIUS, RotateHandle, circle, grab_ring, limit_text, rings
from viewer.rendering.camera import Camera
from viewer.rigs.geometry.rotation import rotation_vector_to_matrix
from viewer.rigs.pose import joint_rotations
from viewer.rigs.scene import Actor

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
def test_joint_moves_to_the_pointer_at_constant_depth(scale):
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


def test_joint_grabbed_off_its_centre_keeps_the_offset():
    actor, view = bent_arm(), frame(parallel=True)
    posed = posed_joint(actor, 2)
    x, y = view.place(posed.center)
    handle = ReachHandle(posed, actor.pose, (x + 5, y - 3), 2)
    outcome = handle.follow(view, (x + 5, y - 3), False)
    assert_allclose(outcome.pose.dofs, actor.pose.dofs, atol=1e-6)


def test_drag_there_and_back_leaves_no_drift():
    actor, view = bent_arm(), frame()
    posed = posed_joint(actor, 2)
    x, y = view.place(posed.center)
    handle = ReachHandle(posed, actor.pose, (x, y), 2)
    for place in ((x - 40, y + 10), (x + 20, y - 30), (x - 25, y), (x, y + 90)):
        handle.follow(view, place, False)
    assert_allclose(handle.follow(view, (x, y), False).pose.dofs, actor.pose.dofs, atol=1e-5)


def test_unreachable_target_reports_its_distance():
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


def test_limits_are_kept_and_reported():
    actor, view = bent_arm(limits={(1, "z"): (0.5, 1.0)}), frame()
    posed = posed_joint(actor, 2)
    outcome = ReachHandle(posed, actor.pose, view.place(posed.center), 2).follow(
        view, view.place(np.array([0.1, 0.1, 0])), False
    )
    assert outcome.pose.dofs[1] == 1.0 and outcome.limited == (1,)


def test_chain_of_one_rotates_only_the_elbow():
    actor, view = bent_arm(), frame()
    posed = posed_joint(actor, 2)
    x, y = view.place(posed.center)
    outcome = ReachHandle(posed, actor.pose, (x, y), 1).follow(view, (x - 80, y), False)
    assert outcome.pose.dofs[0] == 0.4 and outcome.pose.dofs[1] != 0.8
    skeleton = actor.figure.skeleton
    assert [longest_chain(skeleton, joint) for joint in (-1, 0, 1, 2)] == [0, 0, 1, 2]


def test_default_chain_does_not_move_the_root():
    skeleton = bent_arm().figure.skeleton
    assert used_chain(skeleton, 2, 0).tolist() == [1]
    assert used_chain(skeleton, 2, 2).tolist() == [1, 0]
    assert used_chain(skeleton, 1, 0).tolist() == [0]  # no other joint can rotate
    assert used_chain(skeleton, 0, 0).tolist() == []


def test_only_roots_and_translating_joints_have_arrows():
    skeleton = arm_figure(root="xyz").skeleton
    assert shifts(skeleton, 0) and not shifts(skeleton, 1)
    assert translation_dofs(skeleton, 0).tolist() == [0, 1, 2]
    actor = Actor(arm_figure(root="y"))
    found = arrows(posed_joint(actor, 0), "world")
    assert [arrow.color for arrow in found] == [1]
    assert arrows(posed_joint(actor, 1), "world") == []


def test_arrow_is_picked_along_its_shaft_unless_it_points_at_the_eye():
    actor, view = Actor(arm_figure()), frame(parallel=True)
    found, center = arrows(posed_joint(actor, 0), "world"), np.zeros(3)
    assert grab_arrow(found, center, view, (300 + 0.7 * LENGTH, 302)).color == 0
    assert grab_arrow(found, center, view, (299, 300 - 0.7 * LENGTH)).color == 1
    assert grab_arrow(found, center, view, (304, 300)) is None
    assert grab_arrow(found, center, view, (300 - 0.7 * LENGTH, 300)) is None
    assert grab_arrow(found[2:], center, view, (300, 300)) is None


def test_arrow_moves_the_figure_only_along_its_axis():
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


def test_root_with_translations_moves_by_its_dofs_within_their_limits():
    actor = Actor(arm_figure(root="xyz", limits={(0, "Y"): (-0.1, 0.1)}))
    view = frame()
    posed = posed_joint(actor, 0)
    end = view.place(np.array([0.4, 0.6, 0.0]))
    outcome = MoveHandle(posed, actor.pose, view.place(np.zeros(3))).follow(view, end, False)
    assert_allclose(outcome.pose.dofs[:3], [0.4, 0.1, 0], atol=1e-9)
    assert outcome.limited == (1,) and not outcome.pose.figure_translation.any()
    assert not actor.pose.dofs.any()


def parallel_frame(azimuth=0.0, inclination=0.0, parallel=True) -> ViewFrame:
    camera = Camera(distance=5.0, azimuth=azimuth, inclination=inclination, orthographic=parallel)
    matrix = camera.projection_matrix(1.0, BOX) @ camera.view_matrix()
    return ViewFrame(matrix, (0.0, 0.0, 600.0, 600.0))


def grabbed(actor, joint, view, place, orientation="local"):
    posed = posed_joint(actor, joint)
    ring, held = grab_ring(rings(posed, actor.pose, orientation, view), posed.center, view, place)
    return RotateHandle(posed, actor.pose, ring, held, place)


def spot(angle, radius=RADIUS):
    """Return a position on a circle around the joint, counter-clockwise from the right."""
    return (300 + radius * np.cos(angle), 300 - radius * np.sin(angle))


def test_free_joint_has_three_rings_and_one_about_the_line_of_sight():
    actor, view = Actor(arm_figure()), parallel_frame()
    found = rings(posed_joint(actor, 0), actor.pose, "local", view)
    assert [(ring.color, ring.dof) for ring in found] == [(0, -1), (1, -1), (2, -1), (3, -1)]
    assert_allclose([ring.axis for ring in found], [*np.eye(3), [0, 0, 1]], atol=1e-9)


def test_rings_and_their_pick_distance_scale_with_the_interface():
    actor = Actor(arm_figure())
    view = replace(parallel_frame(), scale=2.0)
    posed = posed_joint(actor, 0)
    found = rings(posed, actor.pose, "local", view)
    for inside, is_held in ((2 * RADIUS - 12, True), (2 * RADIUS - 16, False), (RADIUS, False)):
        held = grab_ring(found[2:3], posed.center, view, spot(0.4, inside))
        assert (held is not None) == is_held


@pytest.mark.parametrize(
    ("orientation", "x_axis"), [("world", [1, 0, 0]), ("parent", [0, 1, 0]), ("local", [-1, 0, 0])]
)
def test_orientation_setting_determines_the_axes(orientation, x_axis):
    actor = Actor(arm_figure(orders=("xyz", "xyz", "xyz")))
    actor.pose.dofs[[2, 5]] = np.pi / 2  # shoulder and elbow each by 90 degrees about z
    found = rings(posed_joint(actor, 1), actor.pose, orientation, parallel_frame())
    assert_allclose(found[0].axis, x_axis, atol=1e-12)


def test_joint_with_two_dofs_has_a_ring_about_each_dof_axis():
    # x is applied first, so the x axis is rotated by y, and the y axis is that of the parent.
    actor = Actor(arm_figure(orders=("xy", "z", "")))
    actor.pose.dofs[:2] = 0.7, np.pi / 2
    found = rings(posed_joint(actor, 0), actor.pose, "world", parallel_frame())
    assert [(ring.color, ring.dof) for ring in found] == [(0, 0), (1, 1)]
    assert_allclose([ring.axis for ring in found], [[0, 0, -1], [0, 1, 0]], atol=1e-12)
    assert rings(posed_joint(actor, 2), actor.pose, "world", parallel_frame()) == []


def test_locked_dof_has_no_ring():
    actor = Actor(arm_figure(limits={(0, "y"): (0.2, 0.2)}))
    found = rings(posed_joint(actor, 0), actor.pose, "local", parallel_frame())
    assert [ring.dof for ring in found] == [0, 2]


def test_circle_is_round_and_perpendicular_to_its_axis():
    center, axis = np.array([1.0, 2, 3]), np.array([0.6, 0, 0.8])
    points = circle(center, axis, 2.5)
    assert_allclose(np.linalg.norm(points - center, axis=1), 2.5)
    assert_allclose((points - center) @ axis, 0, atol=1e-12)
    assert_allclose(points[0], points[-1], atol=1e-12)


def test_pointer_picks_the_nearest_ring_within_range():
    actor, view = Actor(arm_figure()), parallel_frame()
    posed = posed_joint(actor, 0)
    found = rings(posed, actor.pose, "local", view)
    at = (300 + RADIUS * np.cos(1.0), 300 - RADIUS * np.sin(1.0))
    ring, held = grab_ring(found, posed.center, view, at)
    assert ring.color == 2
    assert_allclose(held, [np.cos(1.0), np.sin(1.0), 0], atol=0.02)
    assert grab_ring(found, posed.center, view, (300 + 1.2 * RADIUS, 300))[0].color == 3
    assert grab_ring(found, posed.center, view, (330, 320)) is None
    assert grab_ring(found, posed.center, view, (500, 500)) is None


@pytest.mark.parametrize("parallel", [True, False])
@pytest.mark.parametrize("angle", [0.4, -1.2, 2.9])
def test_ring_facing_the_camera_rotates_by_the_pointer_angle(angle, parallel):
    actor, view = Actor(arm_figure()), parallel_frame(parallel=parallel)
    handle = grabbed(actor, 0, view, spot(0.7))  # no other ring crosses there
    assert handle.ring.color == 2
    for share in (0.3, 0.6, 1.0):
        outcome = handle.follow(view, spot(0.7 + share * angle, 200.0), False)
    assert_allclose(outcome.pose.dofs[:3], [0, 0, angle], atol=1e-6)
    assert outcome.angle == pytest.approx(angle) and outcome.limited == ()
    assert not actor.pose.dofs.any()  # the initial pose is not modified


def test_rotation_accumulates_beyond_360_degrees():
    actor, view = Actor(arm_figure(orders=("z", "z", ""))), parallel_frame()
    handle = grabbed(actor, 0, view, (300 + RADIUS, 300.0))
    for turn in np.linspace(0, 4.5 * np.pi, 40):
        outcome = handle.follow(view, (300 + 90 * np.cos(turn), 300 - 90 * np.sin(turn)), False)
    assert outcome.pose.dofs[0] == pytest.approx(4.5 * np.pi)


def test_slanted_ring_follows_the_pointer_in_its_plane():
    # From 50 degrees above, the ring about y is an ellipse; one of its points is dragged to
    # another.
    actor, view = Actor(arm_figure()), parallel_frame(inclination=50.0)
    unit = view.unit_length(np.zeros(3))
    spot = [unit * RADIUS * np.array([np.sin(a), 0, np.cos(a)]) for a in (0.3, 1.0)]
    handle = grabbed(actor, 0, view, view.place(spot[0]), "world")
    assert handle.ring.color == 1
    outcome = handle.follow(view, view.place(spot[1]), False)
    assert_allclose(outcome.pose.dofs[:3], [0, 0.7, 0], atol=1e-3)


def test_ring_seen_edge_on_rolls_like_a_wheel():
    # The front of the ring about y moves right by one radius: one radian.
    actor, view = Actor(arm_figure()), parallel_frame()
    handle = grabbed(actor, 0, view, (310.0, 300.0))
    assert handle.ring.color == 1
    outcome = handle.follow(view, (310.0 + RADIUS, 300.0), False)
    assert outcome.pose.dofs[1] == pytest.approx(1.0, abs=1e-3)


def test_snap_steps_by_fifteen_degrees():
    actor, view = Actor(arm_figure()), parallel_frame()
    handle = grabbed(actor, 0, view, spot(0.7))
    outcome = handle.follow(view, spot(0.7 + np.radians(40.0)), True)
    assert outcome.angle == pytest.approx(np.radians(45.0))
    assert outcome.pose.dofs[2] == pytest.approx(np.radians(45.0))
    assert outcome.text == "shoulder z +45.0\N{DEGREE SIGN}"


def test_ball_joint_rotates_exactly_about_the_axis():
    actor, view = Actor(arm_figure(orders=("zxy", "yzx", ""))), parallel_frame()
    actor.pose.dofs[:] = 0.3, -0.4, 0.5, 0.6, 0.2, -0.9
    posed = posed_joint(actor, 1)
    before = posed.world[1, :3, :3]
    place = view.place(posed.center)
    handle = grabbed(actor, 1, view, (place[0] + 1.2 * RADIUS, place[1]))
    assert handle.ring.color == 3
    turn = 0.8
    end = (place[0] + 90 * np.cos(turn), place[1] - 90 * np.sin(turn))
    outcome = handle.follow(view, end, False)
    after = posed_joint(actor, 1, outcome.pose).world[1, :3, :3]
    wanted = rotation_vector_to_matrix(np.array([0, 0, turn])) @ before
    assert_allclose(after, wanted, atol=1e-7)
    assert_allclose(joint_rotations(posed.skeleton, outcome.pose)[0],
                    joint_rotations(posed.skeleton, actor.pose)[0])  # fmt: skip


def test_limit_stops_its_dof_and_is_reported():
    actor = Actor(arm_figure(orders=("z", "z", ""), limits={(0, "z"): (-0.2, 0.5)}))
    view = parallel_frame()
    handle = grabbed(actor, 0, view, (300 + RADIUS, 300.0))
    outcome = handle.follow(view, (300.0, 300 - RADIUS), False)
    assert outcome.pose.dofs[0] == 0.5 and outcome.limited == (0,)
    assert outcome.angle == pytest.approx(0.5)
    skeleton = actor.figure.skeleton
    assert limit_text(skeleton, outcome.limited) == "at its limit: shoulder.z"
    assert limit_text(skeleton, (0, 1)) == "at limits: shoulder.z, elbow.z"
    assert limit_text(skeleton, ()) == ""


def test_mirrored_figure_rotates_with_the_pointer():
    actor, view = Actor(arm_figure(orders=("z", "z", ""))), parallel_frame()
    actor.placement[0, 0] = -1.0
    handle = grabbed(actor, 0, view, (300 + RADIUS, 300.0))
    turn = 0.6
    outcome = handle.follow(view, (300 + 90 * np.cos(turn), 300 - 90 * np.sin(turn)), False)
    elbow = posed_joint(actor, 1, outcome.pose).center
    # The elbow was at (-1, 0, 0) and has moved counter-clockwise.
    assert_allclose(elbow, [-np.cos(turn), -np.sin(turn), 0], atol=1e-6)
