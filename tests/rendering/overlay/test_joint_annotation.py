"""Annotation: names and marks of joints."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from rendering.drawn_figures import skeleton
from rendering.front_view import PIXELS, alone, drawn, front_view, grid_figure, pixel

from viewer.rendering.camera import Camera
from viewer.rendering.options import DisplayOptions
from viewer.rendering.overlay.annotation import Labels, leader_lines, letters_for, place_labels
from viewer.rendering.overlay.joint_marks import (
    HIGHLIGHT,
    axis_segments,
    bone_segments,
    joint_at,
    joint_dots,
    joint_marks_of,
    name_labels,
)
from viewer.rendering.overlay.typeface import Lettering
from viewer.rendering.view import view_of
from viewer.rigs.figure import Figure
from viewer.rigs.scene import Actor, Scene, scene_box

SIZE = (800, 720)
BOX = np.array([[-2.0, -2.0, -2.0], [2.0, 2.0, 2.0]])


@pytest.fixture(scope="module")
def lettering():
    return Lettering(letters_for(SIZE))


def placed(lettering, points, ranks, words=None):
    """Return the labels drawn for texts at points, seen from +z with 180 pixels per unit."""
    camera = Camera(azimuth=0.0, inclination=0.0, fov=90.0, distance=2.0, orthographic=True)
    count = len(points)
    colors = np.arange(3.0 * count).reshape(count, 3) / 100
    words = words or tuple("abcdefgh"[:count])
    labels = Labels(words, np.array(points, dtype=float), np.array(ranks), colors)
    return place_labels([labels], view_of(camera, SIZE, BOX), SIZE, lettering)


def test_letters_grow_with_the_image():
    # The size is 17 pixels at a height of 720; a width of 800 counts as a height of 600, which
    # gives 14.2.
    assert letters_for((1280, 720)) == 17 and letters_for((2560, 1440)) == 34
    assert letters_for(SIZE) == 14


def test_labels_are_ordered_by_rank_then_distance(lettering):
    same_place = [[0, 0, 0.0], [0, 0, 1.0], [0, 0, -1.0], [0, 0, 0.5]]
    assert placed(lettering, same_place, [1, 1, 0, 1]).texts == ("c", "b", "d", "a")
    assert placed(lettering, same_place, [1, 1, 1, 1]).texts == ("b", "d", "a", "c")
    assert placed(lettering, same_place, [0, 1, 2, 3]).texts == ("a", "b", "c", "d")


def test_colours_match_their_labels(lettering):
    found = placed(lettering, [[0, 0, 0.0], [0, 0, 1.0], [9, 0, -1.0]], [2, 1, 0])
    assert found.texts == ("b", "a")
    assert_allclose(found.colors, [[0.03, 0.04, 0.05], [0.0, 0.01, 0.02]])
    assert (found.n_seen, found.n_left_out) == ((2,), (0,))


def test_no_labels_have_no_text(lettering):
    found = placed(lettering, np.zeros((0, 3)), np.zeros(0, int), ())
    assert found.texts == () and found.corners.shape == (0, 2) and found.n_left_out == (0,)


def test_labels_of_several_annotations_are_placed_together(lettering):
    camera = Camera(azimuth=0.0, inclination=0.0, fov=90.0, distance=2.0, orthographic=True)
    view, place, white = view_of(camera, SIZE, BOX), np.zeros((1, 3)), np.ones((1, 3))
    many = Labels(("a",) * 6, np.repeat(place, 6, axis=0), np.full(6, 7), np.ones((6, 3)))
    one = Labels(("b",), place, np.array([3]), white)
    found = place_labels([many, one], view, SIZE, lettering)
    assert found.texts[0] == "b" and found.owners.tolist() == [1] + [0] * (len(found.texts) - 1)
    assert found.n_seen == (6, 1) and found.n_left_out == (7 - len(found.texts), 0)
    sizes = lettering.sizes(found.texts)
    cover = np.zeros(SIZE[::-1], dtype=int)
    for (left, top), (width, height) in zip(found.corners, sizes, strict=True):
        cover[top : top + height, left : left + width] += 1
    assert cover.max() == 1


def test_lines_connect_the_point_and_its_label(lettering):
    found = placed(lettering, np.zeros((3, 3)), [0, 1, 2])
    assert found.has_line.tolist() == [False, False, True]
    camera = Camera(azimuth=0.0, inclination=0.0, fov=90.0, distance=2.0, orthographic=True)
    view = view_of(camera, SIZE, BOX)
    lines = leader_lines(found, view, SIZE)
    # A dark line is beneath one in the colour of the text, in the plane of the point at z = 0.
    assert len(lines.widths) == 2 and lines.widths[0] > lines.widths[1]
    assert_allclose(lines.colors[1], [0.06, 0.07, 0.08, 1.0])
    # The scale is 180 pixels per unit, the centre (400, 360). The text is three gaps of 7 * 600 /
    # 720 above.
    assert_allclose(lines.starts[1], [0.0, 5.0 * 600 / 720 / 180, 0.0], atol=1e-12)
    end = [0.0, (360.0 - found.ends[2, 1]) / 180.0, 0.0]
    assert_allclose(lines.ends[1], end, atol=1e-12)
    assert 360.0 - found.ends[2, 1] == pytest.approx(17.5, abs=0.51)


OFFSETS = [[-1.0, 0.0, -0.5], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0]]  # behind the square


def boned() -> Scene:
    """Return a square in front of bones from (-1, 0) to (1, 0) to (1, 1)."""
    figure = grid_figure()
    joints = Figure("bones", skeleton=skeleton([-1, 0, 1], OFFSETS))
    return Scene([Actor(Figure("square", figure.mesh)), Actor(joints)])


def test_bones_are_visible_through_a_translucent_skin(offscreen):
    plain = front_view(offscreen, boned())
    xray = front_view(offscreen, boned(), xray=True)
    assert pixel(plain, 0.0, -1.0)[3] == 255
    assert 80 < pixel(xray, 0.0, -1.0)[3] < 130  # two fifths of the square's colour
    assert pixel(xray, 0.0, 0.0)[3] > 200  # the bone is opaque
    assert pixel(xray, 1.0, 0.5)[3] > 200


def test_translucent_skins_form_one_layer_in_any_order(offscreen):
    once = front_view(offscreen, boned(), xray=True)
    for place in (0, 1):
        scene = boned()
        behind = Actor(scene.actors[0].figure)
        behind.placement[2, 3] = -0.4
        scene.actors.insert(place, behind)
        np.testing.assert_array_equal(front_view(offscreen, scene, xray=True), once)


def test_scalar_colours_are_unchanged(offscreen):
    shown = {"shading": "scalar", "scalar": "influences"}
    plain = front_view(offscreen, alone(grid_figure()), **shown)
    xray = front_view(offscreen, alone(grid_figure()), xray=True, **shown)
    assert pixel(plain, -1.2, -1.2) == pixel(xray, -1.2, -1.2)


def test_overlapping_actors_are_translucent(offscreen):
    figure = grid_figure()
    actors = [Actor(figure) for _ in range(9)]
    for number, actor in enumerate(actors):
        actor.placement[0, 3] = 10.0 * number
    picture = front_view(offscreen, Scene(actors), xray=True)
    assert 80 < pixel(picture, -1.2, -1.2)[3] < 130


def test_bones_are_not_drawn_in_bind_pose(offscreen):
    plain = front_view(offscreen, alone(grid_figure()), show="binding")
    names = front_view(offscreen, alone(grid_figure()), show="binding", joint_names=True)
    np.testing.assert_array_equal(plain, names)


def test_x_axis_points_right_and_y_axis_up(offscreen):
    scene = alone(Figure("bones", skeleton=skeleton([-1, 0], [[-1.5, 0, 0], [3.0, 0, 0]])))
    picture = front_view(offscreen, scene, joint_axes=True, show="skeleton")
    # An axis is a twentieth of 3 units, 3 pixels; a dot of 5.6 pixels covers the start of the axes.
    plain = front_view(offscreen, scene, show="skeleton")
    column, row = 10, 40
    there = (picture[row - 6 : row + 6, column - 6 : column + 8].astype(int)
             - plain[row - 6 : row + 6, column - 6 : column + 8])  # fmt: skip
    assert np.abs(there).sum() > 0


def test_names_are_counted_and_drawn(offscreen):
    scene = alone(Figure("bones", skeleton=skeleton([-1] * 4, [[0, 0, z] for z in range(4)])))
    plain = front_view(offscreen, scene, joint_axes=True)
    named = front_view(offscreen, scene, joint_names=True, joint_axes=True)
    assert offscreen.renderer.names_left_out == (0, 4)
    changed = (plain != named).any(axis=-1)
    assert changed[:, PIXELS // 2 + 5 :].any() and changed[:, : PIXELS // 2 - 5].any()
    front_view(offscreen, scene, joint_axes=True)
    assert offscreen.renderer.names_left_out == (0, 0)


def test_new_names_are_added_to_the_drawn_names(offscreen):
    first = alone(Figure("a", skeleton=skeleton([-1], [[0, 0, 0]])))
    once = front_view(offscreen, first, joint_names=True)
    front_view(offscreen, boned(), joint_names=True)
    np.testing.assert_array_equal(front_view(offscreen, first, joint_names=True), once)


def test_picking_finds_bones_visible_through_the_skin(offscreen):
    scene = boned()
    camera = Camera(azimuth=0.0, inclination=0.0, fov=90.0, distance=2.0, orthographic=True)

    def picked(x, y, **options):
        place = PIXELS * (0.5 + x / 4), PIXELS * (0.5 - y / 4)
        with offscreen.context:
            found = offscreen.renderer.pick(
                scene, camera, DisplayOptions(**options), (PIXELS, PIXELS), *place,
                scene_box(scene),
            )  # fmt: skip
        return None if found is None else (found.actor, found.joint)

    assert picked(0.0, 0.0) == (0, -1)
    assert picked(0.0, 0.0, xray=True) == (1, 0)
    assert picked(0.0, 0.0, joint_names=True) == (0, -1)  # bones are not drawn
    assert picked(1.0, 0.0, joint_names=True) == (1, 1)
    assert picked(0.0, -1.0, xray=True) == (0, -1)


def test_images_without_marks_are_unchanged(offscreen):
    assert drawn(front_view(offscreen, boned())).any()
    assert not DisplayOptions().xray


SQUARE = (800, 800)  # a unit is 200 pixels; marks are scaled by 600 / 720, so 8 pixels are 6.7


@pytest.fixture
def view():
    camera = Camera(azimuth=0.0, inclination=0.0, fov=90.0, distance=2.0, orthographic=True)
    return view_of(camera, SQUARE, BOX)


def chain() -> Actor:
    """Return joints at (0, 0, 0), (1, 0, 0) and (1, 1, 0), and a leaf at the last position."""
    offsets = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 0]]
    return Actor(Figure("chain", skeleton=skeleton([-1, 0, 1, 2], offsets)))


def test_marks_follow_pose_and_placement():
    actor = chain()
    actor.pose.dofs[2] = np.pi / 2  # the root rotates about z
    actor.pose.figure_translation[:] = 0.0, 0.0, 5.0
    actor.pose.figure_scale = 2.0
    actor.placement[0, 3] = 10.0
    (marks,) = joint_marks_of([actor])
    # (1, 1, 0) is rotated to (-1, 1, 0), scaled by two, and moved by both translations.
    assert_allclose(marks.points[2], [10.0 - 2.0, 2.0, 5.0], atol=1e-12)


def test_hidden_actors_have_no_marks():
    first, second, third = chain(), chain(), chain()
    first.visible, second.is_present = False, False
    assert [marks.actor for marks in joint_marks_of([first, second, third])] == [2]


def test_bones_connect_parents_and_children_over_dark_borders():
    (marks,) = joint_marks_of([chain()])
    bones = bone_segments(marks, 1, 2.0)
    assert_allclose(bones.starts[3:], [[0, 0, 0], [1, 0, 0], [1, 1, 0]], atol=1e-12)
    assert_allclose(bones.ends[3:], [[1, 0, 0], [1, 1, 0], [1, 1, 0]], atol=1e-12)
    assert_allclose(bones.starts[:3], bones.starts[3:])
    assert_allclose(bones.widths, [10.0] * 3 + [6.0] * 3)
    assert_allclose(bones.colors[4], HIGHLIGHT)  # the bone that the selected joint rotates
    assert (bones.colors[3] != bones.colors[4]).any()


def test_selected_joint_has_a_larger_dot():
    (marks,) = joint_marks_of([chain()])
    plain, chosen = joint_dots(marks, -1, 1.0), joint_dots(marks, 1, 1.0)
    assert len(plain) == 2 and len(chosen) == 4
    assert_allclose(chosen[-1].starts, [[1, 0, 0]], atol=1e-12)
    assert chosen[-1].widths[0] > chosen[1].widths[0]


def test_axes_follow_the_joint_and_are_shorter_than_the_bone():
    actor = chain()
    actor.pose.dofs[2] = np.pi / 2
    (marks,) = joint_marks_of([actor])
    axes = axis_segments(marks, 1.0)
    ways = (axes.ends - axes.starts).reshape(4, 3, 3)
    # The size of the skeleton is sqrt(2); a twentieth of it is less than 0.4 of a bone.
    length = 0.05 * np.sqrt(2.0)
    assert_allclose(ways[0], length * np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1]]), atol=1e-12)
    colors = axes.colors.reshape(4, 3, 4)[0, :, :3]
    assert colors.argmax(axis=1).tolist() == [0, 1, 2]  # red, green, blue


def test_axes_of_joints_close_together_are_short():
    near = skeleton([-1, 0, 1], [[0, 0, 0], [10, 0, 0], [0, 0.5, 0]])
    (marks,) = joint_marks_of([Actor(Figure("near", skeleton=near))])
    axes = axis_segments(marks, 1.0)
    lengths = np.linalg.norm(axes.ends - axes.starts, axis=1)[::3]
    size = np.linalg.norm([10.0, 0.5])
    assert_allclose(lengths, [0.05 * size, 0.2, 0.2], atol=1e-12)


def test_single_joint_has_axes():
    (marks,) = joint_marks_of([Actor(Figure("one", skeleton=skeleton([-1], [[0, 0, 0]])))])
    axes = axis_segments(marks, 1.0)
    assert_allclose(np.linalg.norm(axes.ends - axes.starts, axis=1), 0.05)
    assert len(bone_segments(marks, 0, 1.0).widths) == 0


def at(view, x, y, with_bones=True, actors=None):
    """Return the actor and joint at a point of the plane z = 0."""
    marks = joint_marks_of([chain()] if actors is None else actors)
    found = joint_at(marks, view, SQUARE, (400 + 200 * x, 400 - 200 * y), with_bones)
    return None if found is None else found[:2]


def test_joint_is_found_by_its_dot(view):
    assert at(view, 0.0, 0.0) == (0, 0) and at(view, 1.0, 0.0) == (0, 1)
    assert at(view, 1.0, 0.03, with_bones=False) == (0, 1)
    assert at(view, 1.0, 0.05, with_bones=False) is None  # ten pixels away from the dot


def test_bone_belongs_to_the_joint_that_rotates_it(view):
    assert at(view, 0.5, 0.0) == (0, 0) and at(view, 1.0, 0.5) == (0, 1)
    assert at(view, 0.5, 0.0, with_bones=False) is None
    assert at(view, 0.5, 0.1) is None and at(view, -1.0, -1.0) is None


def test_dot_takes_precedence_over_bones(view):
    # On the bone of joint 1, five pixels below the dot of joint 2.
    assert at(view, 1.0, 0.975) == (0, 2)


def test_nearer_of_two_coincident_actors_is_picked(view):
    far, near = chain(), chain()
    near.placement[2, 3] = 0.5
    assert at(view, 1.0, 0.0, actors=[far, near]) == (1, 1)
    assert at(view, 1.0, 0.0, actors=[near, far]) == (0, 1)
    # The returned point is the position of the joint.
    found = joint_at(joint_marks_of([near]), view, SQUARE, (600.0, 400.0), True)
    assert_allclose(found[2], [1.0, 0.0, 0.5], atol=1e-12)


def test_empty_scene_has_no_joint(view):
    assert at(view, 0.0, 0.0, actors=[]) is None


def placed_names(lettering, offsets, selected=(0, -1)):
    """Return the names drawn for joints at given positions, seen from +z."""
    joints = skeleton([-1] * len(offsets), offsets)
    marks = joint_marks_of([Actor(Figure("figure", skeleton=joints))])
    camera = Camera(azimuth=0.0, inclination=0.0, fov=90.0, distance=2.0, orthographic=True)
    view = view_of(camera, SIZE, BOX)
    return place_labels([name_labels(marks, selected)], view, SIZE, lettering)


def test_well_separated_joints_are_all_named(lettering):
    names = placed_names(lettering, [[-1, 0, 0], [1, 0, 0], [0, 1, 0]])
    assert sorted(names.texts) == ["j0", "j1", "j2"]
    assert (names.n_seen, names.n_left_out) == ((3,), (0,))
    # At 180 pixels per unit, joint 0 is at (220, 360); its name is to the right at the same height.
    left, top = names.corners[names.texts.index("j0")].tolist()
    assert 222 < left < 230 and 345 < top < 360


def test_nearest_joints_are_named_if_not_all_fit(lettering):
    names = placed_names(lettering, [[0, 0, z] for z in (0.0, 1.0, -1.0, 0.5, -0.5)])
    # The names are to the right and left of the position, and above and below it.
    assert names.texts == ("j1", "j3", "j0", "j4")
    assert (names.n_seen, names.n_left_out) == ((5,), (1,))


def test_selected_joint_is_named_first_in_its_own_colour(lettering):
    names = placed_names(lettering, [[0, 0, 0.0], [0, 0, 1.0], [0, 0, -1.0]], selected=(0, 2))
    assert names.texts == ("j2", "j1", "j0")
    assert_allclose(names.colors[0], HIGHLIGHT[:3])
    assert (names.colors[1] > 0.9).all()
    other = placed_names(lettering, [[0, 0, 0.0], [0, 0, 1.0], [0, 0, -1.0]], selected=(1, 2))
    assert other.texts == ("j1", "j0", "j2")


def test_joints_outside_the_image_are_not_counted(lettering):
    names = placed_names(lettering, [[0, 0, 0], [9, 0, 0], [0, -9, 0]])
    assert names.texts == ("j0",) and names.n_seen == (1,)


def test_empty_scene_has_no_names(lettering):
    camera = Camera()
    view = view_of(camera, SIZE, BOX)
    names = place_labels([name_labels([], (0, -1))], view, SIZE, lettering)
    assert names.texts == () and names.n_left_out == (0,)
