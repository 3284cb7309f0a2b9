"""The Vertex panel: the skinning terms of a pinned vertex, its lines in the view, and unpinning."""

from dataclasses import replace

import numpy as np
import pytest
from imgui_bundle import imgui
from numpy.testing import assert_allclose

from viewer.app.layout import ShownPanels
from viewer.app.weights.vertex_panel import influence_colors, matrix_text, vertex_annotation
from viewer.app.weights.weights_panel import Weights, pin_vertex
from viewer.rendering.projection import project
from viewer.rendering.view import view_of
from viewer.rigs.inspection.explanation import explain, explanation_text
from viewer.rigs.skinning import Skinning, deform, joint_matrices


@pytest.fixture
def pinned(drive, rig):
    """A driver on a column with vertex 4 pinned, which has equal weights for root and arm."""
    hand = drive(*rig, size=(1280, 1000), pixels_per_point=0.5)
    hand.state.actor.pose.dofs[hand.dof_index("arm.z")] = 0.9
    hand.state.history.start(hand.state.update_version(), hand.state.clock.time)
    pin_vertex(hand.state, 0, 4)
    hand.step(4)
    return hand


@pytest.fixture
def clipboard(monkeypatch):
    copied = []
    monkeypatch.setattr(imgui, "set_clipboard_text", copied.append)
    return copied


def palette(hand):
    """Return the skinning matrices: M_j = W_j B_j^-1."""
    actor = hand.state.actor
    return joint_matrices(actor.figure, actor.pose) @ actor.figure.skin.inverse_bind


def said(hand, texts):
    texts.clear()
    hand.step()
    return list(texts)


def rows_of(numbers):
    return [f"{number:.4f}" for number in np.asarray(numbers).tolist()]


def holds(listed, wanted):
    """Return whether the labels occur consecutively."""
    count = len(wanted)
    return any(listed[at : at + count] == wanted for at in range(len(listed) - count + 1))


def test_panel_shows_every_skinning_step(pinned, texts):
    listed = said(pinned, texts)
    actor = pinned.state.actor
    p = actor.figure.mesh.positions[4]
    assert holds(listed, ["p", *rows_of(p)])
    terms = []
    for number, matrix in enumerate(palette(pinned), 1):
        assert holds(listed, rows_of(matrix.ravel()))
        image = matrix[:3, :3] @ p + matrix[:3, 3]
        terms.append(0.5 * image)
        assert holds(listed, [f"M{number} p", *rows_of(image)])
        assert holds(listed, [f"w{number} M{number} p", *rows_of(terms[-1])])
        assert f"influence {number}" in pinned.state.item_rects
    assert holds(listed, ["sum w", "1.0000", "sum w M p", *rows_of(terms[0] + terms[1])])
    position = deform(actor.figure, actor.pose, Skinning())[0][4]
    assert_allclose(terms[0] + terms[1], position, atol=1e-12)
    assert holds(listed, ["position", *rows_of(position)])


def test_numbers_follow_the_pose(pinned, texts):
    before = said(pinned, texts)
    pinned.state.actor.pose.dofs[pinned.dof_index("arm.x")] += 0.5
    pinned.step()
    after = said(pinned, texts)
    position = deform(pinned.state.actor.figure, pinned.state.actor.pose, Skinning())[0][4]
    assert not holds(before, ["position", *rows_of(position)])
    assert holds(after, ["position", *rows_of(position)])


@pytest.mark.parametrize("method", ["dqs", "mix"])
def test_dual_quaternions_are_shown_if_they_are_used(pinned, texts, method):
    assert not any(text.startswith("q1:") for text in said(pinned, texts))
    pinned.state.options.skinning.method = method
    pinned.step()
    listed = said(pinned, texts)
    assert "q1: normalised weight 0.5000" in listed and "q2: normalised weight 0.5000" in listed
    actor = pinned.state.actor
    position = deform(actor.figure, actor.pose, pinned.state.options.skinning)[0][4]
    assert holds(listed, ["position", *rows_of(position)])
    assert ("0.50 of the way from LBS to DQS" in listed) == (method == "mix")


def test_figure_placement_is_a_skinning_step(pinned, texts):
    pinned.state.actor.pose.figure_translation[:] = 1.0, 2.0, 3.0
    pinned.state.actor.pose.figure_scale = 2.0
    pinned.step()
    listed = said(pinned, texts)
    assert holds(listed, ["scale", "2.0000", "translation", "1.0000", "2.0000", "3.0000"])


def test_text_is_copied_in_full(pinned, clipboard):
    pinned.click("Copy as text")
    actor = pinned.state.actor
    wanted = explanation_text(explain(actor.figure, actor.pose, Skinning(), 4), 6)
    assert clipboard == ["\n".join(wanted)]
    assert pinned.says("Explanation copied")


def test_matrix_is_copied_with_all_digits(pinned, clipboard):
    pinned.click("Copy M2")
    rows = [list(map(float, line.split())) for line in clipboard[0].splitlines()]
    explanation = pinned.state.of(Weights).explanation
    np.testing.assert_array_equal(rows, explanation.matrices[1])
    assert_allclose(rows, palette(pinned)[explanation.joints[1]], atol=1e-15)


def test_matrix_text_has_one_row_per_line():
    assert matrix_text(np.array([[0.1, -2.0], [1e-17, 3.0]])) == "0.1 -2.0\n1e-17 3.0"


def test_click_on_an_influence_selects_its_joint(pinned):
    pinned.click(pinned.place("influence 2", 0.5))
    assert pinned.state.selected_joint == pinned.state.of(Weights).explanation.joints[1]


def test_lines_lead_to_the_rigid_images(pinned):
    with_lines = pinned.screen()
    pinned.click("Lines")
    pinned.move(pinned.place("Lines"))
    without = pinned.screen()
    assert (with_lines != without)[:, 310:900].any()
    pinned.state.options.show = "binding"
    assert pinned.state.of(Weights).pinned is not None
    pinned.step(2)


def beside(hand, picture, weight_place):
    """Return the pixels around a point between the vertex and its first rigid image."""
    size = picture.shape[1], picture.shape[0]
    explanation = hand.state.of(Weights).explanation
    start, end = explanation.position, explanation.images[0]
    point = start + weight_place * (end - start)
    view = view_of(hand.state.camera, size, hand.state.box)
    x, y = np.rint(project(view, size, point[None]).pixels[0]).astype(int)
    return picture[y - 2 : y + 3, x - 2 : x + 3, :3].astype(int)


def test_screenshot_includes_the_lines_while_they_are_shown(pinned):
    shown = pinned.scene_picture()
    explanation = pinned.state.of(Weights).explanation
    skeleton = pinned.state.actor.figure.skeleton
    color = 255 * influence_colors(explanation, skeleton)[0]
    # The middle of the line has the colour of its joint, and its end is a white dot.
    apart = np.abs(beside(pinned, shown, 0.5) - color).max(axis=-1)
    assert apart.min() < 90
    assert beside(pinned, shown, 0.0).min(axis=-1).max() > 240
    pinned.click("Lines")
    pinned.step(2)
    without = pinned.scene_picture()
    assert (beside(pinned, without, 0.5) != beside(pinned, shown, 0.5)).any()
    assert beside(pinned, without, 0.0).min(axis=-1).max() > 240
    pinned.click("Unpin")
    pinned.step(2)
    assert (pinned.scene_picture() != without).any()


def test_annotation_is_rebuilt_only_after_a_change(pinned):
    before = pinned.state.of(Weights).annotations
    pinned.step(3)
    assert pinned.state.of(Weights).annotations is before
    pinned.state.actor.pose.dofs[pinned.dof_index("arm.z")] = 0.5
    pinned.step(2)
    after = pinned.state.of(Weights).annotations
    assert after is not before
    pinned.state.actor.visible = False
    pinned.step(2)
    assert pinned.app.frame.renderer.annotations == ()


def test_every_influence_has_a_line_and_dot_and_label(pinned):
    explanation, actor = pinned.state.of(Weights).explanation, pinned.state.actor
    actor.placement[:3, 3] = 10.0, 0.0, 0.0
    found = vertex_annotation(explanation, actor, True, (960, 720))  # scale 1
    assert found.style.on_top
    # The weakest influence is first: dark line, line, dark dot, dot. The vertex is last, dark and
    # white.
    shift = np.array([10.0, 0, 0])
    starts, ends = found.segments.starts - shift, found.segments.ends - shift
    weak, strong = explanation.images[1], explanation.images[0]
    vertex = explanation.position
    assert_allclose(
        starts, [vertex, vertex, weak, weak, vertex, vertex, strong, strong, vertex, vertex]
    )
    assert_allclose(ends, [weak] * 4 + [strong] * 4 + [vertex] * 2)
    # Both weights are 0.5, so the widths are 1 + 4 / 2 pixels.
    assert_allclose(explanation.weights, 0.5)
    assert_allclose(found.segments.widths, [5, 3, 11, 8, 5, 3, 11, 8, 12, 8])
    assert_allclose(found.segments.colors[[1, 5], 3], 0.35 + 0.65 * 0.5)
    assert found.labels.texts == tuple(f"{name}  0.500" for name in explanation.names)
    assert_allclose(found.labels.points - shift, explanation.images)
    assert found.labels.ranks.tolist() == [1, 2]  # the name of the selected joint is first
    alone = vertex_annotation(explanation, actor, False, (960, 720))
    assert alone.labels is None and len(alone.segments.widths) == 2


@pytest.mark.parametrize("way", ["Esc", "Unpin", "menu", "panel"])
def test_vertex_can_be_unpinned(pinned, way):
    pinned.state.selected_joint = 1
    if way == "Esc":
        pinned.key("escape")
        assert pinned.says("Vertex unpinned")
        assert pinned.state.selected_joint == 1  # the next Escape clears the selection
    elif way == "Unpin":
        pinned.click("Unpin")
    elif way == "menu":
        pinned.menu("menu View", "Unpin vertex")
    else:
        pinned.menu("menu Window", "Vertex")
    pinned.step(2)
    assert pinned.state.of(Weights).pinned is None
    assert "vertex" not in pinned.state.of(ShownPanels).opened


def test_pin_is_removed_with_its_figure(pinned, rig):
    pinned.open(*rig)
    pinned.step(2)
    assert pinned.state.of(Weights).pinned is None and not pinned.state.error


def test_panel_without_a_vertex_explains_how_to_pick_one(hand, texts):
    hand.menu("menu Window", "Vertex")
    hand.step(2)
    assert "Alt+click a vertex to explain its position here." in said(hand, texts)
    hand.click("Pick vertices without Alt")
    assert hand.state.of(Weights).picks_vertices


def test_figure_without_a_skin_shows_a_message(drive, rig):
    hand = drive(rig[1])
    pin_vertex(hand.state, 0, 3)
    assert hand.state.of(Weights).pinned is None
    assert hand.says("no influences to explain")


def test_vertex_without_influence_shows_a_message(drive, rig, texts):
    text = rig[1].read_text().replace("1 1 1\n", "0\n", 1)
    rig[1].write_text(text)
    hand = drive(*rig, samples=1)
    pin_vertex(hand.state, 0, 8)
    hand.step(4)
    assert "No influence: the vertex stays at its bind position." in said(hand, texts)


def test_pinning_is_not_an_undo_step(pinned):
    assert pinned.undo_steps == 0


@pytest.mark.parametrize(("width", "digits"), [(480, 4), (960, 3), (1100, 4), (1280, 4)])
def test_panel_needs_no_horizontal_scrolling(drive, rig, texts, width, digits):
    hand = drive(*rig, size=(width, 640), samples=1)
    pin_vertex(hand.state, 0, 4)
    hand.step(6)
    windows = imgui.get_current_context().windows
    inner = next(one for one in windows if one.name.startswith("Vertex/numbers"))
    assert inner.scroll_max.x == 0.0 and inner.content_size.x > 100.0
    listed = said(hand, texts)
    assert listed[listed.index("sum w") + 1] == f"{1.0:.{digits}f}"


def test_weight_is_on_a_separate_line_after_a_long_name(drive, rig, texts):
    hand = drive(*rig, size=(1280, 800), samples=1)
    names = ("root", "a_name_that_is_as_long_as_some_are")
    figure = hand.state.actor.figure
    object.__setattr__(figure, "skeleton", replace(figure.require_skeleton(), names=names))
    pin_vertex(hand.state, 0, 4)
    hand.step(4)
    assert said(hand, texts).count("w2 = 0.5000") == 1
