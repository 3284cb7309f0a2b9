"""Passes that draw over figures: annotation, outlines, ghosts and keypoints."""

from dataclasses import replace

import numpy as np
import pytest
from rendering.drawn_figures import skeleton, square
from rendering.front_view import PIXELS, alone, drawn, front_view, grid_figure, pixel

from viewer.rendering.camera import Camera
from viewer.rendering.gpu.target import Target, picture_rows
from viewer.rendering.options import DisplayOptions
from viewer.rendering.overlay.annotation import Annotation, Labels
from viewer.rendering.overlay.segments import SegmentStyle, dots
from viewer.rendering.passes.ghost_pass import Ghost
from viewer.rendering.passes.outline_pass import Outlined
from viewer.rigs.annotations import Keypoints
from viewer.rigs.figure import Figure
from viewer.rigs.geometry.transform import translation_matrix
from viewer.rigs.scene import Actor, Scene, scene_box

RED, GREEN = (1.0, 0.0, 0.0, 1.0), (0.0, 1.0, 0.0, 1.0)


def dot(place, color, width=12.0, words=(), on_top=True):
    points = np.array([place], dtype=float)
    count = len(words)
    labels = Labels(
        tuple(words), np.repeat(points, count, axis=0), np.arange(count), np.ones((count, 3))
    )
    segments = dots(points, np.array(color), width)
    return Annotation(segments, SegmentStyle(on_top=on_top), labels if words else None)


def picture(offscreen, *annotations, scene=None):
    offscreen.renderer.annotations = annotations
    try:
        return front_view(offscreen, scene or Scene([]))
    finally:
        offscreen.renderer.annotations = ()


def test_later_annotations_are_drawn_over_earlier_ones(offscreen):
    found = picture(offscreen, dot((0, 0, 1), RED, 20.0), dot((0, 0, -1), GREEN, 8.0))
    assert pixel(found, 0.0, 0.0) == [0, 255, 0, 255]
    assert pixel(found, 0.35, 0.0) == [255, 0, 0, 255]


def test_segments_on_top_are_visible_through_a_surface_and_others_faint(offscreen):
    scene = Scene([Actor(Figure("square", square()))])
    through = picture(offscreen, dot((0, 0, -0.5), RED), scene=scene)
    behind = picture(offscreen, dot((0, 0, -0.5), RED, on_top=False), scene=scene)
    plain = np.array(pixel(picture(offscreen, scene=scene), 0.0, 0.0)[:3])
    assert pixel(through, 0.0, 0.0) == [255, 0, 0, 255]
    assert pixel(behind, 0.0, 0.0)[:3] == pytest.approx(
        0.4 * np.array([255, 0, 0]) + 0.6 * plain, abs=2
    )


def test_labels_are_drawn_next_to_their_point(offscreen):
    alone = drawn(picture(offscreen, dot((0, 0, 0), RED)))
    named = drawn(picture(offscreen, dot((0, 0, 0), RED, words=["ab", "cd", "ef"])))
    more = named & ~alone
    half = PIXELS // 2
    # One label is on each side, and the third above them with a leader line.
    assert more[half - 6 : half + 6, :half].any() and more[half - 6 : half + 6, half:].any()
    assert more[: half - 14].any() and not more[half + 12 :].any()
    assert more[half - 12 : half - 8, half - 1 : half + 1].all()


def test_labels_of_two_annotations_are_both_drawn(offscreen):
    low, high = dot((0, -1, 0), RED, words=["ab"]), dot((0, 1, 0), RED, words=["cd"])
    once, both = drawn(picture(offscreen, low)), drawn(picture(offscreen, low, high))
    np.testing.assert_array_equal(both[PIXELS // 2 :], once[PIXELS // 2 :])
    assert both[: PIXELS // 2].any()


def changed(offscreen, scene, *outlined, **options):
    """Return a mask of the pixels covered by outlines, and the image with straight alpha."""
    front_view(offscreen, scene, **options)
    camera = Camera(azimuth=0.0, inclination=0.0, fov=90.0, distance=2.0, orthographic=True)
    shown = DisplayOptions(samples=1, **options)
    with offscreen.context as context:
        target, box = Target(context, (PIXELS, PIXELS), 1), scene_box(scene)
        offscreen.renderer.draw_outlines(outlined, scene, camera, shown, target, box)
        picture = picture_rows(target.framebuffer.read(components=4), target.size).copy()
        target.release()
    return picture[..., 3] > 0, picture


def test_outline_has_equal_width_on_all_sides_and_covers_no_inner_pixels(offscreen):
    scene = alone(grid_figure())
    lines, picture = changed(offscreen, scene, Outlined(0))
    # The square extends from pixel 10 to 70; at the smallest scale, 0.8, the coloured line is 1.6
    # pixels wide and the dark line extends a pixel further.
    assert not lines[11:69, 11:69].any()
    middle = PIXELS // 2
    for row in (lines[middle], lines[middle, ::-1], lines[:, middle], lines[::-1, middle]):
        assert np.flatnonzero(row[:middle]).tolist() in ([7, 8, 9], [7, 8, 9, 10])
    red, green, blue, alpha = picture[middle, 9].tolist()
    assert red > green > 2 * blue and alpha > 200
    # The corners are round.
    assert not lines[7, 7] and lines[8, 8]


def test_hovered_and_selected_actors_have_different_colours(offscreen):
    scene = alone(grid_figure())
    _, selected = changed(offscreen, scene, Outlined(0))
    _, hovered = changed(offscreen, scene, Outlined(0, is_hovered=True))
    assert hovered[PIXELS // 2, 9, 2] > 150 > selected[PIXELS // 2, 9, 2]


@pytest.mark.parametrize("style", ["boxes", "octahedra", "axes"])
def test_outline_of_a_joint_does_not_outline_other_joints(offscreen, style):
    joints = skeleton([-1, 0, 1], [[-1.5, 0.0, 0.0], [1.5, 0.0, 0.0], [1.5, 0.0, 0.0]])
    scene = alone(Figure("bones", skeleton=joints))
    lines, _ = changed(offscreen, scene, Outlined(0, 1), bones=style)
    assert lines[:, PIXELS // 2 - 4 :].any() and not lines[:, : PIXELS // 2 - 6].any()


def test_points_are_outlined_and_the_option_outlines_the_selection(offscreen):
    scene = alone(grid_figure())
    where = np.array([[1.0, 0.0, 0.0]])
    lines, _ = changed(offscreen, scene, Outlined(0, points=where))
    rows, columns = np.nonzero(lines)
    away = np.hypot(rows - 39.5, columns - 59.5)
    # The diameter is 9 pixels at the smallest scale, plus the line around it.
    assert away.max() < 8.0 and away.min() > 2.5
    plain, outlined = (front_view(offscreen, scene, outline=on) for on in (False, True))
    assert (plain != outlined).any()


BLUE = (0.0, 0.0, 1.0)


def ghost(style="solid", away=(0.0, 0.0, 0.0), color=BLUE):
    return Ghost(Figure("ghost", square()), translation_matrix(np.array(away)), style, color)


def shown(offscreen, what, scene=None, **options):
    offscreen.renderer.ghost = what
    return front_view(offscreen, scene or Scene([]), **options)


def test_solid_ghost_is_drawn_at_its_placement(offscreen):
    picture = shown(offscreen, ghost(away=(0.5, 0.0, 0.0)))
    at = drawn(picture).any(axis=0)
    assert drawn(picture).any()
    moved = drawn(shown(offscreen, ghost(away=(0.0, 0.0, 0.0)))).any(axis=0)
    shift = np.nonzero(at)[0].min() - np.nonzero(moved)[0].min()
    assert shift == pytest.approx(0.5 * 20, abs=1)  # a unit is 20 pixels


def test_translucent_ghost_lets_the_scene_through(offscreen):
    scene = Scene([Actor(Figure("square", square()))])
    bare = pixel(shown(offscreen, None, scene), 0.0, 0.0)
    thin = pixel(shown(offscreen, ghost("translucent"), scene), 0.0, 0.0)
    thick = pixel(shown(offscreen, ghost("solid"), scene), 0.0, 0.0)
    assert thick[0] < thin[0] < bare[0]  # red decreases
    mixed = np.add(np.multiply(0.6, bare[:3]), np.multiply(0.4, thick[:3]))
    assert np.abs(np.subtract(thin[:3], mixed)).max() < 12  # blending is in sRGB


def test_ghost_behind_a_surface_is_hidden_and_ghost_inside_it_is_visible(offscreen):
    scene = Scene([Actor(Figure("square", square()))])
    bare = shown(offscreen, None, scene)
    behind = shown(offscreen, ghost(away=(0.0, 0.0, -0.5)), scene)
    assert pixel(behind, 0.0, 0.0) == pixel(bare, 0.0, 0.0)
    within = shown(offscreen, ghost(), scene)
    assert pixel(within, 0.0, 0.0) != pixel(bare, 0.0, 0.0)


def test_wireframe_ghost_has_only_edges(offscreen):
    picture = shown(offscreen, ghost("wireframe"))
    whole = drawn(shown(offscreen, ghost("solid"))).sum()
    assert 0 < drawn(picture).sum() < 0.5 * whole
    assert picture.shape[0] == PIXELS


def test_ghost_does_not_affect_scalar_colours(offscreen):
    plain = shown(offscreen, ghost())
    assert (shown(offscreen, ghost(), shading="scalar") == plain).all()


def test_ghosts_are_replaced_and_freed_once(offscreen):
    first = drawn(shown(offscreen, ghost())).sum()
    half = replace(square(), positions=0.5 * square().positions)
    small = Ghost(Figure("small", half), np.eye(4))
    assert drawn(shown(offscreen, small)).sum() < first
    assert not drawn(shown(offscreen, None)).any()
    assert drawn(shown(offscreen, ghost())).sum() == first


CORNER, CENTER = 24, 12  # vertices of the grid at (1.5, 1.5) and (0, 0)


def marked(*vertices):
    """Return a grid with keypoints at vertices."""
    count = len(vertices)
    points = Keypoints(
        tuple(map(str, vertices)),
        np.full(count, -1),
        np.repeat(np.array(vertices)[:, None], 3, axis=1),
        np.tile([1.0, 0.0, 0.0], (count, 1)),
    )
    return grid_figure(keypoints=points)


def marks(offscreen, scene, **options):
    """Return a mask of the pixels changed by the markers."""
    bare = front_view(offscreen, scene, **options)
    with_them = front_view(offscreen, scene, keypoints=True, **options)
    return np.abs(with_them.astype(int) - bare).max(axis=-1) > 8


def middle(mask):
    """Return the centre of the marked pixels in units of the image plane."""
    rows, columns = np.nonzero(mask)
    x = (columns.mean() + 0.5) * 4 / PIXELS - 2.0
    return x, 2.0 - (rows.mean() + 0.5) * 4 / PIXELS


def test_marker_is_at_the_position_of_its_vertex(offscreen):
    for vertex, place in ((CORNER, (1.5, 1.5)), (CENTER, (0.0, 0.0)), (4, (1.5, -1.5))):
        mask = marks(offscreen, alone(marked(vertex)))
        assert 0 < mask.sum() < 16
        assert middle(mask) == pytest.approx(place, abs=0.05)


def test_marker_follows_pose_and_placement(offscreen):
    scene = alone(marked(CORNER))
    pose = scene.actors[0].pose
    pose.dofs[2] = np.pi / 2
    assert middle(marks(offscreen, scene)) == pytest.approx((-1.5, 1.5), abs=0.05)
    pose.figure_scale, pose.figure_translation[1] = 0.5, -1.0
    assert middle(marks(offscreen, scene)) == pytest.approx((-0.75, -0.25), abs=0.05)
    scene.actors[0].placement[0, 3] = 1.0
    assert middle(marks(offscreen, scene)) == pytest.approx((0.25, -0.25), abs=0.05)


def test_markers_are_visible_through_the_surface(offscreen):
    scene = alone(marked(CENTER))
    cover = Actor(grid_figure())
    cover.placement[2, 3] = 1.0
    scene.actors.append(cover)
    assert middle(marks(offscreen, scene)) == pytest.approx((0.0, 0.0), abs=0.05)


def test_every_keypoint_has_a_marker(offscreen):
    mask = marks(offscreen, alone(marked(CORNER, CENTER, 0, 4, 20)))
    one = marks(offscreen, alone(marked(CENTER)))
    assert 3 * one.sum() < mask.sum() < 7 * one.sum()


def test_keypoint_at_a_joint_is_drawn_at_the_joint(offscreen):
    figure = grid_figure()
    points = Keypoints(("hip",), [1], [[0, 0, 0]], [[1.0, 0, 0]])
    bones = replace(figure.skeleton, rest_translations=[[0, 0, 0], [1.0, -1.0, 0.0]])
    mask = marks(offscreen, alone(replace(figure, skeleton=bones, keypoints=points)))
    assert middle(mask) == pytest.approx((1.0, -1.0), abs=0.05)


def test_figure_without_keypoints_has_no_markers(offscreen):
    assert not marks(offscreen, alone(grid_figure())).any()
    assert not marks(offscreen, alone(marked(CENTER)), show="binding").any()
    scene = alone(marked(CENTER))
    scene.actors[0].visible = False
    assert not marks(offscreen, scene).any()
    assert not marks(offscreen, alone(marked())).any()


def test_markers_are_drawn_over_a_skeleton_without_a_skin(offscreen):
    scene = alone(marked(CORNER))
    picture = front_view(offscreen, scene, show="skeleton", keypoints=True)
    found = drawn(picture).copy()
    found[20:60, 20:60] = False  # the joints themselves
    assert middle(found) == pytest.approx((1.5, 1.5), abs=0.05)


def test_marker_size_depends_on_the_figure_not_on_the_image(offscreen):
    small, large = alone(marked(CENTER)), alone(marked(CENTER))
    large.actors[0].placement[:3, :3] *= 4.0
    # Cubes of 1.2 % of the figure's diagonal of 3 sqrt 2, seen from the front, have sides of 1.02
    # pixels.
    assert 1 <= marks(offscreen, small).sum() <= 4
    assert 16 <= marks(offscreen, large).sum() <= 25


def test_markers_of_removed_actors_are_freed(offscreen):
    scene = alone(marked(CENTER))
    front_view(offscreen, scene, keypoints=True)
    assert len(offscreen.renderer.buffers.keypoints) == 1
    front_view(offscreen, alone(grid_figure()), keypoints=True)
    assert len(offscreen.renderer.buffers.keypoints) == 0
