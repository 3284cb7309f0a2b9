"""Single pixels, compared with hand calculation: orientation, colours, and transparency."""

from dataclasses import replace

import numpy as np
import pytest
from rendering.drawn_figures import arm, bent, picture, scene_of, skeleton, sphere, square
from rendering.plain_pictures import WHITE, covered, draw, front, lights, near, plain, srgb

from viewer.errors import ViewerError
from viewer.rendering.options import Lights
from viewer.rendering.passes.mesh_pass import SKIN_COLOR
from viewer.rigs.figure import Figure
from viewer.rigs.mesh import Mesh
from viewer.rigs.scene import Actor, Scene

RED, GREEN, BLUE, YELLOW = (220, 30, 30), (30, 200, 40), (40, 50, 230), (230, 210, 50)


# Positions


def test_square_covers_the_expected_pixels(offscreen):
    """-1 to 1 of -2 to 2 on 100 pixels are columns 25 to 74."""
    assert covered(draw(offscreen, scene_of(square()))) == (25, 74, 25, 74)


def test_perspective_covers_the_expected_pixels(offscreen):
    """At a distance of 2, 1 unit nearer doubles the size, so -0.5 to 0.5 looks like -1 to 1."""
    camera = front(orthographic=False)
    assert covered(draw(offscreen, scene_of(square(1.0, 0.5)), camera=camera)) == (25, 74, 25, 74)


def test_orthographic_size_does_not_depend_on_depth(offscreen):
    for z in (-0.9, 0.9):
        assert covered(draw(offscreen, scene_of(square(z)))) == (25, 74, 25, 74)


def test_x_is_right_and_y_is_up(offscreen):
    mesh = square(half=0.2)
    moved = replace(mesh, positions=mesh.positions + np.array([1.2, 0.8, 0.0]))
    # x 1.0 to 1.4 is column 75 to 84; y 0.6 to 1.0 is row 25 to 34 from the top.
    assert covered(draw(offscreen, scene_of(moved))) == (25, 34, 75, 84)


def test_placement_moves_an_actor(offscreen):
    scene = scene_of(square(half=0.2))
    scene.actors[0].placement[:3, 3] = 1.2, 0.8, 0.0
    assert covered(draw(offscreen, scene)) == (25, 34, 75, 84)


def test_figure_far_from_the_origin_is_drawn_at_its_position(offscreen):
    """10,000 units away, float32 has steps of 0.001; a square of 0.02 units keeps its pixels."""
    mesh = square(half=0.01)
    far = np.array([10_000.0, 5_000.0, -8_000.0])
    moved = replace(mesh, positions=mesh.positions + far)
    camera = front(target=far, distance=0.02)
    assert covered(draw(offscreen, scene_of(moved), camera=camera)) == (25, 74, 25, 74)


def test_nearer_surface_hides_the_farther_one(offscreen):
    back, ahead = square(-0.5, 1.0, picture([[RED]])), square(0.5, 0.5, picture([[GREEN]]))
    for order in ((back, ahead), (ahead, back)):
        pixels = draw(offscreen, scene_of(*order))
        assert near(pixels[50, 50], GREEN)
        assert near(pixels[30, 30], RED)


def test_visible_actors_are_drawn_and_hidden_actors_are_not(offscreen):
    scene = scene_of(square(half=0.3), square(half=0.3))
    scene.actors[0].placement[0, 3], scene.actors[1].placement[0, 3] = -1.0, 1.0
    alpha = draw(offscreen, scene)[..., 3]
    assert (alpha[50, 25], alpha[50, 50], alpha[50, 75]) == (255, 0, 255)
    scene.actors[1].visible = False
    alpha = draw(offscreen, scene)[..., 3]
    assert (alpha[50, 25], alpha[50, 75]) == (255, 0)


# Both sides of surfaces


def test_clockwise_mesh_looks_like_a_counter_clockwise_one(offscreen):
    options = plain(lights=Lights())
    first = draw(offscreen, scene_of(square()), options)
    second = draw(offscreen, scene_of(square(clockwise=True)), options)
    np.testing.assert_array_equal(first, second)


def test_clockwise_ball_looks_like_a_counter_clockwise_one(offscreen):
    ball = sphere(20)
    turned = replace(ball, triangles=ball.triangles[:, ::-1], triangle_materials=None)
    for flat in (False, True):
        options = plain(lights=Lights(), flat=flat)
        first, second = (draw(offscreen, scene_of(mesh), options) for mesh in (ball, turned))
        # The same surface is rasterised from a different corner, which causes one step of rounding.
        assert np.abs(first.astype(int) - second).max() <= 2


def test_surface_is_lit_equally_from_behind(offscreen):
    options = plain(lights=lights(0.1, 0.6, azimuth=20.0))
    ahead = draw(offscreen, scene_of(square()), options, front())
    behind = draw(offscreen, scene_of(square()), options, front(azimuth=180.0))
    assert np.abs(ahead.astype(int) - behind).max() <= 1


def test_inward_normals_are_lit_equally(offscreen):
    ball = sphere(20)
    inward = replace(ball, normals=-ball.normals)
    options = plain(lights=Lights())
    first, second = (draw(offscreen, scene_of(mesh), options) for mesh in (ball, inward))
    assert (np.abs(first.astype(int) - second).max(axis=2) > 2).mean() < 0.01


def test_back_faces_are_culled_only_on_request(offscreen):
    for clockwise, visible in ((False, True), (True, False)):
        scene = scene_of(square(clockwise=clockwise))
        assert draw(offscreen, scene)[50, 50, 3] == 255
        culled = draw(offscreen, scene, plain(cull=True))
        assert bool(culled[50, 50, 3]) is visible


def test_normal_of_length_zero_is_replaced_by_that_of_its_triangle(offscreen):
    mesh = square()
    options = plain(lights=lights(0.0, 0.5))
    zero = replace(mesh, normals=np.zeros((4, 3)))
    np.testing.assert_array_equal(
        draw(offscreen, scene_of(zero), options), draw(offscreen, scene_of(mesh), options)
    )


# Colours


@pytest.mark.parametrize(
    ("linear", "byte"),
    [(0.0, 0), (0.002, 7), (0.0031308, 10), (0.05, 63), (0.21404, 128), (0.5, 188), (0.8, 231)],
)
def test_linear_light_is_encoded_as_srgb(offscreen, linear, byte):
    """The expected bytes are 12.92 x below 0.0031308, otherwise 1.055 x^(1/2.4) - 0.055."""
    assert abs(srgb(linear) - byte) <= 0.51
    options = plain(lights=lights(linear))
    pixels = draw(offscreen, scene_of(square(material=picture([[WHITE]]))), options)
    assert near(pixels[50, 50], [byte] * 3, tolerance=1)


def test_unlit_texture_colours_are_unchanged(offscreen):
    for color in (RED, GREEN, (1, 2, 3), (128, 128, 128), (231, 100, 10)):
        pixels = draw(offscreen, scene_of(square(material=picture([[color]]))))
        assert near(pixels[50, 50], color, tolerance=1)


def test_mesh_without_texture_has_the_skin_colour(offscreen):
    wanted = [srgb(channel) for channel in SKIN_COLOR]
    meshes = [
        square(),
        replace(square(material=picture([[RED]])), uvs=None),
        replace(square(material=replace(picture([[RED]]), base_texture=None))),
    ]
    for mesh in meshes:
        assert near(draw(offscreen, scene_of(mesh))[50, 50], wanted, tolerance=1)
    textured = scene_of(square(material=picture([[RED]])))
    assert near(draw(offscreen, textured, plain(texture=False))[50, 50], wanted, tolerance=1)


@pytest.mark.parametrize(
    ("azimuth", "cosine"), [(0.0, 1.0), (60.0, 0.5), (-60.0, 0.5), (120.0, 0.0)]
)
def test_diffuse_light_follows_the_cosine(offscreen, azimuth, cosine):
    options = plain(lights=lights(0.1, 0.6, azimuth=azimuth))
    pixels = draw(offscreen, scene_of(square(material=picture([[WHITE]]))), options)
    assert near(pixels[50, 50], [srgb(0.1 + 0.6 * cosine)] * 3, tolerance=1)


def test_highlight_follows_blinn_phong(offscreen):
    """With light from 60 degrees, the halfway vector is at 30, and cos^s = 0.75^(s/2)."""
    shiny = lights(0.0, 0.5, azimuth=60.0, specular=0.4, shininess=8.0)
    pixels = draw(offscreen, scene_of(square(material=picture([[WHITE]]))), plain(lights=shiny))
    assert near(pixels[50, 50], [srgb(0.5 * (0.5 + 0.4 * 0.75**4))] * 3, tolerance=1)


def test_lights_follow_the_camera_or_the_scene(offscreen):
    scene = scene_of(sphere(24))
    for follows, same in ((True, True), (False, False)):
        setting = lights(0.1, 0.8, azimuth=60.0, follow_camera=follows)
        first, second = (
            draw(offscreen, scene, plain(lights=setting), front(azimuth=a)) for a in (0.0, 90.0)
        )
        differing = (np.abs(first.astype(int) - second).max(axis=2) > 12).mean()
        assert bool(differing < 0.02) is same


def test_scene_light_comes_from_its_azimuth(offscreen):
    """Azimuth 90 is +x, so the right half is bright when seen from the front."""
    setting = lights(0.0, 1.0, azimuth=90.0, follow_camera=False)
    pixels = draw(offscreen, scene_of(sphere(24)), plain(lights=setting))
    assert pixels[50, 65, 0] > 100
    assert pixels[50, 35, 0] == 0


def test_default_lights_read_as_two_colours(offscreen):
    ball = replace(
        sphere(32),
        materials=(picture([[WHITE]]),),
        triangle_materials=np.zeros(4096, dtype=np.int32),
    )
    camera = front(distance=1.1)
    pixels = draw(offscreen, scene_of(ball), plain(lights=Lights()), camera).astype(int)
    drawn = pixels[..., 3] > 0
    warmth = (pixels[..., 0] - pixels[..., 2])[drawn]
    assert (warmth > 25).mean() > 0.25
    assert (warmth < -25).mean() > 0.05


# Textures


def test_v_of_0_is_the_bottom_row_of_the_texture(offscreen):
    mesh = square(material=picture([[RED, GREEN], [BLUE, YELLOW]]))
    pixels = draw(offscreen, scene_of(mesh))
    assert near(pixels[27, 27], RED)
    assert near(pixels[27, 72], GREEN)
    assert near(pixels[72, 27], BLUE)
    assert near(pixels[72, 72], YELLOW)


def test_textures_are_clamped_not_repeated(offscreen):
    mesh = square(material=picture([[RED, GREEN], [BLUE, YELLOW]]))
    wide = replace(mesh, uvs=5.0 * mesh.uvs - 2.0)
    pixels = draw(offscreen, scene_of(wide))
    for row, left, right in ((26, RED, GREEN), (40, RED, GREEN), (60, BLUE, YELLOW)):
        for column in (26, 35, 40):
            assert near(pixels[row, column], left)
            assert near(pixels[row, 99 - column], right)


def test_every_run_of_triangles_has_its_own_material(offscreen):
    """Squares side by side have textures 0 and 1, then none, then 0 again."""
    squares = [square(half=0.2) for _ in range(4)]
    positions = np.concatenate(
        [
            s.positions + np.array([x, 0, 0])
            for s, x in zip(squares, (-1.2, -0.4, 0.4, 1.2), strict=True)
        ]
    )
    mesh = Mesh(
        positions,
        np.tile([0.0, 0.0, 1.0], (16, 1)),
        np.concatenate([s.triangles + 4 * i for i, s in enumerate(squares)]),
        np.concatenate([s.uvs for s in squares]),
        (picture([[RED]]), picture([[BLUE]])),
        np.array([0, 0, 1, 1, -1, -1, 0, 0], dtype=np.int32),
    )
    pixels = draw(offscreen, scene_of(mesh))
    skin = [srgb(channel) for channel in SKIN_COLOR]
    for column, color in ((20, RED), (40, BLUE), (60, skin), (80, RED)):
        assert near(pixels[50, column], color)


def test_distant_texture_is_averaged_in_linear_light(offscreen):
    """Half black and half white is linear 0.5, which is sRGB 188, not 128."""
    fine = np.add.outer(np.arange(256), np.arange(256)) % 2
    mesh = square(half=0.5, material=picture(np.where(fine[..., None], 255, 0) * np.ones(3, int)))
    assert near(draw(offscreen, scene_of(mesh))[50, 50], [188] * 3, tolerance=4)


def test_checker_pattern_needs_no_texture(offscreen):
    pixels = draw(offscreen, scene_of(square()), plain(shading="checker"))
    square_colors = {tuple(pixels[row, 50, :3]) for row in range(26, 74)}
    assert len(square_colors) > 2
    bare = draw(offscreen, scene_of(replace(square(), uvs=None)), plain(shading="checker"))
    assert len({tuple(pixel) for pixel in bare[26:74, 50, :3]}) == 1


def test_normals_are_shown_as_colours(offscreen):
    """A normal towards the eye is (0.5, 0.5, 1) before squaring, (0.25, 0.25, 1) linear."""
    pixels = draw(offscreen, scene_of(square()), plain(shading="normals"))
    assert near(pixels[50, 50], [srgb(0.25), srgb(0.25), 255])


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
