"""Hovering over a surface, clicks on vertices, and joints visible through the skin."""

from dataclasses import replace

import numpy as np
import pytest
from app.tiny import chain
from imgui_bundle import imgui
from numpy.testing import assert_allclose

from viewer.app.posing.gizmo import joint_places
from viewer.app.posing.joint_tree import joint_tree
from viewer.app.posing.posing import Posing
from viewer.app.view.hovering import Hovered
from viewer.app.view.outlines import outlined_parts
from viewer.app.view.picks import take_pick
from viewer.app.weights.weights_panel import Weights
from viewer.rendering.passes.outline_pass import Outlined
from viewer.rendering.picking import Pick
from viewer.rigs.annotations import BodyParts, ReducedMesh
from viewer.rigs.scene import actor_points
from viewer.rigs.skinning import deform, joint_matrices


@pytest.fixture
def column(drive, rig):
    """A test driver on the Weights panel of the tiny column."""
    hand = drive(*rig, size=(1280, 800), samples=1)
    hand.show_panel("Weights")
    hand.step(3)
    return hand


def vertices(hand, index=0):
    """Return the vertices in scene space."""
    actor = hand.state.scene.actors[index]
    return deform(actor.figure, actor.pose, hand.state.options.skinning)[0]


def near(hand, triangle, corner):
    """Return the window position of a point of a triangle close to one of its corners."""
    corners = hand.state.actor.figure.mesh.triangles[triangle]
    places = vertices(hand)[corners]
    return seen_at(hand, 0.8 * places[corner] + 0.2 * places.mean(axis=0))


def facing(hand, row=0):
    """Return the side triangle that faces the camera most, with a corner from the given row on."""
    actor = hand.state.actor
    # The first four triangles close the column at both ends.
    corners = actor.figure.mesh.triangles[4:]
    places, normals = deform(actor.figure, actor.pose, hand.state.options.skinning)
    to_eye = np.linalg.inv(hand.state.camera.view_matrix())[:3, 3] - places[corners].mean(axis=1)
    faces = (normals[corners].sum(axis=1) * to_eye).sum(axis=1)
    return 4 + int(np.where((corners >= row).any(axis=1), faces, -np.inf).argmax())


def rest(hand, place, frames=20):
    hand.move(place)
    hand.step(frames)


@pytest.mark.parametrize("corner", [0, 1, 2])
def test_vertex_under_a_resting_mouse_is_described(column, texts, corner):
    triangle = facing(column)
    vertex = int(column.state.actor.figure.mesh.triangles[triangle, corner])
    rest(column, near(column, triangle, corner))
    texts.clear()
    column.step()
    assert f"vertex {vertex}, triangle {triangle}" in texts
    x, y, z = vertices(column)[vertex]
    assert f"position {x:.4f}  {y:.4f}  {z:.4f}" in texts
    names = {8: ["1.0000 arm"], 4: ["0.5000 root", "0.5000 arm"], 0: ["1.0000 root"]}
    for line in names[vertex // 4 * 4]:
        assert line in texts
    assert_allclose(column.state.of(Weights).hover.point, [x, y, z], atol=1e-12)


def test_no_vertex_is_picked_while_the_mouse_moves(column, monkeypatch):
    looked = []
    picking = column.app.frame.renderer.pick
    monkeypatch.setattr(
        column.app.frame.renderer, "pick", lambda *a: looked.append(a) or picking(*a)
    )
    x, y = near(column, facing(column), 0)
    for step in range(20):
        column.move((x + step % 3, y))
    assert not looked and column.state.of(Weights).is_waiting
    column.step(20)
    assert len(looked) == 1 and not column.state.of(Weights).is_waiting
    column.step(60)
    assert len(looked) == 1  # one pick is enough


def test_text_hides_when_the_mouse_moves_and_follows_a_changed_pose(column, texts):
    place = near(column, facing(column), 0)
    rest(column, place)
    assert column.state.of(Weights).hover.lines
    column.state.actor.pose.dofs[column.dof_index("root.ty")] += 0.05
    column.step(2)
    assert not column.state.of(Weights).hover.lines
    column.step(20)
    assert column.state.of(Weights).hover.lines
    column.move((place[0] + 5, place[1]))
    texts.clear()
    column.step()
    assert not any(text.startswith("vertex ") for text in texts)


def test_no_text_is_shown_without_the_panel_or_the_toggle(column):
    column.show_panel("Display")
    place = near(column, facing(column), 0)
    rest(column, place)
    assert not column.state.of(Weights).hover.lines
    column.menu("menu View", "Inspect vertex under cursor")
    assert column.says("Inspect vertex under cursor on")
    rest(column, place)
    assert column.state.of(Weights).hover.lines


def test_no_text_is_shown_off_the_figure_or_over_a_panel(column):
    x, y, width, _ = column.state.view_rect
    rest(column, (x + width - 30, y + 300))
    assert column.state.of(Weights).hover.is_known and not column.state.of(Weights).hover.lines
    rest(column, column.place("Heat map"))
    assert not column.state.of(Weights).hover.is_known


def test_bind_pose_shows_the_stored_positions(column, texts):
    column.state.options.show = "binding"
    column.key("f")
    column.step(2)
    mesh = column.state.actor.figure.mesh
    eye = np.linalg.inv(column.state.camera.view_matrix())[:3, 3]
    corners = mesh.triangles[4:]
    to_eye = eye - mesh.positions[corners].mean(axis=1)
    facing_most = (mesh.normals[corners].sum(axis=1) * to_eye).sum(axis=1)
    triangle = 4 + int(facing_most.argmax())
    places = mesh.positions[mesh.triangles[triangle]]
    rest(column, seen_at(column, 0.8 * places[1] + 0.2 * places.mean(axis=0)))
    x, y, z = mesh.positions[mesh.triangles[triangle, 1]]
    assert f"position {x:.4f}  {y:.4f}  {z:.4f}" in column.state.of(Weights).hover.lines


def test_reduced_mesh_maps_to_full_mesh_vertices(column):
    actor = column.state.actor
    triangle = facing(column)
    corners = actor.figure.mesh.triangles[triangle]
    listed = np.array([11, *corners[::-1]])
    reduced = ReducedMesh(listed, np.array([[0, 0, 0], [3, 2, 1]]))
    place = near(column, triangle, 2)
    column.state.scene.actors[0] = replace(actor, figure=replace(actor.figure, reduced=reduced))
    column.state.options.reduced = True
    rest(column, place)
    assert column.state.of(Weights).hover.lines[0] == f"vertex {corners[2]}"


def test_text_contains_body_part_and_actor(drive, rig, texts):
    hand = drive(*rig, *rig, size=(1280, 800), samples=1)
    hand.show_panel("Weights")
    parts = BodyParts(("low", "high"), np.repeat([0, 1], [8, 4]))
    actor = hand.state.actor
    hand.state.scene.actors[0] = replace(actor, figure=replace(actor.figure, body_parts=parts))
    hand.step(2)
    triangle = facing(hand)
    vertex = int(hand.state.actor.figure.mesh.triangles[triangle, 0])
    places = vertices(hand)[hand.state.actor.figure.mesh.triangles[triangle]]
    point = 0.8 * places[0] + 0.2 * places.mean(axis=0)
    placed = hand.state.actor.placement @ np.append(point, 1.0)
    rest(hand, seen_at(hand, placed[:3]))
    lines = hand.state.of(Weights).hover.lines
    part = "high" if vertex >= 8 else "low"
    assert lines[0] == "tiny" and lines[1] == f"vertex {vertex}, triangle {triangle}, {part}"


def test_alt_click_pins_a_vertex_and_plain_click_does_not(column):
    triangle = facing(column)
    place = near(column, triangle, 1)
    click(column, place)
    assert column.state.of(Weights).pinned is None
    column.click(place, held="alt")
    vertex = column.state.actor.figure.mesh.triangles[triangle, 1]
    assert column.state.of(Weights).pinned.vertex == vertex


@pytest.mark.parametrize(("row", "name"), [(8, "arm"), (0, "root")])
def test_click_on_the_skin_selects_the_joint_that_moves_it_most(column, row, name):
    mesh = column.state.actor.figure.mesh
    triangle = facing(column, row)
    corner = int(np.flatnonzero(mesh.triangles[triangle] // 4 == row // 4)[0])
    vertex = int(mesh.triangles[triangle, corner])
    click(column, near(column, triangle, corner))
    skeleton = column.state.actor.figure.skeleton
    assert skeleton.names[column.state.selected_joint] == name
    assert column.says(f"{name} 1.00: the largest weight at vertex {vertex}")
    assert column.state.of(Weights).pinned is None and column.undo_steps == 0


def test_click_on_the_skin_selects_in_the_tree(drive, rig):
    hand = drive(*rig, size=(1280, 800), samples=1)
    hand.step(3)
    joint_tree(hand.state).filter, joint_tree(hand.state).opened = "roo", set()
    triangle = facing(hand, 8)
    corner = int(hand.state.actor.figure.mesh.triangles[triangle].argmax())
    click(hand, near(hand, triangle, corner))
    hand.step(3)
    assert hand.state.selected_joint == 1 and joint_tree(hand.state).filter == ""
    assert joint_tree(hand.state).opened == {0, 1} and "joint arm" in hand.state.item_rects


def test_drag_over_the_skin_selects_nothing(column):
    x, y = near(column, facing(column), 1)
    azimuth = column.state.camera.azimuth
    column.pull((x, y), (x + 40, y))
    column.step(2)
    assert column.state.selected_joint == -1 and column.state.camera.azimuth != azimuth


@pytest.mark.parametrize("tool", ["select", "rotate", "move"])
def test_click_on_the_background_deselects_the_joint(column, tool):
    column.state.of(Posing).tool, column.state.selected_joint = tool, 1
    column.step(2)
    x, y, width, _ = column.state.view_rect
    column.double_click((x + width - 30, y + 300))
    click(column, (x + width - 30, y + 300))
    assert column.state.selected_joint == -1


def test_click_on_a_figure_without_weights_keeps_the_joint(column):
    actor = column.state.actor
    bare = replace(actor.figure, skin=None)
    column.state.scene.actors[0] = replace(actor, figure=bare)
    column.state.selected_joint = 1
    column.key("f")
    column.step(2)
    click(column, seen_at(column, bare.mesh.positions.mean(axis=0)))
    assert column.state.selected_joint == 1


def test_hover_shows_what_a_click_would_select(column):
    triangle = facing(column, 8)
    corner = int(column.state.actor.figure.mesh.triangles[triangle].argmax())
    place = near(column, triangle, corner)
    rest(column, place)
    assert column.state.of(Weights).hover.lines[-1] == "click: arm 1.00"
    column.state.of(Weights).picks_vertices = True
    rest(column, (place[0] + 1, place[1]))
    assert not any(line.startswith("click") for line in column.state.of(Weights).hover.lines)


def test_hover_over_a_dot_shows_the_name_of_its_joint(column):
    column.key("b")  # in x-ray mode, dots and bones are drawn over the skin
    actor = column.state.actor
    place = joint_matrices(actor.figure, actor.pose)[0][:3, 3]
    rest(column, seen_at(column, place + np.array([0.0, 1e-3, 0.0])))
    lines = column.state.of(Weights).hover.lines
    assert lines and lines[-1] == "click: root"


def test_check_box_lets_plain_clicks_pin(column):
    column.click("Pick vertices")
    click(column, near(column, facing(column), 2))
    assert column.state.of(Weights).pinned is not None


def test_alt_click_on_the_background_keeps_the_pin(column):
    column.click(near(column, facing(column), 1), held="alt")
    pinned = column.state.of(Weights).pinned
    x, y, width, _ = column.state.view_rect
    column.click((x + width - 30, y + 300), held="alt")
    assert column.state.of(Weights).pinned is pinned


def test_vertices_are_picked_through_the_boxes_of_joints(column):
    column.state.options.show, column.state.options.xray = "both", True
    column.step(2)
    column.click(near(column, facing(column), 1), held="alt")
    assert column.state.of(Weights).pinned is not None and column.state.selected_joint == -1


def test_click_in_x_ray_selects_the_joint_and_its_row(column):
    column.key("b")
    assert column.state.options.xray
    actor = column.state.actor
    place = joint_matrices(actor.figure, actor.pose)[1][:3, 3]
    click(column, seen_at(column, place))
    assert column.state.selected_joint == 1
    assert joint_tree(column.state).scrolls_to == -1  # the tree has scrolled to it


def test_tree_scrolls_to_a_joint_outside_the_visible_rows(drive, tmp_path):
    path = tmp_path / "long.skel"
    path.write_text(chain(60))
    hand = drive(path)
    assert "joint j#50" not in hand.state.item_rects
    take_pick(hand.state, Pick(0, 50, -1, -1, np.zeros(3)), False)
    hand.step(4)
    _, top, _, bottom = hand.state.item_rects["joint j#50"]
    assert 100 < top < bottom < 640
    assert joint_tree(hand.state).scrolls_to == -1 and hand.state.selected_joint == 50


def test_filter_that_hides_a_selected_joint_is_cleared(drive, tmp_path):
    path = tmp_path / "long.skel"
    path.write_text(chain(60))
    hand = drive(path)
    joint_tree(hand.state).filter = "j#7"
    hand.step(2)
    take_pick(hand.state, Pick(0, 50, -1, -1, np.zeros(3)), False)
    hand.step(4)
    assert joint_tree(hand.state).filter == "" and "joint j#50" in hand.state.item_rects


def test_selected_joint_is_highlighted_in_x_ray(column):
    column.key("b")
    before = column.scene_picture()
    column.click(column.place("joint arm", 0.5))
    column.step(2)
    assert (column.scene_picture() != before).any()


def test_window_stays_awake_only_until_the_mouse_rests(column):
    place = near(column, facing(column), 0)
    column.move(place)
    assert column.state.of(Weights).is_waiting
    waited = imgui.get_time()
    while column.state.of(Weights).is_waiting:
        column.step()
    assert imgui.get_time() - waited < 0.3


@pytest.fixture
def pair(drive, rig, tmp_path):
    """A test driver on two tiny figures side by side."""
    hand = drive(*rig, *rig, size=(1280, 800), samples=1)
    hand.step(3)
    return hand


def seen_at(hand, point):
    """The window coordinates of a point, by the camera's matrices."""
    camera = hand.state.camera
    x, y, width, height = hand.state.view_rect
    matrix = camera.projection_matrix(width / height, hand.state.box) @ camera.view_matrix()
    clip = matrix @ np.append(point, 1.0)
    across, upward = clip[:2] / clip[3]
    return x + width * (across + 1) / 2, y + height * (1 - upward) / 2


def middle_of(hand, index):
    points = actor_points(hand.state.scene.actors[index])
    return (points.min(axis=0) + points.max(axis=0)) / 2


def click(hand, place, times=1):
    io_place = (float(place[0]), float(place[1]))
    for _ in range(times):
        hand.pull(io_place, io_place)
    hand.step(2)


def test_click_activates_the_actor_under_it(pair):
    assert pair.state.chosen_actor == 0
    click(pair, seen_at(pair, middle_of(pair, 1)))
    assert pair.state.chosen_actor == 1
    click(pair, seen_at(pair, middle_of(pair, 0)))
    assert pair.state.chosen_actor == 0


def test_click_on_the_background_has_no_effect(pair):
    pair.state.choose_actor(1)
    x, y, width, _ = pair.state.view_rect
    click(pair, (x + width - 5, y + 5))
    assert pair.state.chosen_actor == 1 and pair.undo_steps == 0


def test_click_on_a_joint_selects_it(pair):
    pair.state.options.show = "skeleton"
    pair.step(2)
    from viewer.rigs.geometry.transform import apply_transform
    from viewer.rigs.skinning import joint_matrices

    actor = pair.state.scene.actors[1]
    joints = joint_matrices(actor.figure, actor.pose)[:, :3, 3]
    chosen = actor.figure.skeleton.n_joints - 1
    boxes = actor.figure.skeleton.boxes
    inside = boxes[chosen].mean(axis=0) if boxes is not None else np.zeros(3)
    world = joint_matrices(actor.figure, actor.pose)[chosen]
    place = apply_transform(actor.placement, apply_transform(world, inside[None]))[0]
    assert len(joints) > chosen
    click(pair, seen_at(pair, place))
    assert (pair.state.chosen_actor, pair.state.selected_joint) == (1, chosen)


def test_drag_orbits_and_selects_nothing(pair):
    azimuth = pair.state.camera.azimuth
    x, y = seen_at(pair, middle_of(pair, 1))
    pair.pull((x, y), (x + 60, y))
    pair.step(1)
    assert pair.state.camera.azimuth != azimuth
    assert pair.state.chosen_actor == 0


def test_double_click_aims_the_camera_at_the_surface(pair):
    distance = pair.state.camera.distance
    place = seen_at(pair, middle_of(pair, 1))
    click(pair, place, times=2)
    x, y, width, height = pair.state.view_rect
    # The clicked point is now in the middle of the view, at the distance of the previous target.
    points = actor_points(pair.state.scene.actors[1])
    size = np.ptp(points, axis=0).max()
    assert pair.state.camera.distance == distance
    assert np.linalg.norm(pair.state.camera.target - middle_of(pair, 1)) < size
    assert_allclose(
        seen_at(pair, pair.state.camera.target), (x + width / 2, y + height / 2), atol=1e-6
    )


@pytest.fixture
def bones(drive, rig):
    """A test driver on the tiny figure with its skeleton."""
    hand = drive(*rig, pixels_per_point=1.0)
    hand.state.options.show = "both"
    hand.step(2)
    return hand


@pytest.fixture
def hovered_pair(drive, rig):
    """A test driver on two tiny figures side by side."""
    return drive(*rig, *rig, size=(1280, 800))


def keys(hand):
    return [part.key() for part in outlined_parts(hand.state)]


def beside(hand, joint, across=11.0):
    x, y = joint_places(hand.state)[joint]
    return float(x) + across, float(y)


def root_place(hand, actor):
    hand.state.chosen_actor, kept = actor, hand.state.chosen_actor
    places = joint_places(hand.state)
    hand.state.chosen_actor = kept
    return tuple(float(side) for side in places[0])


def test_joint_near_the_pointer_is_outlined_and_selected_by_a_click(bones):
    bones.move(beside(bones, 1))
    bones.step(2)
    assert bones.state.of(Hovered).joint == 1
    assert keys(bones) == [Outlined(0, 1, is_hovered=True).key()]
    bones.click(beside(bones, 1))
    assert bones.state.selected_joint == 1
    assert keys(bones) == [Outlined(0, 1).key()]
    bones.move((1.0, 1.0))
    assert bones.state.of(Hovered).joint == -1


def test_hidden_joints_are_not_hovered(hand):
    hand.move(beside(hand, 1, 2.0))
    hand.step(10)
    assert hand.state.of(Hovered).joint == -1 and not keys(hand)


def test_outlines_are_drawn_in_the_window_but_not_in_pictures(bones):
    plain = bones.scene_picture()
    bones.menu("menu View", "Selection outlines")
    bones.state.selected_joint = 1
    bones.step(3)
    selected = bones.scene_picture()
    bones.menu("menu View", "Selection outlines")
    bones.step(2)
    rows, columns = (slice(round(a), round(b)) for a, b in zip((100, 260), (500, 600), strict=True))
    with_outline = bones.screen()[rows, columns]
    assert (bones.scene_picture() == selected).all() and (selected != plain).any()
    bones.menu("menu View", "Selection outlines")
    bones.move((1.0, 1.0))
    assert (bones.screen()[rows, columns] != with_outline).any()


def test_chosen_actor_among_several_is_outlined(hovered_pair):
    assert not keys(hovered_pair)
    hovered_pair.state.select_actor(1)
    hovered_pair.step()
    assert keys(hovered_pair) == [Outlined(1).key()]
    hovered_pair.key("escape")
    assert not keys(hovered_pair) and hovered_pair.state.chosen_actor == 1


def test_actor_under_a_resting_pointer_is_outlined(hovered_pair):
    hovered_pair.move(root_place(hovered_pair, 1))
    hovered_pair.step(6)
    assert hovered_pair.state.of(Hovered).actor == 1
    assert keys(hovered_pair) == [Outlined(1, is_hovered=True).key()]


@pytest.mark.parametrize(("away", "orbits"), [(16.0, False), (60.0, True)])
def test_drag_next_to_a_ring_does_not_orbit(bones, away, orbits):
    bones.state.selected_joint = 1
    bones.key("e")
    bones.step(2)
    x, y = joint_places(bones.state)[1]
    # The outermost ring faces the eye.
    from viewer.app.posing.rotate_tool import RADIUS

    start = float(x) + 1.18 * RADIUS + away, float(y)
    before, dofs = bones.state.camera.azimuth, bones.dofs()
    bones.pull(start, (start[0] + 40.0, start[1] + 10.0))
    assert (bones.state.camera.azimuth != before) == orbits
    np.testing.assert_array_equal(bones.dofs(), dofs)
