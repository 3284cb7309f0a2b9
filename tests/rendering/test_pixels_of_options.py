"""Pixels of display options: shading, grid, background, boxes, highlights, and samples."""

from dataclasses import replace

import numpy as np
import pytest
from rendering.drawn_figures import arm, bent, picture, scene_of, skeleton, sphere, square
from rendering.plain_pictures import WHITE, covered, draw, front, lights, near, plain, srgb

from viewer.errors import ViewerError
from viewer.rendering.passes.mesh_pass import SKIN_COLOR
from viewer.rig.figure import Figure
from viewer.rig.scene import Actor, Scene

# Display options


def test_flat_shading_has_one_colour_per_triangle(offscreen):
    ball = sphere(4)
    options = plain(lights=lights(0.1, 0.7, azimuth=30.0))
    smooth, flat = (
        draw(offscreen, scene_of(ball), replace(options, flat=value)) for value in (False, True)
    )
    counts = [len(np.unique(p[p[..., 3] > 0][:, 0])) for p in (smooth, flat)]
    assert counts[1] <= ball.n_triangles // 2 + 4
    assert counts[0] > 2 * counts[1]


def test_wireframe_draws_dark_edges_and_keeps_the_colour_between_them(offscreen):
    scene = scene_of(square(material=picture([[WHITE]])))
    options = plain(wireframe=True)
    pixels = draw(offscreen, scene, options)
    dark = pixels[..., 0] < 160
    # The diagonal runs from the lower left to the upper right corner, one pixel per row.
    diagonal = [dark[row, 98 - row : 101 - row].any() for row in range(27, 73)]
    assert np.mean(diagonal) > 0.95
    # The tone curve maps 1 to 0.9; see test_tone.py.
    assert near(pixels[35, 35], [srgb(0.9)] * 3)
    assert near(pixels[65, 65], [srgb(0.9)] * 3)


def test_vertex_normals_stick_out_by_a_fiftieth_of_the_size(offscreen):
    """A ball of radius 1 has a size of 2 sqrt 3, so lines end 0.069 or 1.7 pixels outside."""
    options = plain(normals=True)
    without = draw(offscreen, scene_of(sphere(12)))
    with_lines = draw(offscreen, scene_of(sphere(12)), options)
    first, last = covered(without)[0], covered(with_lines)[0]
    assert 1 <= first - last <= 2
    cyan = (with_lines[..., 0].astype(int) < 60) & (with_lines[..., 2] > 150)
    assert cyan.sum() > 50


def test_wireframe_can_be_switched_off(offscreen):
    scene = scene_of(square(material=picture([[WHITE]])))
    wanted = draw(offscreen, scene)
    draw(offscreen, scene, plain(wireframe=True, normals=True))
    np.testing.assert_array_equal(draw(offscreen, scene), wanted)


def test_gradient_runs_from_dark_above_to_light_below(offscreen):
    scene = Scene([])
    pixels = draw(offscreen, scene, plain(background="gradient"))
    heights = pixels[..., :3].astype(float).mean(axis=(1, 2))
    assert (np.diff(heights) > 0).all()
    # The centres of the first and last rows are half a pixel from the ends.
    assert near(pixels[0, 50], 255 * np.array([0.36, 0.43, 0.52]), tolerance=3)
    assert near(pixels[-1, 50], 255 * np.array([0.80, 0.83, 0.86]), tolerance=3)
    assert (pixels[..., 3] == 255).all()


def test_background_colour_is_drawn_as_given(offscreen):
    pixels = draw(offscreen, Scene([]), plain(background="#336699"))
    assert near(pixels, (0x33, 0x66, 0x99), tolerance=1)
    assert (pixels[..., 3] == 255).all()


@pytest.mark.parametrize("text", ["blue", "#12345", "#1234567", "#12345g", "", "336699"])
def test_invalid_background_is_refused(offscreen, text):
    with pytest.raises(ViewerError, match=r'background: expected "gradient", .* or "#'):
        draw(offscreen, Scene([]), plain(background=text))


def test_transparent_background_has_alpha_0(offscreen):
    pixels = draw(offscreen, scene_of(square()))
    assert (pixels[:20] == 0).all()
    assert (pixels[30:70, 30:70, 3] == 255).all()


def test_edges_have_straight_alpha(offscreen):
    """A half-covered pixel has half alpha and the unchanged colour of the figure."""
    ball = replace(sphere(32), uvs=None)
    options = plain(samples=4)
    pixels = draw(offscreen, scene_of(ball), options)
    alpha = pixels[..., 3].astype(float)
    partial = (alpha > 0) & (alpha < 255)
    if offscreen.context.max_samples < 4:
        pytest.skip("no multisampling here")
    assert partial.sum() > 50
    wanted = np.array([srgb(channel) for channel in SKIN_COLOR])
    error = np.abs(pixels[partial][:, :3] - wanted).max(axis=1)
    # Colours are stored premultiplied in 8 bits, then divided by alpha.
    assert (error <= 1.0 + 255.0 / alpha[partial]).all()


def test_grid_lines_are_drawn_only_on_request(offscreen):
    scene = scene_of(sphere(16))
    camera = front(inclination=30.0, orthographic=False, distance=3.0)
    without, with_grid = (
        draw(offscreen, scene, plain(grid=value), camera)[..., 3] for value in (False, True)
    )
    outside = without == 0
    assert (with_grid[outside] > 0).mean() > 0.1
    assert (with_grid[~outside] == 255).all()


def test_grid_does_not_hide_the_figure(offscreen):
    """The grid is below the figure, which is visible from below between and behind the lines."""
    scene = scene_of(sphere(16))
    camera = front(inclination=-50.0, distance=3.0)
    with_grid = draw(offscreen, scene, plain(grid=True), camera)
    assert with_grid[50, 50, 3] == 255
    assert with_grid[..., 3].min() == 0


def box_figure(box) -> Figure:
    return Figure("box", None, skeleton([-1], np.zeros((1, 3)), np.array([box], dtype=float)))


@pytest.mark.parametrize(
    ("box", "wanted"),
    [
        ([[-1, -0.4, -0.2], [0.6, 1, 0.2]], (25, 59, 25, 64)),
        ([[0.6, 1, 0.2], [-1, -0.4, -0.2]], (25, 59, 25, 64)),
        ([[-1, -0.4, 0.3], [0.6, 1, 0.3]], (25, 59, 25, 64)),
    ],
    ids=["a box", "inverted", "flat"],
)
def test_boxes_cover_the_expected_pixels(offscreen, box, wanted):
    scene = Scene([Actor(box_figure(box))])
    pixels = draw(offscreen, scene, plain(show="skeleton"))
    assert covered(pixels) == wanted
    assert pixels[pixels[..., 3] > 0][:, :3].max(axis=1).min() > 80


def test_flat_box_is_lit_from_both_sides(offscreen):
    scene = Scene([Actor(box_figure([[-1, -1, 0], [1, 1, 0]]))])
    options = plain(lights=lights(0.1, 0.6))
    ahead, behind = (
        draw(offscreen, scene, options, front(azimuth=azimuth))[50, 50] for azimuth in (0.0, 180.0)
    )
    assert np.abs(ahead.astype(int) - behind).max() <= 1
    assert ahead[:3].max() > 100


def test_boxes_follow_the_pose(offscreen):
    """A box along x that is rotated by 90 degrees about z is upright."""
    figure = box_figure([[0, -0.1, -0.1], [1, 0.1, 0.1]])
    first, last, left, right = covered(draw(offscreen, Scene([bent(figure, (0, "z", np.pi / 2))])))
    assert abs(first - 25) <= 1 and abs(last - 49) <= 1
    assert abs(left - 47) <= 1 and abs(right - 52) <= 1


def test_only_the_selected_joint_is_highlighted(offscreen):
    figure = arm(3)
    camera = front(target=np.array([1.5, 0.0, 0.0]))
    scene = Scene([Actor(figure)])
    options = plain(show="skeleton")
    before = draw(offscreen, scene, options, camera)
    after = draw(offscreen, scene, options, camera, selected=1)
    changed = (before != after).any(axis=2)
    columns = np.nonzero(changed.any(axis=0))[0]
    # The box of joint 1 is from 1.1 to 1.9, 0.4 from the centre, in columns 40 to 59.
    assert (columns.min(), columns.max()) == (40, 59)
    red, green, blue = after[50, 50, :3].astype(int)
    assert red > green + 40 > blue + 80


def test_bind_pose_shows_the_unposed_mesh(offscreen):
    figure = arm(3)
    posed = Scene([bent(figure, (1, "z", 1.0))])
    camera = front(target=np.array([1.5, 0.0, 0.0]))
    binding = draw(offscreen, posed, plain(show="binding"), camera)
    unposed = draw(offscreen, scene_of(figure.mesh), plain(), camera)
    np.testing.assert_array_equal(binding, unposed)
    assert (draw(offscreen, posed, plain(), camera) != binding).any()


def both_figure() -> Figure:
    """Return a square of side 0.5 and two boxes of side 1.6 around it, one behind the other."""
    boxes = np.array([[[-0.8, -0.8, -0.1], [0.8, 0.8, 0.1]], [[-0.8, -0.8, 0.4], [0.8, 0.8, 0.5]]])
    return Figure("both", square(half=0.25), skeleton([-1, 0], np.zeros((2, 3)), boxes))


def test_showing_both_draws_the_boxes_as_one_translucent_layer(offscreen):
    """Each of the two boxes has two faces along a ray, but they are drawn as one layer."""
    scene = Scene([Actor(both_figure())])
    pixels = draw(offscreen, scene, plain(show="both", skeleton_opacity=0.4))
    assert set(np.unique(pixels[..., 3])) == {0, 102, 255}  # background, 0.4 of 255, and the square
    assert (pixels[45:55, 45:55, 3] == 255).all()


def test_showing_both_tints_the_skin_with_the_nearest_boxes(offscreen):
    scene = Scene([Actor(both_figure())])
    box = draw(offscreen, scene, plain(show="skeleton"))[50, 50, :3].astype(float)
    both = draw(offscreen, scene, plain(show="both", skeleton_opacity=0.4))[50, 50, :3]
    wanted = 0.4 * box + 0.6 * np.array([srgb(channel) for channel in SKIN_COLOR])
    assert np.abs(both - wanted).max() <= 1.5


def test_showing_both_restores_the_gl_state(offscreen):
    """Masks and depth tests are restored for the next image."""
    scene = Scene([Actor(both_figure())])
    wanted = draw(offscreen, scene_of(sphere(16)))
    draw(offscreen, scene, plain(show="both"))
    np.testing.assert_array_equal(draw(offscreen, scene_of(sphere(16))), wanted)


def test_figure_without_a_mesh_shows_its_skeleton_as_skin(offscreen):
    scene = Scene([Actor(box_figure([[-1, -1, -1], [1, 1, 1]]))])
    assert covered(draw(offscreen, scene, plain())) == (25, 74, 25, 74)


def test_figure_without_a_skeleton_shows_its_mesh_as_skeleton(offscreen):
    assert covered(draw(offscreen, scene_of(square()), plain(show="skeleton"))) == (25, 74, 25, 74)


def test_one_sample_has_hard_edges_and_four_samples_have_soft_edges(offscreen):
    if offscreen.context.max_samples < 4:
        pytest.skip("no multisampling here")
    scene = scene_of(sphere(24))
    levels = {}
    for samples in (1, 4):
        levels[samples] = set(np.unique(draw(offscreen, scene, plain(samples=samples))[..., 3]))
    assert levels[1] == {0, 255}
    assert len(levels[4]) == 5


def test_more_samples_than_supported_use_the_maximum(offscreen):
    scene = scene_of(sphere(24))
    most = offscreen.context.max_samples
    np.testing.assert_array_equal(
        draw(offscreen, scene, plain(samples=4096)), draw(offscreen, scene, plain(samples=most))
    )


def test_empty_scene_shows_only_the_background(offscreen):
    assert not draw(offscreen, Scene([])).any()
