"""Handles in the view, dragged by a synthetic mouse."""

import numpy as np
import pytest
from app.posing_rigs import SIZE, arm_figure, arm_scene, around, drag_along, joint_seen
from app.test_panel_pictures import _compare, _is_like
from app.tiny import write_rig
from numpy.testing import assert_allclose, assert_array_equal

from viewer.app.closing import Closing
from viewer.app.posing.gizmo import arc_points, limit_arcs
from viewer.app.posing.joint_tree import joint_tree
from viewer.app.posing.posed_joint import posed_joint
from viewer.app.posing.posing import Posing
from viewer.app.posing.rotate_tool import RADIUS
from viewer.loading import bundled_files
from viewer.rendering.camera import camera_axes
from viewer.rigs.geometry.rotation import rotation_vector_to_matrix
from viewer.rigs.geometry.vectors import unit
from viewer.rigs.scene import Actor, Scene
from viewer.rigs.skeleton import joint_label

VIEW_RADIUS = 1.2 * RADIUS


def framed(drive, scene):
    """Return a test driver showing a scene with all joints well within the view."""
    hand = drive(scene=scene, size=SIZE, samples=1)
    hand.key("f")
    hand.state.camera.distance *= 1.5
    hand.step()
    return hand


@pytest.fixture
def arm(drive):
    """A test driver on an arm with the shoulder selected and the tool Rotate active."""
    hand = framed(drive, arm_scene())
    hand.state.selected_joint = 0
    hand.key("e")
    hand.step(2)
    return hand


def world_of(hand, joint):
    return posed_joint(hand.state.actor, joint).world[joint]


def test_view_ring_rotates_the_joint_by_the_angle_on_screen(arm):
    center, before = joint_seen(arm, 0), world_of(arm, 0)[:3, :3]
    to_eye = _to_eye(arm, world_of(arm, 0)[:3, 3])
    drag_along(arm, around(center, VIEW_RADIUS, 0.3, 1.1))
    wanted = rotation_vector_to_matrix(0.8 * to_eye) @ before
    assert arm.state.history.undone_next.name.startswith("rotate joint ")
    # ImGui rounds the pointer to whole points: half a point at both ends, 94 points from the
    # middle.
    assert_allclose(world_of(arm, 0)[:3, :3], wanted, atol=0.012)


def _to_eye(hand, point):
    from viewer.rendering.camera import eye

    away = eye(hand.state.camera) - point
    return away / np.linalg.norm(away)


def test_drag_is_one_undo_step(arm):
    before, steps = arm.dofs(), arm.undo_steps
    camera = arm.state.camera.azimuth, arm.state.camera.distance
    drag_along(arm, around(joint_seen(arm, 0), VIEW_RADIUS, 0.3, 1.1))
    after = arm.dofs()
    assert arm.undo_steps == steps + 1 and (after != before).any()
    assert (arm.state.camera.azimuth, arm.state.camera.distance) == camera
    arm.key("z", "ctrl")
    assert_array_equal(arm.dofs(), before)
    arm.key("z", "ctrl shift")
    assert_array_equal(arm.dofs(), after)


def test_click_on_a_ring_selects_the_joint_under_it(arm):
    camera = arm.state.camera
    camera.orthographic = True
    arm.step(2)
    for _ in range(3):  # until the elbow is as far from the shoulder as the outer ring
        apart = np.subtract(joint_seen(arm, 1), joint_seen(arm, 0))
        camera.distance *= np.linalg.norm(apart) / VIEW_RADIUS
        arm.step(2)
    before, steps = arm.dofs(), arm.undo_steps
    place = joint_seen(arm, 1)
    arm.move(place)
    arm.press()
    assert arm.state.of(Posing).drag is not None  # the ring is being dragged
    arm.let_go()
    arm.step(2)
    assert arm.state.selected_joint == 1
    assert_array_equal(arm.dofs(), before)
    assert arm.undo_steps == steps
    # A drag from that point rotates the shoulder, whose ring it is.
    arm.state.selected_joint = 0
    arm.step(2)
    drag_along(arm, around(joint_seen(arm, 0), VIEW_RADIUS, 0.0, 0.8))
    assert arm.state.selected_joint == 0 and (arm.dofs() != before).any()


@pytest.mark.parametrize("way", ["escape", "right button"])
def test_cancelled_drag_restores_the_pose_and_leaves_no_step(arm, way):
    before, steps = arm.dofs(), arm.undo_steps
    places = around(joint_seen(arm, 0), VIEW_RADIUS, 0.3, 1.1)
    arm.move(places[0])
    arm.press()
    arm.move(places[3])
    assert (arm.dofs() != before).any()
    if way == "escape":
        arm.key("escape")
    else:
        arm.press(1)
    assert_array_equal(arm.dofs(), before)
    # Until the button is released, moving the mouse neither orbits nor drags.
    azimuth = arm.state.camera.azimuth
    arm.move(places[-1])
    assert_array_equal(arm.dofs(), before)
    assert arm.state.camera.azimuth == azimuth and arm.state.selected_joint == 0
    arm.let_go()
    if way == "right button":
        arm.let_go(1)
    assert arm.state.of(Posing).drag is None and arm.undo_steps == steps
    assert arm.says("Drag cancelled")


def test_click_on_a_ring_does_not_change_the_pose(arm):
    before, steps = arm.dofs(), arm.undo_steps
    place = around(joint_seen(arm, 0), VIEW_RADIUS, 0.3, 0.3, 1)[0]
    drag_along(arm, [place, place])
    assert_array_equal(arm.dofs(), before)
    assert arm.undo_steps == steps and arm.state.selected_joint == 0


def test_ctrl_snaps_to_fifteen_degrees(arm):
    to_eye = _to_eye(arm, world_of(arm, 0)[:3, 3])
    drag_along(arm, around(joint_seen(arm, 0), VIEW_RADIUS, 0.3, 1.1), held="ctrl")
    # 0.8 radians are 45.8 degrees.
    wanted = rotation_vector_to_matrix(np.radians(45) * to_eye)
    assert_allclose(world_of(arm, 0)[:3, :3], wanted, atol=1e-6)


def test_drag_outside_the_rings_orbits(arm):
    azimuth, before = arm.state.camera.azimuth, arm.dofs()
    x, y = joint_seen(arm, 0)
    arm.pull((x + 30, y + 200), (x + 90, y + 200))
    assert arm.state.camera.azimuth != azimuth
    assert_array_equal(arm.dofs(), before)


def test_select_tool_shows_no_rings(arm):
    arm.key("q")
    before, azimuth = arm.dofs(), arm.state.camera.azimuth
    drag_along(arm, around(joint_seen(arm, 0), VIEW_RADIUS, 0.3, 1.1))
    assert_array_equal(arm.dofs(), before)
    assert arm.state.camera.azimuth != azimuth


def test_click_on_a_joint_behind_the_skin_selects_it(arm):
    arm.click(joint_seen(arm, 2))
    assert arm.state.selected_joint == 2
    assert {0, 1, 2} <= joint_tree(arm.state).opened


def test_reset_during_a_drag_ends_it(arm):
    places = around(joint_seen(arm, 0), VIEW_RADIUS, 0.3, 1.1)
    arm.move(places[0])
    arm.press()
    arm.move(places[2])
    arm.key("r")
    assert not arm.dofs().any()
    arm.move(places[-1])
    assert not arm.dofs().any()
    arm.let_go()
    assert arm.state.of(Posing).drag is None


def test_ik_brings_the_hand_to_the_pointer(drive):
    scene = Scene([Actor(arm_figure(orders=("xyz", "xyz", "xyz")))])
    scene.actors[0].pose.dofs[5] = 0.8
    hand = framed(drive, scene)
    hand.state.selected_joint = 2
    hand.key("d")
    hand.state.of(Posing).chain_length = 2
    depth = _depth(hand, world_of(hand, 2)[:3, 3])
    x, y = joint_seen(hand, 2)
    end, steps = (x - 60, y + 20), hand.undo_steps
    drag_along(hand, [(x, y), (x - 10, y), (x - 40, y + 30), end])
    assert_allclose(joint_seen(hand, 2), end, atol=0.5)
    assert _depth(hand, world_of(hand, 2)[:3, 3]) == pytest.approx(depth, abs=1e-3)
    assert hand.undo_steps == steps + 1


def _depth(hand, point):
    return (point - hand.state.camera.target) @ camera_axes(hand.state.camera)[2]


def test_any_joint_can_be_dragged_without_being_selected_first(drive):
    hand = framed(drive, arm_scene())
    hand.key("d")
    assert hand.state.selected_joint == -1
    x, y = joint_seen(hand, 2)
    drag_along(hand, [(x, y), (x - 20, y - 30)])
    assert hand.state.selected_joint == 2 and hand.dofs().any()


def test_root_is_dragged_directly_or_by_its_arrow(drive):
    hand = framed(drive, arm_scene())
    hand.state.selected_joint = 0
    hand.key("d")
    x, y = joint_seen(hand, 0)
    drag_along(hand, [(x, y), (x + 10, y), (x + 40, y - 25)])
    assert_allclose(joint_seen(hand, 0), (x + 40, y - 25), atol=0.01)
    label = joint_label(hand.state.actor.figure.require_skeleton(), 0)
    assert hand.state.history.undone_next.name == f"move joint {label}"
    first = hand.state.actor.pose.figure_translation.copy()
    x, y = joint_seen(hand, 0)
    drag_along(hand, [(x, y - 45), (x, y - 60), (x + 7, y - 90)])  # the upward arrow
    moved = hand.state.actor.pose.figure_translation - first
    assert moved[1] > 0.05 and and_zero(moved[[0, 2]])
    assert not hand.dofs().any() and hand.undo_steps == 2


def and_zero(values):
    return bool((np.abs(values) < 1e-9).all())


def test_limits_are_kept_during_random_drags(drive, tmp_path):
    hand = drive(*write_rig(tmp_path), size=SIZE, samples=1)
    random = np.random.default_rng(3)
    for number in range(24):
        hand.state.selected_joint = number % 2
        hand.key("e" if number % 3 else "d")
        x, y = joint_seen(hand, number % 2)
        angle = random.uniform(0, 6.28)
        radius = RADIUS if number % 3 else random.uniform(0, 60)
        start = (x + radius * np.cos(angle), y + radius * np.sin(angle))
        drag_along(hand, [start, *(random.uniform(0, SIZE) for _ in range(4))])
        hand.assert_sane()
    locked = hand.dof("root.z")
    assert locked == 0.3


def test_bind_pose_and_hidden_actors_have_no_handles(arm):
    arm.state.actor.visible = False
    before = arm.dofs()
    drag_along(arm, around(joint_seen(arm, 0), VIEW_RADIUS, 0.3, 1.1))
    assert_array_equal(arm.dofs(), before)


def test_drag_may_end_over_a_panel(arm):
    places = around(joint_seen(arm, 0), VIEW_RADIUS, 0.3, 1.1)
    drag_along(arm, [*places, (5.0, 300.0)])
    assert arm.state.of(Posing).drag is None and arm.dofs().any() and arm.undo_steps == 1
    azimuth = arm.state.camera.azimuth
    arm.move(places[0])
    assert arm.state.camera.azimuth == azimuth


def test_panel_over_the_view_keeps_its_clicks(arm):
    before = arm.dofs()
    x, y = arm.place("tool Mirror")
    arm.pull((x, y), (x + 30, y + 30))
    assert_array_equal(arm.dofs(), before)


def test_new_scene_ends_a_drag(arm, tmp_path):
    places = around(joint_seen(arm, 0), VIEW_RADIUS, 0.3, 1.1)
    arm.move(places[0])
    arm.press()
    arm.move(places[2])
    arm.state.of(Closing).discards = True  # the question about the pose would end the drag
    arm.open(*write_rig(tmp_path))
    before = arm.dofs()
    arm.move(places[-1])
    arm.let_go()
    assert_array_equal(arm.dofs(), before)
    assert arm.state.of(Posing).drag is None


def _posed(drive, joint, key):
    """Return a test driver on the fox with a joint selected, a tool active and panels hidden."""
    hand = drive(*bundled_files(), size=(700, 520), samples=1, pixels_per_point=1.0)
    hand.key(key)
    hand.key("tab")
    hand.step(3)
    hand.key("f")
    hand.state.selected_joint = hand.state.actor.figure.skeleton.names.index(joint)
    hand.state.messages.notes.clear()
    return hand


def _rotate(drive):
    hand = _posed(drive, "head", "e")
    place = around(joint_seen(hand, hand.state.selected_joint), RADIUS, 0.8, 0.8, 1)[0]
    hand.move((5.0, place[1]))
    return hand


def _turning(drive):
    hand = _posed(drive, "head", "e")
    center = joint_seen(hand, hand.state.selected_joint)
    for number, place in enumerate(around(center, 1.2 * RADIUS, 0.0, 1.4)):
        hand.move(place)
        if not number:
            hand.press()
    return hand


def _moving(drive):
    hand = _posed(drive, "head", "d")
    hand.state.of(Posing).chain_length = 3
    x, y = joint_seen(hand, hand.state.selected_joint)
    hand.move((x, y))
    hand.press()
    hand.move((x + 60, y - 120))
    return hand


PICTURES = {"gizmo_rotate": _rotate, "gizmo_turning": _turning, "gizmo_moving": _moving}


@pytest.mark.golden("app_{name}")
@pytest.mark.parametrize("name", PICTURES)
def test_handles_match_golden_images(drive, name):
    hand = PICTURES[name](drive)
    hand.state.messages.notes.clear()
    _compare(hand.screen(), name)


def test_comparison_detects_missing_handles(drive):
    hand = _rotate(drive)
    with_rings = hand.screen()
    hand.key("q")
    hand.state.messages.notes.clear()
    assert not _is_like(with_rings, hand.screen())


LIMITS = {(0, "x"): (-0.5, 0.7), (0, "y"): (-1.0, 0.4), (0, "z"): (-0.3, 1.2)}


def limited_arm():
    actor = Actor(arm_figure(limits=LIMITS))
    actor.pose.dofs[:3] = 0.2, -0.4, 0.9
    actor.placement[:3, :3] = rotation_vector_to_matrix(np.array([0.4, 0.2, -0.7]))
    return actor


@pytest.mark.parametrize("dof", [1, 2])
def test_arc_ends_are_at_the_limits_of_the_bone(dof):
    actor = limited_arm()
    joint = posed_joint(actor, 0)
    arc = next(arc for arc in limit_arcs(joint, actor.pose) if arc.dof == dof)
    ends = arc_points(arc, joint.center, 1.0)[[0, -1]]
    for end, value in zip(ends, actor.figure.skeleton.dof_limits[dof], strict=True):
        pose = actor.pose.copy()
        pose.dofs[dof] = value
        bone = posed_joint(actor, 1, pose).center - joint.center
        # The arc is about the axis, so only the component of the bone perpendicular to it is
        # compared.
        across = unit(bone - (bone @ arc.axis) * arc.axis)
        assert_allclose(end - joint.center, across, atol=1e-9)


def test_twist_is_shown_by_an_axis_that_rotates_with_the_joint():
    # The bone points along x, so a rotation about x does not move it.
    actor = Actor(arm_figure(limits=LIMITS))
    joint = posed_joint(actor, 0)
    arc = limit_arcs(joint, actor.pose)[0]
    assert arc.dof == 0 and abs(arc.start @ [1, 0, 0]) < 1e-9
    pose = actor.pose.copy()
    pose.dofs[0] = 0.7
    turned = limit_arcs(posed_joint(actor, 0, pose), pose)[0]
    ahead = rotation_vector_to_matrix(0.7 * arc.axis) @ arc.start
    assert_allclose(turned.start, ahead, atol=1e-9)
    assert (turned.high, turned.is_limited) == (pytest.approx(0.0, abs=1e-12), True)


def test_arcs_have_axis_colours_and_span_the_limits():
    actor = limited_arm()
    found = limit_arcs(posed_joint(actor, 0), actor.pose)
    assert [arc.color for arc in found] == [0, 1, 2]
    assert_allclose([[a.low, a.high] for a in found], [[-0.7, 0.5], [-0.6, 0.8], [-1.2, 0.3]])
    assert not any(arc.is_limited for arc in found)


def test_dof_without_two_limits_has_no_arc():
    actor = Actor(arm_figure(limits={(0, "x"): (-np.inf, 1.0), (0, "y"): (0.3, 0.3)}))
    assert limit_arcs(posed_joint(actor, 0), actor.pose) == []


def test_range_over_360_degrees_is_drawn_as_a_full_circle():
    actor = Actor(arm_figure(limits={(0, "z"): (-9.0, 9.0)}))
    arc = limit_arcs(posed_joint(actor, 0), actor.pose)[0]
    points = arc_points(arc, np.zeros(3), 1.0)
    assert_allclose(points[0], points[-1], atol=1e-9)
    assert len(points) < 100


def test_joint_without_children_shows_its_box_or_the_bone_of_its_parent():
    actor = Actor(arm_figure(limits={(2, "z"): (-1.0, 1.0)}))
    arc = limit_arcs(posed_joint(actor, 2), actor.pose)[0]
    assert_allclose(arc.start @ arc.axis, 0, atol=1e-12)
    assert_allclose(np.linalg.norm(arc.start), 1)
