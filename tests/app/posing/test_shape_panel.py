"""The Shape panel: coefficients, random shapes, and hand-calculated measurements of a box body."""

from dataclasses import replace

import numpy as np
import pytest
from app import box_body
from formats.vrm.swinging import swinging
from imgui_bundle import imgui
from numpy.testing import assert_allclose, assert_array_equal

import viewer
from viewer.app.posing.posing import Posing
from viewer.rigs.figure import Figure
from viewer.rigs.inspection.measure import measure
from viewer.rigs.mesh import Mesh
from viewer.rigs.morph_target import MorphTarget, with_morphs
from viewer.rigs.scene import Actor
from viewer.rigs.shape import rest_joints, shaped


@pytest.fixture
def shape(box):
    """A test driver on the Shape panel of the box."""
    box.show_panel("Shape")
    return box


def _weights(hand):
    return hand.state.actor.pose.shape_weights


def _rest(hand):
    return shaped(hand.state.actor.figure, _weights(hand))


def _coefficients(hand):
    return [label for label in hand.state.item_rects if label.startswith("coefficient ")]


def _drag(hand, index, fraction):
    """Drag the slider of a coefficient to a fraction of its length."""
    hand.drag(f"coefficient {index}", fraction)


def test_slider_covers_five_standard_deviations(shape):
    for fraction, wanted in ((0.0, -5), (0.3, -2), (1.0, 5), (1.4, 5)):
        _drag(shape, 0, fraction)
        assert _weights(shape)[0] == pytest.approx(wanted, abs=0.1)
        assert _weights(shape)[1] == 0.0


def test_drawing_changes_no_weights_and_sliders_add_missing_ones(shape):
    shape.state.actor.pose.shape_weights = np.zeros(0)
    shape.step(3)
    assert len(_weights(shape)) == 0
    _drag(shape, 1, 1.0)
    assert _weights(shape).tolist() == pytest.approx([0.0, 5.0], abs=0.1)


def test_joints_follow_the_shape(shape):
    # The middles of the sides are 0.25 m from the centre, and 20 % more per sigma of the girth.
    assert_allclose(rest_joints(_rest(shape))[:, 0], [0, 0.25, -0.25], atol=1e-12)
    shape.enter_value("coefficient 1", "2.5")
    assert_allclose(rest_joints(_rest(shape))[:, 0], [0, 0.375, -0.375], atol=1e-12)
    assert_allclose(rest_joints(_rest(shape))[:, 1:], 0, atol=1e-12)


@pytest.mark.parametrize("text", ["7.5", "-12"])
def test_typed_value_may_exceed_five_standard_deviations(shape, text):
    shape.enter_value("coefficient 0", text)
    assert _weights(shape).tolist() == [float(text), 0]
    shape.step(3)
    assert _weights(shape).tolist() == [float(text), 0] and shape.undo_steps == 1


def test_invalid_input_leaves_a_drawable_shape(shape):
    for text in ("nan", "inf", "-inf", "1e39", "1e7", "", "abc"):
        shape.enter_value("coefficient 0", text)
        assert np.isfinite(_weights(shape)).all() and np.abs(_weights(shape)).max() < 1e6
        shape.assert_sane()
    assert shape.scene_picture().any()


def test_double_click_resets_one_coefficient(shape):
    shape.enter_value("coefficient 0", "3")
    shape.enter_value("coefficient 1", "2")
    shape.double_click(shape.place("coefficient 0", 0.3))
    assert _weights(shape).tolist() == [0, 2]


def test_drag_is_one_undo_step(shape):
    first = shape.scene_picture()
    _drag(shape, 0, 0.9)
    shape.step(2)
    changed, picture = _weights(shape).copy(), shape.scene_picture()
    assert shape.undo_steps == 1 and (picture != first).any()
    shape.key("z", "ctrl")
    shape.step(2)
    assert _weights(shape).tolist() == [0, 0]
    assert_array_equal(shape.scene_picture(), first)
    shape.key("z", "ctrl shift")
    shape.step(2)
    assert_array_equal(_weights(shape), changed)
    assert_array_equal(shape.scene_picture(), picture)


def test_random_shape_is_determined_by_the_shown_seed(shape):
    shape.click("Random")
    assert shape.state.of(Posing).shape_seed == 1
    first = _weights(shape).copy()
    # The coefficients can be reproduced from the seed.
    assert_array_equal(first, np.random.default_rng(1).standard_normal(2))
    shape.click("Random")
    assert shape.state.of(Posing).shape_seed == 2 and (_weights(shape) != first).all()
    assert shape.undo_steps == 2 and shape.says("seed 2")


def _type_seed(hand, text):
    hand.click(hand.place("seed", 0.05))
    hand.key("a", "ctrl")
    hand.type(text)
    hand.key("enter")
    hand.step(2)


def test_equal_seeds_result_in_equal_shapes(shape):
    for _ in range(3):
        shape.click("Random")
    _type_seed(shape, "1")
    assert shape.state.of(Posing).shape_seed == 1
    assert_array_equal(_weights(shape), np.random.default_rng(1).standard_normal(2))


def test_invalid_seeds_are_clamped(shape):
    shape.click("Random")
    for text, seed in (("-7", 0), ("2147483647", 2**31 - 1), ("x", 2**31 - 1)):
        _type_seed(shape, text)
        assert shape.state.of(Posing).shape_seed == seed
        assert np.isfinite(_weights(shape)).all()


def test_random_shape_changes_the_first_ten_coefficients_and_no_expression(drive_body):
    hand = drive_body("smplx", n_shapes=10, n_expressions=5)
    hand.show_panel("Shape")
    hand.click("Random")
    assert (_weights(hand)[:10] != 0).all() and (_weights(hand)[10:] == 0).all()


def test_reset_shape_sets_all_coefficients_to_0_and_keeps_the_pose(shape):
    shape.click("Random")
    shape.state.actor.pose.dofs[3] = 0.5
    shape.step(2)
    shape.click("Reset shape")
    assert _weights(shape).tolist() == [0, 0]
    assert shape.state.actor.pose.dofs[3] == 0.5
    shape.key("z", "ctrl")
    assert (_weights(shape) != 0).all()


def test_reset_of_the_pose_keeps_the_shape(shape):
    shape.enter_value("coefficient 0", "2")
    shape.state.actor.pose.dofs[3] = 0.5
    shape.step(2)
    shape.key("r")
    assert _weights(shape).tolist() == [2, 0]
    assert not shape.state.actor.pose.dofs.any()


def test_pose_correctives_change_only_the_image_of_a_bent_body(shape):
    straight = shape.scene_picture()
    shape.click("Pose correctives")
    shape.step(2)
    assert not shape.state.options.skinning.correctives
    assert_array_equal(shape.scene_picture(), straight)
    shape.state.actor.pose.dofs[shape.dof_index("joint_1.x")] = 1.2
    shape.step(2)
    plain = shape.scene_picture()
    shape.click("Pose correctives")
    shape.step(2)
    assert (shape.scene_picture() != plain).any()
    shape.key("z", "ctrl")
    shape.step(2)
    assert_array_equal(shape.scene_picture(), plain)


def _said(hand, texts):
    texts.clear()
    hand.step()
    return {name: texts[texts.index(name) + 1] for name in ("Height", "Volume", "Mass")}


def test_measurements_show_the_box_dimensions(shape, texts):
    # A box of 0.5 x 2 x 0.25 m has 250 litres and weighs 246.25 kg.
    assert _said(shape, texts) == {
        "Height": "2.000 m",
        "Volume": "250.0 litres",
        "Mass": "246.2 kg at 985 kg/m\N{SUPERSCRIPT THREE}",
    }
    shape.enter_value("coefficient 0", "1")
    shape.enter_value("coefficient 1", "1")
    # 10 % taller and 20 % wider: 0.25 x 1.1 x 1.2 = 0.33 cubic metres, 325.05 kg.
    found = measure(_rest(shape))
    assert found.height == pytest.approx(2.2, abs=1e-12)
    assert found.volume == pytest.approx(0.33, abs=1e-12)
    assert found.mass == pytest.approx(325.05, abs=1e-9)
    said = _said(shape, texts)
    assert (said["Height"], said["Volume"]) == ("2.200 m", "330.0 litres")


def test_open_mesh_has_no_volume(shape, texts):
    figure = shape.state.actor.figure
    mesh = Mesh(figure.mesh.positions, figure.mesh.normals, figure.mesh.triangles[2:])
    shape.state.actor.figure = replace(figure, mesh=mesh)
    texts.clear()
    shape.step()
    # The two triangles of one side are missing; its outline has four edges.
    assert "none: open mesh (4 boundary edges)" in texts and "Mass" not in texts
    # The text is wrapped: at the edge of the panel, where the view begins, it would be cut off.
    assert shape.state.item_rects["measured Volume"][2] <= shape.state.view_rect[0]


def test_mesh_with_doubled_vertices_is_still_closed(shape):
    figure = shape.state.actor.figure
    positions = figure.mesh.positions[figure.mesh.triangles].reshape(-1, 3)
    triangles = np.arange(len(positions)).reshape(-1, 3)
    found = measure(Figure("box", Mesh(positions, positions, triangles), unit="m"))
    assert (found.n_open_edges, found.mass) == (0, pytest.approx(246.25, abs=1e-9))


def test_measurements_are_those_of_the_rest_pose(shape, texts):
    before = _said(shape, texts)
    shape.state.actor.pose.dofs[:] = 0.7
    shape.state.actor.pose.figure_scale = 2.0
    assert _said(shape, texts) == before


@pytest.mark.parametrize("kind", ["smplx", "flame"])
def test_expressions_have_a_separate_group(drive_body, texts, kind):
    hand = drive_body(kind, n_shapes=10, n_expressions=4)
    hand.show_panel("Shape")
    texts.clear()
    hand.step()
    assert {"Shape", "Expression"} <= set(texts)
    assert len(_coefficients(hand)) == 14
    hand.enter_value("coefficient 12", "1.5")
    assert np.flatnonzero(_weights(hand)).tolist() == [12]


@pytest.mark.parametrize("kind", ["smpl", "smplh", "mano"])
def test_models_without_a_face_have_no_expressions(drive_body, texts, kind):
    hand = drive_body(kind)
    hand.show_panel("Shape")
    texts.clear()
    hand.step()
    assert "Shape" in texts and "Expression" not in texts


def test_only_visible_rows_of_hundreds_of_coefficients_are_drawn(drive_body):
    hand = drive_body("smplx", n_shapes=300, n_expressions=100, size=(1000, 640))
    hand.show_panel("Shape")
    assert hand.state.actor.figure.n_shapes == 400
    assert 10 < len(_coefficients(hand)) < 40
    hand.wheel(-400, "coefficient 5")
    hand.step(3)
    assert "coefficient 399" in _coefficients(hand) and len(_coefficients(hand)) < 40
    hand.enter_value("coefficient 398", "2")
    assert np.flatnonzero(_weights(hand)).tolist() == [398]


def test_names_from_files_are_shown_verbatim(drive, tmp_path):
    path = tmp_path / "named.npz"
    np.savez(path, **box_body.arrays(), shape_names=np.array(["tall##x", "100%s\n"]))
    hand = drive(path, size=(1000, 1000), samples=1)
    hand.show_panel("Shape")
    hand.enter_value("coefficient 0", "1")
    hand.enter_value("coefficient 1", "2")
    assert _weights(hand).tolist() == [1, 2]


def _is_absent(title):
    window = imgui.internal.find_window_by_name(title)
    return window is None or not window.active


@pytest.mark.parametrize("n_files", [0, 1, 2], ids=["fox", "skeleton", "rig"])
def test_figures_without_blend_shapes_have_no_shape_panel(drive, rig, n_files):
    hand = drive(*rig[:n_files])
    assert hand.state.actor.figure.blend_shapes is None
    assert _is_absent("Shape") and not _coefficients(hand)


def test_shape_panel_appears_and_disappears_with_the_figure(shape, rig):
    assert not _is_absent("Shape")
    shape.open(*rig)
    assert _is_absent("Shape")


@pytest.fixture
def morphed(drive, rig):
    """The tiny rig with two morphs, one that lifts a vertex and one that spreads all."""
    scene = viewer.load(*rig)
    figure = scene.actors[0].figure
    mesh = figure.mesh
    lifted = mesh.positions[:1] + np.array([0.0, 1.0, 0.0])
    targets = [
        MorphTarget("lift", [0], lifted, mesh.normals[:1]),
        MorphTarget("spread", np.arange(mesh.n_vertices), 2.0 * mesh.positions, mesh.normals),
    ]
    scene.actors[0] = Actor(with_morphs(figure, targets))
    hand = drive(scene=scene, size=(1000, 1000), samples=1)
    hand.show_panel("Shape")
    return hand


def test_morphs_have_named_sliders_from_0_to_1(morphed, texts):
    texts.clear()
    morphed.step()
    assert "Morphs" in texts and "Shape" not in texts
    assert not {"Random", "seed"} & set(morphed.state.item_rects)
    for fraction in (0.25, 1.0, 1.3):
        _drag(morphed, 0, fraction)
        assert _weights(morphed)[0] == pytest.approx(min(fraction, 1.0), abs=0.02)
    assert morphed.undo_steps == 2  # the value stops at the end of the slider
    height = _rest(morphed).mesh.positions[0] - morphed.state.actor.figure.mesh.positions[0]
    assert_allclose(height, [0, 1, 0], atol=1e-6)


def test_typed_morph_weight_is_unlimited_and_resets(morphed):
    before = morphed.scene_picture()
    morphed.enter_value("coefficient 1", "-1.5")
    assert _weights(morphed).tolist() == [0, -1.5]
    assert (morphed.scene_picture() != before).any()
    morphed.click("Reset shape")
    assert _weights(morphed).tolist() == [0, 0]


def test_reset_restores_the_weights_of_the_file(morphed):
    figure = morphed.state.actor.figure
    shapes = replace(figure.blend_shapes, rest_weights=np.array([0.25, 0.0]))
    morphed.state.actor.figure = replace(figure, blend_shapes=shapes)
    _weights(morphed)[:] = 0.5, 0.75
    morphed.step(2)
    morphed.key("r")
    assert _weights(morphed).tolist() == [0.25, 0.0]
    _weights(morphed)[:] = 0.5, 0.75
    morphed.step(2)
    morphed.double_click("coefficient 0")
    assert _weights(morphed).tolist() == [0.25, 0.75]


def _with_ranges(hand):
    """Give the box two phenotypes with mean 0.5, one of them with a lower minimum."""
    figure = hand.state.actor.figure
    ranged = replace(
        figure.blend_shapes,
        origins=np.array([0.5, 0.0]),
        ranges=np.array([[-0.25, 1.0], [0.0, 2.0]]),
    )
    hand.state.actor.figure = replace(figure, blend_shapes=ranged)


def test_sliders_with_ranges_show_values_in_their_range(shape):
    _with_ranges(shape)
    shape.step(2)
    _drag(shape, 0, 1.4)
    assert _weights(shape)[0] == pytest.approx(0.5, abs=1e-6)  # shown as 1
    shape.enter_value("coefficient 0", "0.75")
    assert _weights(shape)[0] == pytest.approx(0.25, abs=1e-6)
    _drag(shape, 1, 0.0)
    assert _weights(shape)[1] == pytest.approx(0.0, abs=1e-6)


def test_random_shapes_stay_within_their_ranges(shape):
    _with_ranges(shape)
    for _ in range(5):
        shape.click("Random")
        shape.step()
        shown = _weights(shape) + shape.state.actor.figure.blend_shapes.origins
        assert -0.25 <= shown[0] <= 1.0 and 0.0 <= shown[1] <= 2.0


def test_long_lists_of_shapes_are_filtered_by_name(shape):
    figure = shape.state.actor.figure
    count = figure.mesh.n_vertices
    names = (*(f"jaw {k}" for k in range(50)), *(f"Brow {k}" for k in range(50)))
    shapes = viewer.BlendShapes(names, np.zeros((100, count, 3)))
    shape.state.actor.figure = replace(figure, blend_shapes=shapes, joint_regressor=None)
    shape.state.of(Posing).shape_filter = "brow 4"
    shape.state.item_rects.clear()
    shape.step(2)
    assert _coefficients(shape) == [f"coefficient {k}" for k in (54, *range(90, 100))]


def test_expression_slider_changes_materials_in_the_image(drive, tmp_path):
    path = tmp_path / "ada.vrm"
    path.write_bytes(swinging(turn=False).glb())
    hand = drive(path, size=(1000, 700), samples=1)
    hand.show_panel("Shape")
    row = hand.state.actor.figure.blend_shapes.names.index("angry")

    def red_pixels():
        hand.step(3)
        red, green, blue = hand.scene_picture()[..., :3].astype(int).transpose(2, 0, 1)
        return int(((red > 150) & (green < 40) & (blue < 40)).sum())

    assert red_pixels() == 0
    hand.enter_value(f"coefficient {row}", "1")
    assert hand.state.actor.pose.shape_weights[row] == 1.0
    shown = red_pixels()  # the hat, which was blue before
    assert shown > 20
    hand.enter_value(f"coefficient {row}", "0")
    assert red_pixels() == 0
    hand.key("z", "ctrl")
    assert red_pixels() == shown
