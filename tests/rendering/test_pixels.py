"""Single pixels, compared with hand calculation: orientation, colours, and transparency."""

from dataclasses import replace

import numpy as np
import pytest
from rendering.drawn_figures import picture, scene_of, sphere, square
from rendering.plain_pictures import WHITE, covered, draw, front, lights, near, plain, srgb

from viewer.rendering.options import Lights
from viewer.rendering.passes.mesh_pass import SKIN_COLOR
from viewer.rig.mesh import Mesh

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
