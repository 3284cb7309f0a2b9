"""The Joints panel: sliders, limits, units, resets and the filter."""

import math
import time

import numpy as np
import pytest
from app.curves.plotted import SIZE, _center, clip_text
from app.posing_rigs import arm_figure
from app.tiny import FILE_POSE, LABELS, chain, comb
from imgui_bundle import imgui
from numpy.testing import assert_allclose

from viewer.app.keys import Keyboard
from viewer.app.posing.joint_transform import moved_joints
from viewer.app.posing.joint_tree import joint_tree
from viewer.app.posing.joints_panel import joint_rows
from viewer.app.posing.move_tool import shift_text
from viewer.app.posing.posed_joint import posed_joint
from viewer.rigs.geometry.rotation import rotation_vector_to_matrix
from viewer.rigs.motion.transform_clip import TransformChannel, TransformClip
from viewer.rigs.pose import joint_rotations, placement_matrix
from viewer.rigs.scene import Actor

SLIDERS = [label for label in LABELS if label != "root.z"]  # root.z is locked


def test_slider_drag_changes_only_its_dof_as_one_undo_step(hand):
    before = hand.dofs()
    for label in SLIDERS:
        hand.drag(label, 0.8)
        changed = np.flatnonzero(hand.dofs() != before)
        assert changed.tolist() == [hand.dof_index(label)]
        assert hand.undo_steps == 1
        hand.key("z", "ctrl")
        assert (hand.dofs() == before).all() and hand.undo_steps == 0


def test_slider_follows_the_mouse_over_the_range_of_its_limits(hand):
    for fraction in (0.0, 0.25, 1.0):
        hand.drag("root.x", fraction)
        assert hand.dof("root.x") == pytest.approx(-1 + 2 * fraction, abs=0.02)
        hand.drag("arm.y", fraction)
        assert hand.dof("arm.y") == pytest.approx(math.pi * (2 * fraction - 1), abs=0.05)


def test_slider_dragged_out_of_the_panel_stops_at_the_limit(hand):
    hand.pull("root.y", (5000.0, 5000.0))
    assert hand.dof("root.y") == 2.0
    hand.pull("root.y", (-5000.0, 0.0))
    assert hand.dof("root.y") == 0.5


def test_slider_typed_value_is_clamped_to_its_limits(hand):
    hand.enter_value("root.x", "400")
    assert hand.dof("root.x") == 1.0
    hand.enter_value("root.x", "-400")
    assert hand.dof("root.x") == -1.0


@pytest.mark.parametrize("degrees", [270, -725])
def test_unlimited_slider_keeps_a_typed_value_beyond_its_range(hand, degrees):
    hand.enter_value("arm.x", str(degrees))
    assert hand.dof("arm.x") == pytest.approx(math.radians(degrees), rel=1e-6)
    hand.step(5)
    assert hand.dof("arm.x") == pytest.approx(math.radians(degrees), rel=1e-6)
    assert hand.undo_steps == 1


@pytest.mark.parametrize("label", ["arm.x", "root.tx", "root.x"])
def test_invalid_typed_value_leaves_a_finite_pose(hand, label):
    for text in ("nan", "inf", "-inf", "1e39", "-1e300", "", "abc", "1/0", "--", "3e38"):
        hand.enter_value(label, text)
        hand.assert_sane()
    assert hand.scene_picture().any()


def test_typed_value_is_discarded_by_escape(hand):
    before = hand.dofs()
    hand.click(hand.place("arm.x", 0.3), held="ctrl")
    hand.type("90")
    hand.key("escape")
    hand.step(2)
    assert (hand.dofs() == before).all() and hand.undo_steps == 0


def test_locked_slider_does_not_move(hand):
    hand.drag("root.z", 0.9)
    hand.click(hand.place("root.z", 0.3), held="ctrl")
    hand.type("1")
    hand.key("enter")
    hand.double_click("root.z")
    assert hand.dof("root.z") == 0.3 and hand.undo_steps == 0


def test_radians_are_shown_and_typed_in_the_unit_of_the_file(hand):
    hand.click("radians")
    hand.enter_value("arm.x", "1.5")
    assert hand.dof("arm.x") == 1.5
    hand.click("degrees")
    hand.enter_value("arm.x", "90")
    assert hand.dof("arm.x") == pytest.approx(math.pi / 2, rel=1e-6)
    assert hand.state.in_degrees


def test_changing_the_unit_does_not_change_dofs(hand):
    before = hand.dofs()
    for label in ("radians", "degrees", "radians"):
        hand.click(label)
    assert (hand.dofs() == before).all() and hand.undo_steps == 0


def test_double_click_resets_one_dof(hand):
    hand.drag("arm.x", 0.9)
    hand.drag("arm.z", 0.1)
    moved = hand.dof("arm.z")
    hand.double_click("arm.x")
    assert hand.dof("arm.x") == FILE_POSE["arm.x"]
    assert hand.dof("arm.z") == moved


def test_double_click_is_one_undo_step(hand):
    hand.drag("arm.x", 0.9)
    hand.double_click(hand.place("arm.x", 0.1))
    steps = hand.undo_steps
    hand.key("z", "ctrl")
    # The first of the two clicks moves the slider, which may be a separate undo step.
    assert steps <= 3 and hand.dof("arm.x") != FILE_POSE["arm.x"]


def test_context_menu_resets_one_dof_or_sets_it_to_zero(hand):
    hand.drag("arm.x", 0.9)
    hand.click("arm.x", button=1)
    hand.click("Reset")
    assert hand.dof("arm.x") == FILE_POSE["arm.x"]
    hand.click("arm.x", button=1)
    hand.click("Set to 0")
    assert hand.dof("arm.x") == 0.0
    assert hand.undo_steps == 3


def test_context_menu_offers_zero_only_within_the_limits(hand):
    hand.click("root.y", button=1)
    hand.click("Set to 0")
    assert hand.dof("root.y") == 0.5


def test_context_menu_of_a_joint_resets_its_dofs(hand):
    for label in ("arm.x", "arm.y", "root.x"):
        hand.drag(label, 0.9)
    kept = hand.dof("root.x")
    hand.click(hand.place("joint arm", 0.5), button=1)
    hand.click("Reset this joint")
    assert [hand.dof(f"arm.{axis}") for axis in "xyz"] == [0.2, 0.0, -0.1]
    assert hand.dof("root.x") == kept


def test_reset_button_restores_the_clamped_pose_of_the_file(hand):
    for label in SLIDERS:
        hand.drag(label, 0.9)
    hand.click("Reset (R)")
    assert {label: hand.dof(label) for label in FILE_POSE} == FILE_POSE
    assert hand.dof("root.tx") == 0.0


def test_unchanged_values_keep_every_digit(hand):
    exact = 0.12345678901234567
    hand.state.actor.pose.dofs[hand.dof_index("arm.x")] = exact
    hand.step(3)
    hand.drag("arm.y", 0.7)
    assert hand.dof("arm.x") == exact


def test_filter_lists_only_joints_that_contain_its_text(hand):
    hand.click("Filter")
    hand.type("AR")
    hand.step(2)
    joints = {label for label in hand.state.item_rects if label.startswith("joint ")}
    assert joints == {"joint arm"}
    assert "arm.x" in hand.state.item_rects and "root.x" not in hand.state.item_rects


def test_filter_accepts_letters_that_are_shortcuts(hand):
    hand.drag("arm.x", 0.9)
    before, steps = hand.dofs(), hand.undo_steps
    view = (hand.state.camera.azimuth, hand.state.camera.orthographic)
    hand.click("Filter")
    hand.type("rskwntgf1375h?")
    for name in ("tab", "f1"):
        hand.key(name)
    assert joint_tree(hand.state).filter == "rskwntgf1375h?"
    assert (hand.dofs() == before).all() and hand.undo_steps == steps
    assert (hand.state.camera.azimuth, hand.state.camera.orthographic) == view
    assert hand.state.panels_visible and not hand.state.of(Keyboard).is_listed


def test_filter_without_a_match_lists_no_joint_and_can_be_cleared(hand):
    hand.click("Filter")
    hand.type("zzz")
    hand.step(2)
    assert not [label for label in hand.state.item_rects if label.startswith("joint ")]
    for _ in range(3):
        hand.key("backspace")
    hand.step(2)
    assert "joint arm" in hand.state.item_rects


def test_joint_row_selects_and_deselects(hand):
    hand.click(hand.place("joint arm", 0.5))
    assert hand.state.selected_joint == 1
    hand.click(hand.place("joint arm", 0.5))
    assert hand.state.selected_joint == -1


def test_joint_row_collapses_and_expands_with_its_arrow(hand):
    hand.click(hand.place("joint root", 0.02))
    assert "joint arm" not in hand.state.item_rects and "root.x" not in hand.state.item_rects
    hand.click(hand.place("joint root", 0.02))
    assert "joint arm" in hand.state.item_rects
    assert hand.state.selected_joint == -1


def test_selected_joint_is_highlighted_in_the_picture(drive, rig):
    hand = drive(rig[0])
    before = hand.scene_picture()
    hand.click(hand.place("joint arm", 0.5))
    assert (hand.scene_picture() != before).any()


def test_figure_without_skeleton_shows_a_message(drive, rig):
    hand = drive(rig[1])
    assert "Filter" not in hand.state.item_rects
    for name in ("r", "s", "k", "f"):
        hand.key(name)
    assert hand.state.actor.own_pose is None


@pytest.mark.parametrize("text", [chain(5000), comb(5000), comb(40_000)], ids=len)
def test_panel_is_usable_with_thousands_of_joints(drive, tmp_path, text):
    path = tmp_path / "many.skel"
    path.write_text(text)
    hand = drive(path)
    joint_tree(hand.state).opened = set(range(hand.state.actor.figure.skeleton.n_joints))
    hand.step(2)
    assert len(hand.state.item_rects) < 150  # rows out of sight are not drawn
    started = time.process_time()
    hand.step(5)
    assert (time.process_time() - started) / 5 < 0.1
    label = next(label for label in hand.state.item_rects if label.endswith(".y"))
    index = hand.dof_index(label)
    hand.click(hand.place(label, 0.9))
    assert hand.state.actor.pose.dofs[index] != 0.0


def test_rows_list_children_right_below_their_parent(hand):
    skeleton = hand.state.actor.figure.skeleton
    listed = joint_rows(skeleton, frozenset({0}), "")
    assert [(joint, depth) for joint, dof, depth in listed if dof < 0] == [(0, 0), (1, 1)]
    assert [dof for joint, dof, _ in listed if joint == 0 and dof >= 0] == list(range(6))
    assert not [dof for joint, dof, _ in listed if joint == 1 and dof >= 0]


def test_second_figure_can_be_activated_posed_and_reset(drive, rig, tmp_path):
    other = tmp_path / "other.skel"
    other.write_text("balljoint hip { offset 0 0 0 balljoint knee { offset 0 -1 0 } }")
    hand = drive(*rig, other)
    first = hand.state.scene.actors[0].pose.dofs.copy()
    hand.click("Actor")
    hand.key("down_arrow")
    assert "Actor" in hand.state.item_rects
    hand.state.choose_actor(1)
    hand.step(2)
    assert "knee.x" in hand.state.item_rects and "arm.x" not in hand.state.item_rects
    hand.key("escape")
    hand.drag("knee.x", 0.75)
    assert hand.state.actor is hand.state.scene.actors[1]
    assert hand.dof("knee.x") == pytest.approx(math.pi / 2, abs=0.1)
    assert (hand.state.scene.actors[0].pose.dofs == first).all()
    hand.key("r")
    assert hand.dof("knee.x") == 0.0


def test_escape_closes_a_context_menu_and_keeps_the_pose(hand):
    before = hand.dofs()
    hand.click("root.x", button=1)
    hand.step(2)
    hand.key("escape")
    hand.click("Filter")
    hand.type("root")
    assert joint_tree(hand.state).filter == "root"
    assert (hand.dofs() == before).all() and not hand.state.of(Keyboard).is_listed


def test_filter_without_a_match_shows_a_message_and_no_row(hand):
    hand.click("Filter")
    hand.type("xyz")
    hand.step(2)
    assert not [label for label in hand.state.item_rects if label.startswith("joint ")]


def test_drawing_changes_no_pose(hand):
    """A pose beyond its limits, as files of other programs have them, stays as it is."""
    pose = hand.state.actor.pose
    pose.dofs[:] = 7.0 + np.arange(len(pose.dofs))
    before = [
        getattr(pose, name).copy() for name in ("dofs", "translations", "rotations", "scales")
    ]
    hand.step(3)
    found = [getattr(pose, name) for name in ("dofs", "translations", "rotations", "scales")]
    assert all((a == b).all() for a, b in zip(before, found, strict=True))
    assert hand.undo_steps == 1  # the change above
    hand.drag("arm.y", 0.5)
    assert (
        abs(hand.dof("arm.y")) < 0.2 and hand.dof("root.x") == before[0][hand.dof_index("root.x")]
    )


@pytest.fixture
def tooltips(monkeypatch):
    """Tooltip texts in the order in which they were shown."""
    said = []
    show = imgui.set_tooltip
    monkeypatch.setattr(imgui, "set_tooltip", lambda text: (said.append(text), show(text))[1])
    return said


@pytest.fixture
def sliders(monkeypatch):
    """Slider texts by label."""
    shown = {}
    draw = imgui.slider_float

    def record(label, value, low, high, text="%.3f", flags=0):
        shown[label] = text % value
        return draw(label, value, low, high, text, flags)

    monkeypatch.setattr(imgui, "slider_float", record)
    return shown


@pytest.mark.parametrize(
    ("unit", "dof", "said"),
    [
        ("degrees", "root.x", "-57.3\N{DEGREE SIGN} to 57.3\N{DEGREE SIGN}"),
        ("radians", "root.x", "-1.000 rad to 1.000 rad"),
        ("degrees", "root.z", "locked at 17.2\N{DEGREE SIGN}"),
        ("radians", "root.z", "locked at 0.300 rad"),
        ("degrees", "root.y", "28.6\N{DEGREE SIGN} to 114.6\N{DEGREE SIGN}"),
        ("degrees", "arm.x", "unlimited"),
    ],
)
def test_tooltip_shows_limits_in_the_unit_of_the_panel(hand, tooltips, unit, dof, said):
    hand.click(unit)
    hand.move(dof)
    hand.step(1)
    assert tooltips[-1].startswith(f"{dof}\n{said}")


@pytest.mark.parametrize(("unit", "factor"), [("degrees", math.degrees(1.0)), ("radians", 1.0)])
def test_copied_value_equals_the_shown_value(hand, unit, factor):
    hand.click(unit)
    hand.state.actor.pose.dofs[hand.dof_index("arm.x")] = 0.75
    hand.step(2)
    hand.click("arm.x", button=1)
    hand.click("Copy value")
    assert float(imgui.get_clipboard_text()) == pytest.approx(0.75 * factor)


@pytest.mark.parametrize("value", [-0.0, -1e-5])
def test_sliders_show_no_negative_zero(hand, sliders, value):
    row = hand.dof_index("arm.x")
    hand.state.actor.pose.dofs[row] = value
    hand.step(2)
    assert sliders[f"##dof{row}"] == "0.0\N{DEGREE SIGN}"
    assert hand.state.actor.pose.dofs[row] == value  # only the shown value is rounded
    hand.click("radians")
    assert sliders[f"##dof{row}"] == "0.0000 rad"


def test_timeline_and_status_show_no_negative_zero(drive, rig, tmp_path, texts):
    (tmp_path / "wave.anim").write_text(clip_text())
    hand = drive(*rig, tmp_path / "wave.anim", size=SIZE, samples=1)
    hand.state.clock.mode = "run on"
    hand.state.clock.seek(-1e-4)
    texts.clear()
    hand.step(2)
    assert any(text.endswith("0.000 s") for text in texts)
    assert not any("-0.000" in text for text in texts)
    hand.key("i")
    assert hand.says("0.000 s") and not hand.says("-0.000")


def test_joint_translation_shows_no_negative_zero():
    assert shift_text("root", np.array([-0.0, 0.25, -1.0])) == "root   +0 +0.25 -1"


def test_raw_pose_values_have_no_negative_zero(box, texts):
    box.click("Rotation vectors")
    box.state.actor.pose.dofs[:] = -1e-9
    texts.clear()
    box.step(2)
    shown = {text for text in texts if text.startswith("file:")}
    assert shown == {"file: 0.0000  0.0000  0.0000"}


def test_curve_view_is_fitted_again_when_the_unit_changes(curves):
    heights = [_center(curves, f"key arm.x {key}")[1] for key in (0, 1, 2)]
    curves.click("radians")
    curves.step(3)
    again = [_center(curves, f"key arm.x {key}")[1] for key in (0, 1, 2)]
    assert again == pytest.approx(heights, abs=1.5)


def turned_actor():
    """An arm with the shoulder rotated by 90 degrees about z and the elbow by -45 about its z."""
    actor = Actor(arm_figure())
    actor.pose.dofs[2], actor.pose.dofs[3] = np.pi / 2, -np.pi / 4
    return actor


def test_positions_and_axes_match_hand_calculation():
    actor = turned_actor()
    elbow = posed_joint(actor, 1)
    assert_allclose(elbow.center, [0, 1, 0], atol=1e-12)
    assert_allclose(elbow.axes("world"), np.eye(3))
    # The shoulder's x axis points up; the elbow's points 45 degrees to the right of that.
    assert_allclose(elbow.axes("parent")[:, 0], [0, 1, 0], atol=1e-12)
    assert_allclose(elbow.axes("local")[:, 0], np.array([1, 1, 0]) / np.sqrt(2), atol=1e-12)


def test_placement_and_scale_of_the_figure_are_applied():
    actor = turned_actor()
    actor.placement[:3, 3] = 1, 2, 3
    actor.pose.figure_scale = 2.0
    assert_allclose(posed_joint(actor, 1).center, [1, 4, 3], atol=1e-12)
    assert_allclose(posed_joint(actor, 1).axes("local")[:, 2], [0, 0, 1], atol=1e-12)


def test_missing_joint_returns_none():
    actor = turned_actor()
    assert posed_joint(actor, -1) is None and posed_joint(actor, 3) is None
    actor.own_pose = None
    assert posed_joint(actor, 0) is None


PLACEMENTS = {
    "turned": rotation_vector_to_matrix(np.array([0.3, -0.8, 0.5])),
    "mirrored": np.diag([-1.0, 1.0, 1.0]),
    "mirrored along two": np.diag([-1.0, 1.0, -2.0]),
    "point": -np.eye(3),
}


@pytest.mark.parametrize("name", PLACEMENTS)
@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (0.6, 0, 0.8)])
def test_rotation_axis_matches_observed_rotation(name, axis):
    actor = Actor(arm_figure())
    actor.placement[:3, :3] = PLACEMENTS[name]
    joint = posed_joint(actor, 0)
    inside = rotation_vector_to_matrix(1e-6 * np.array(axis, float))
    seen = joint.rotation_axis(np.array(axis, float))
    # No point moves along the axis, and all move around it by the right-hand rule.
    for point in np.eye(3):
        step = PLACEMENTS[name] @ (inside - np.eye(3)) @ np.linalg.solve(PLACEMENTS[name], point)
        assert abs(step @ seen) < 1e-12
        assert np.cross(seen, point) @ step >= -1e-12
    if name != "mirrored along two":  # that placement stretches
        assert_allclose(joint.parent_axis(seen), axis, atol=1e-9)


def test_world_matrices_cover_every_joint():
    actor = turned_actor()
    joint = posed_joint(actor, 2)
    assert joint.world.shape == (3, 4, 4)
    assert_allclose(joint.placement, actor.placement @ placement_matrix(actor.pose))
    local = joint_rotations(joint.skeleton, actor.pose)
    assert_allclose(joint.world[2, :3, :3], local[0] @ local[1] @ local[2], atol=1e-12)


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
