"""Ball joints of body models: rotation vectors, raw pose values and placement."""

import math

import numpy as np
import pytest
from builders import axis_turn, rotation
from formats.pig_text import write as write_pig
from numpy.testing import assert_allclose

from viewer.app.posing.posing import Posing


def euler(x, y, z):
    return axis_turn(2, z) @ axis_turn(1, y) @ axis_turn(0, x)


def _rotation(hand, joint):
    """Return a joint's rotation by its DOFs; its remaining transforms must be those of the file."""
    return euler(*(hand.dof(f"{joint}.{axis}") for axis in "xyz"))


def _enter_vector(hand, joint, *degrees):
    for axis, value in zip("xyz", degrees, strict=True):
        hand.enter_value(f"{joint}.r{axis}", str(value))


@pytest.fixture
def vectors(box):
    """A test driver on the box, with joints edited as rotation vectors."""
    box.click("Rotation vectors")
    assert box.state.of(Posing).as_vectors
    return box


def test_check_box_swaps_the_sliders_without_changing_dofs(box):
    labels = {f"joint_1.{axis}" for axis in "xyz"}
    assert labels <= set(box.state.item_rects)
    box.click("Rotation vectors")
    assert not labels & set(box.state.item_rects)
    assert {f"joint_1.r{axis}" for axis in "xyz"} <= set(box.state.item_rects)
    assert not box.dofs().any() and box.undo_steps == 0


TURNS = ((60, 45, -30), (0, 90, 0), (-120, 10, 20), (179, 1, 0), (0, 0, 200), (360, 0, 0))


def test_typed_vector_rotates_the_joint_by_rodrigues_formula(vectors):
    for degrees in TURNS:
        vectors.key("r")
        _enter_vector(vectors, "joint_1", *degrees)
        assert_allclose(_rotation(vectors, "joint_1"), rotation(np.radians(degrees)), atol=1e-12)
        assert not vectors.dofs()[[*range(3), *range(6, 9)]].any()


def test_dragged_component_rotates_about_its_axis(vectors):
    for axis in range(3):
        vectors.drag(f"joint_1.r{'xyz'[axis]}", 0.75)
        vector = np.zeros(3)
        vector[axis] = math.pi / 2
        assert_allclose(_rotation(vectors, "joint_1"), rotation(vector), atol=0.06)
        assert vectors.undo_steps == 1
        vectors.key("z", "ctrl")
        assert not vectors.dofs().any()


def test_drag_passes_180_degrees_without_a_jump(vectors):
    vectors.enter_value("joint_1.rx", "150")
    x0, y0, x1, y1 = vectors.state.item_rects["joint_1.ry"]
    y = (y0 + y1) / 2
    vectors.move(((x0 + x1) / 2, y))
    vectors.press()
    lengths, before = [], rotation((math.radians(150), 0, 0))
    for share in np.linspace(0.5, 1.0, 25):
        vectors.move((x0 + share * (x1 - x0), y))
        vectors.step()
        vector, found = vectors.state.of(Posing).held_vector.vector, _rotation(vectors, "joint_1")
        assert vector[0] == pytest.approx(math.radians(150), abs=1e-12) and vector[2] == 0
        assert_allclose(found, rotation(vector), atol=1e-12)
        assert np.abs(found - before).max() < 0.3
        lengths.append(np.linalg.norm(vector))
        before = found
    vectors.let_go()
    assert lengths[0] < math.pi < lengths[-1] and lengths == sorted(lengths)
    vectors.step(3)
    assert np.linalg.norm(vectors.state.of(Posing).held_vector.vector) == lengths[-1]


@pytest.mark.parametrize("key", ["undo", "reset"])
def test_shown_vector_is_discarded_when_another_pose_is_restored(vectors, key):
    vectors.enter_value("joint_1.rz", "270")
    vectors.key("z", "ctrl") if key == "undo" else vectors.key("r")
    vectors.step(2)
    assert vectors.state.of(Posing).held_vector is None
    vectors.enter_value("joint_1.ry", "30")
    wanted = rotation((0, math.radians(30), 0))
    assert_allclose(_rotation(vectors, "joint_1"), wanted, atol=1e-12)


def test_double_click_sets_a_component_to_0(vectors):
    _enter_vector(vectors, "joint_1", 20, 40, 0)
    vectors.double_click(vectors.place("joint_1.rx", 0.3))
    assert_allclose(_rotation(vectors, "joint_1"), rotation((0, math.radians(40), 0)), atol=1e-12)


def test_vectors_are_typed_in_the_chosen_unit(vectors):
    vectors.click("radians")
    vectors.enter_value("joint_1.ry", "1.5")
    assert vectors.dof("joint_1.y") == pytest.approx(1.5, abs=1e-7)


def test_invalid_typed_value_leaves_a_valid_rotation(vectors):
    for text in ("nan", "inf", "1e39", "-1e300", "", "abc"):
        vectors.enter_value("joint_1.rx", text)
        vectors.assert_sane()
    assert vectors.scene_picture().any()


def _own(hand, texts):
    texts.clear()
    hand.step()
    return [text for text in texts if text.startswith("file:")]


def test_raw_pose_values_are_rotation_vectors(box, texts):
    assert _own(box, texts) == ["file: 0.0000  0.0000  0.0000"] * 3
    # 90 degrees about x, then z: 120 degrees about the diagonal, 2 pi / 3 / sqrt 3 per axis.
    box.enter_value("joint_1.x", "90")
    box.enter_value("joint_1.z", "90")
    box.enter_value("joint_2.y", "-30")
    assert _own(box, texts)[1:] == [
        "file: 1.2092  1.2092  1.2092",
        "file: 0.0000  -0.5236  0.0000",
    ]


def test_raw_pose_values_of_an_euler_root_are_z_y_x_angles(drive, tmp_path, texts):
    hand = drive(write_pig(tmp_path / "pig"), size=(1000, 1000), samples=1)
    root, other = hand.state.actor.figure.skeleton.names[:2]
    for joint in (root, other):
        for axis, degrees in zip("xyz", ("10", "20", "30"), strict=True):
            hand.enter_value(f"{joint}.{axis}", degrees)
    first, second = _own(hand, texts)[:2]
    assert first == "file: 0.5236  0.3491  0.1745"
    numbers = [float(word) for word in second.split()[1:]]
    assert_allclose(rotation(numbers), euler(*np.radians([10, 20, 30])), atol=2e-4)


def test_rigs_without_a_pose_layout_have_angles_only(hand, texts):
    assert "Rotation vectors" not in hand.state.item_rects
    assert not _own(hand, texts)
    assert "arm.x" in hand.state.item_rects


def test_vectors_are_discarded_when_the_body_is_removed(vectors, rig):
    vectors.open(*rig)
    vectors.step(2)
    assert "arm.x" in vectors.state.item_rects and "arm.rx" not in vectors.state.item_rects


def test_figure_sliders_move_and_scale_the_figure(box):
    first, pose = box.scene_picture(), box.state.actor.pose
    size = math.sqrt(0.5**2 + 2.0**2 + 0.25**2)
    for axis, name in enumerate("xyz"):
        box.drag(f"figure.t{name}", 0.75)
        assert pose.figure_translation[axis] == pytest.approx(size / 2, abs=0.05 * size)
    box.enter_value("figure.scale", "1.5")
    assert pose.figure_scale == 1.5 and box.undo_steps == 4
    assert (box.scene_picture() != first).any()
    box.double_click(box.place("figure.scale", 0.3))
    box.double_click(box.place("figure.tx", 0.2))
    pose = box.state.actor.pose
    assert pose.figure_scale == 1.0
    assert pose.figure_translation[0] == 0.0 and pose.figure_translation[1] > 0


def test_typed_scale_stays_positive(box):
    for text in ("0", "-2", "nan", "1e39", "inf", "1e-40", ""):
        box.enter_value("figure.scale", text)
        box.enter_value("figure.ty", text)
        pose = box.state.actor.pose
        assert 0 < pose.figure_scale < 1e9
        assert np.isfinite(pose.figure_translation).all()
    assert box.scene_picture().any()


def test_figure_sliders_start_collapsed_for_rigs(hand):
    assert "figure" in hand.state.item_rects and "figure.tx" not in hand.state.item_rects
    hand.click(hand.place("figure", 0.02))
    hand.enter_value("figure.ty", "0.25")
    assert hand.state.actor.pose.figure_translation.tolist() == [0, 0.25, 0]


def test_r_key_resets_pose_and_placement_and_keeps_the_shape(vectors):
    _enter_vector(vectors, "joint_1", 30, 60, 0)
    vectors.enter_value("figure.tx", "0.5")
    vectors.enter_value("figure.scale", "2")
    vectors.state.actor.pose.shape_weights[:] = 1.0, -2.0
    vectors.step(2)
    vectors.key("r")
    pose = vectors.state.actor.pose
    assert not pose.dofs.any() and not pose.figure_translation.any() and pose.figure_scale == 1
    assert pose.shape_weights.tolist() == [1, -2]
    vectors.key("z", "ctrl")
    assert vectors.state.actor.pose.figure_scale == 2


def test_m_key_mirrors_the_pose(vectors):
    _enter_vector(vectors, "joint_0", 10, 20, 30)
    _enter_vector(vectors, "joint_1", 40, -50, 60)
    _enter_vector(vectors, "joint_2", -70, 0, 5)
    vectors.enter_value("figure.tx", "0.5")
    before, steps = vectors.dofs(), vectors.undo_steps
    vectors.key("m")
    # Mirrored across x, a rotation vector keeps its x and negates its y and z.
    for joint, degrees in (("0", (10, -20, -30)), ("1", (-70, 0, -5)), ("2", (40, 50, -60))):
        wanted = rotation(np.radians(degrees))
        assert_allclose(_rotation(vectors, f"joint_{joint}"), wanted, atol=1e-12)
    assert vectors.state.actor.pose.figure_translation.tolist() == [-0.5, 0, 0]
    assert vectors.undo_steps == steps + 1 and vectors.says("Pose mirrored")
    vectors.key("m")
    assert_allclose(vectors.dofs(), before, atol=1e-12)


def test_m_key_reports_asymmetry_and_keeps_the_pose(drive, tmp_path):
    path = tmp_path / "lame.skel"
    path.write_text("balljoint hip { offset 0 0 0 balljoint left_leg { offset 1 -1 0 } }")
    hand = drive(path)
    hand.state.actor.pose.dofs[:] = 0.3
    before = hand.dofs()
    hand.key("m")
    assert (hand.dofs() == before).all()
    assert hand.says("the skeleton is not symmetric")
