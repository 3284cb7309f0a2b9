"""Pixels of toon materials: rim light, matcap, outlines, and materials that expressions change."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from rendering.drawn_figures import sphere
from rendering.front_view import (
    WHITE,
    alone,
    dark,
    draw,
    drawn,
    encoded,
    front_view,
    grid_figure,
    painted,
    pixel,
    texture,
)

from viewer.rendering.camera import Camera
from viewer.rendering.options import DisplayOptions
from viewer.rigs.blendshapes import BlendShapes
from viewer.rigs.expressions import ExpressionRules, MaterialBinds
from viewer.rigs.figure import Figure
from viewer.rigs.material import Material, Outline, Rim
from viewer.rigs.scene import Actor, Scene, scene_box

DARK = (0.0, 0.0, 0.0)
# The material is in shade for all directions of the light, so that only the rim is visible.
SHADED = Material(
    "", None, WHITE, unlit=True, shade_color=DARK, shade_range=(2.0, 3.0), is_physical=True
)
RADIUS = 1.0
UNIT = 20.0  # pixels


def ball(outline: Outline | None, **changes) -> Figure:
    material = replace(SHADED, outline=outline, shade_color=(1.0, 1.0, 1.0), **changes)
    mesh = replace(sphere(radius=RADIUS, rings=48, sides=96), materials=(material,))
    mesh = replace(mesh, triangle_materials=np.zeros(mesh.n_triangles, np.int32))
    return Figure("ball", mesh, unit="m")


# Rim light


@pytest.mark.parametrize(
    ("lift", "power", "fraction"), [(1.0, 5.0, 1.0), (0.5, 2.0, 0.25), (0, 3, 0)]
)
def test_rim_light_increases_with_the_angle_to_the_eye(offscreen, lift, power, fraction):
    """On a surface that faces the eye, n . v = 1."""
    rim = Rim((0.8, 0.4, 0.2), power, lift)
    shown = draw(offscreen, replace(SHADED, rim=rim), shadows=False)
    wanted = encoded(fraction * np.array([0.8, 0.4, 0.2]))
    assert_allclose(pixel(shown, 0, 0)[:3], wanted, atol=2)


def test_rim_light_at_the_edge_of_a_ball_follows_the_formula(offscreen):
    figure = ball(None, rim=Rim((0.5, 0.5, 0.5), 2.0))
    mesh = figure.require_mesh()
    black = replace(mesh.materials[0], shade_color=DARK)
    figure = replace(figure, mesh=replace(mesh, materials=(black,)))
    shown = front_view(offscreen, alone(figure), lights=dark(), shadows=False)
    for x in (0.325, 0.625, 0.825):
        height = np.sqrt(1.0 - x**2)
        assert abs(pixel(shown, x, 0.025)[0] - encoded(0.5 * (1.0 - height) ** 2)) < 6


def test_matcap_and_rim_texture_multiply(offscreen):
    # The matcap is sampled in the middle, between four texels.
    matcap = texture([(255, 0, 0), (255, 0, 0)], [(255, 0, 0), (255, 0, 0)])
    rim = Rim(matcap=matcap, matcap_factor=(0.5, 1.0, 1.0))
    shown = draw(offscreen, replace(SHADED, rim=rim), shadows=False)
    assert_allclose(pixel(shown, 0, 0)[:3], encoded([0.5, 0, 0]), atol=2)
    half = texture([(188, 188, 188)])
    shown = draw(offscreen, replace(SHADED, rim=replace(rim, texture=half)), shadows=False)
    assert_allclose(pixel(shown, 0, 0)[:3], encoded([0.25, 0, 0]), atol=2)


def test_matcap_is_relative_to_the_eye(offscreen):
    matcap = texture([(255, 0, 0), (0, 255, 0)], [(0, 0, 255), (255, 255, 255)])
    mesh = ball(None, rim=Rim(matcap=matcap)).require_mesh()
    black = replace(mesh.materials[0], shade_color=DARK)
    figure = Figure("ball", replace(mesh, materials=(black,)))
    shown = front_view(offscreen, alone(figure), lights=dark(), shadows=False)
    corners = {(-0.6, 0.6): (255, 0, 0), (0.6, 0.6): (0, 255, 0), (-0.6, -0.6): (0, 0, 255)}
    for (x, y), color in corners.items():
        assert_allclose(pixel(shown, x, y)[:3], color, atol=40)


def test_toon_materials_ignore_vertex_colours(offscreen):
    """VRMC_materials_mtoon 1.0 requires this; vertex colours multiply those of other materials."""
    lit = replace(SHADED, base_color=(1.0, 1.0, 0.0, 1.0), shade_range=(-3.0, -2.0))
    plain = replace(lit, shade_color=None)
    for material, wanted in ((lit, [255, 255, 0]), (plain, [255, 0, 0])):
        figure = painted(material)
        red = np.tile([1.0, 0.0, 0.0, 1.0], (4, 1))
        figure = replace(figure, mesh=replace(figure.require_mesh(), colors=red))
        shown = front_view(offscreen, alone(figure), lights=dark(), shadows=False)
        assert_allclose(pixel(shown, 0, 0)[:3], wanted, atol=2)


# Outlines


def radius_of(picture: np.ndarray) -> float:
    """Return the radius of the covered disk in pixels."""
    return float(np.sqrt(drawn(picture).sum() / np.pi))


def shown_ball(offscreen, outline: Outline | None, scale: float = 1.0, **changes) -> np.ndarray:
    actor = Actor(ball(outline, **changes), placement=np.diag([scale, scale, scale, 1.0]))
    return front_view(offscreen, Scene([actor]), lights=dark(), shadows=False)


@pytest.mark.parametrize(("scale", "unit"), [(1.0, "m"), (1.5, "m"), (1.0, "cm")])
def test_world_outlines_are_as_wide_as_stated(offscreen, scale, unit):
    width = 0.2 if unit == "m" else 0.002
    figure = replace(ball(Outline(width, "world", (1.0, 0.0, 0.0), 0.0)), unit=unit)
    actor = Actor(figure, placement=np.diag([scale, scale, scale, 1.0]))
    shown = front_view(offscreen, Scene([actor]), lights=dark(), shadows=False)
    # One pixel is 0.05 m.
    assert radius_of(shown) == pytest.approx(1.2 * scale * UNIT, abs=0.5)
    assert pixel(shown, 1.1 * scale, 0.0)[:3] == [255, 0, 0]
    assert pixel(shown, 0.0, 0.0)[:3] == [255, 255, 255]


@pytest.mark.parametrize("distance", [4.0, 8.0])
def test_screen_outlines_have_the_same_width_at_any_distance(offscreen, distance):
    radii = []
    for outline in (None, Outline(0.05, "screen", (1.0, 0.0, 0.0), 0.0)):
        scene = alone(ball(outline))
        camera = Camera(azimuth=0.0, inclination=0.0, fov=40.0, distance=distance)
        shown = DisplayOptions(background="transparent", grid=False, samples=1, shadows=False)
        picture = offscreen.render(scene, (200, 200), camera, shown, scene_box(scene))
        radii.append(radius_of(picture))
    assert radii[1] - radii[0] == pytest.approx(0.05 * 200, abs=1.0)


def test_colour_of_the_surface_multiplies_that_of_the_outline(offscreen):
    blue = {"shade_range": (-3.0, -2.0), "base_color": (0.5, 0.5, 1.0, 1.0)}
    for mix, color in ((0.0, (1.0, 0.5, 0.5)), (1.0, (0.5, 0.25, 0.5)), (0.5, (0.75, 0.375, 0.5))):
        outline = Outline(0.3, "world", (1.0, 0.5, 0.5), mix)
        shown = shown_ball(offscreen, outline, **blue)
        assert_allclose(pixel(shown, 1.15, 0.0)[:3], encoded(color), atol=2)


def test_width_texture_scales_the_width(offscreen):
    half = texture([(0, 128, 255)])
    outline = Outline(0.4, "world", (1.0, 0.0, 0.0), 0.0, half)
    figure = ball(outline)
    mesh = figure.require_mesh()
    uvs = np.zeros((mesh.n_vertices, 2))
    figure = replace(figure, mesh=replace(mesh, uvs=uvs, uv_triangles=mesh.triangles))
    shown = front_view(offscreen, alone(figure), lights=dark(), shadows=False)
    assert radius_of(shown) == pytest.approx(1.2 * UNIT, abs=0.5)


def test_other_shadings_have_no_outlines(offscreen):
    figure = ball(Outline(0.3))
    for shading, radius in (("auto", 1.3), ("pbr", 1.3), ("matcap", 1.0), ("phong", 1.0)):
        shown = front_view(offscreen, alone(figure), lights=dark(), shadows=False, shading=shading)
        assert radius_of(shown) == pytest.approx(radius * UNIT, abs=0.5), shading


def test_translucent_surfaces_have_outlines(offscreen):
    clear = {"alpha_mode": "blend", "base_color": (1.0, 1.0, 1.0, 0.5)}
    shown = shown_ball(offscreen, Outline(0.2, color=(1.0, 0.0, 0.0), mix=0.0), **clear)
    assert radius_of(shown) == pytest.approx(1.2 * UNIT, abs=0.5)
    assert pixel(shown, 1.1, 0.0)[3] == pytest.approx(128, abs=1)


def test_crowds_have_outlines(offscreen):
    figure = ball(Outline(0.2))
    actors = [Actor(figure) for _ in range(12)]
    shown = front_view(offscreen, Scene(actors), lights=dark(), shadows=False)
    assert radius_of(shown) == pytest.approx(1.2 * UNIT, abs=0.5)


# Materials changed by expressions


def blushing(kind: str, target: tuple[float, ...], **material) -> Actor:
    """Return a square with an expression that changes only its material."""
    figure = grid_figure()
    mesh = figure.require_mesh()
    look = replace(SHADED, shade_range=(-3.0, -2.0), **material)
    mesh = replace(
        mesh,
        materials=(look,),
        triangle_materials=np.zeros(mesh.n_triangles, np.int32),
        uvs=mesh.positions[:, :2] / 3.0 + 0.5,
        uv_triangles=mesh.triangles,
    )
    shapes = BlendShapes(
        ("blush",),
        np.zeros((1, mesh.n_vertices, 3)),
        ("morph",),
        rules=ExpressionRules(np.array([0]), np.array([False]), np.array([-1]), np.zeros((1, 3))),
        material_binds=MaterialBinds(np.array([0]), np.array([0]), (kind,), np.array([target])),
    )
    return Actor(replace(figure, mesh=mesh, blend_shapes=shapes))


@pytest.mark.parametrize(
    ("kind", "material"),
    [
        ("color", {}),
        ("emissionColor", {"base_color": (0.0, 0.0, 0.0, 1.0), "emissive": (1.0, 1.0, 1.0)}),
        ("shadeColor", {"shade_range": (2.0, 3.0), "shade_color": (1.0, 1.0, 1.0)}),
        ("rimColor", {"base_color": (0, 0, 0, 1.0), "rim": Rim((1.0, 1.0, 1.0), lift=1.0)}),
    ],
)
def test_sliders_blend_colours(offscreen, kind, material):
    look = {"base_color": WHITE, **material}
    shade = look.pop("shade_range", (-3.0, -2.0))
    actor = blushing(kind, (1.0, 0.25, 0.0, 1.0), **look)
    mesh = actor.figure.require_mesh()
    changed = replace(mesh, materials=(replace(mesh.materials[0], shade_range=shade),))
    actor = Actor(replace(actor.figure, mesh=changed))
    for weight, color in (
        (0.0, (1, 1, 1)),
        (0.5, (1, 0.625, 0.5)),
        (1.0, (1, 0.25, 0)),
        (0.0, (1, 1, 1)),
    ):
        actor.pose.shape_weights[:] = weight
        shown = front_view(offscreen, Scene([actor]), lights=dark(), shadows=False)
        assert_allclose(pixel(shown, 0.1, 0.1)[:3], encoded(color), atol=2)


def test_actors_of_one_figure_can_have_different_materials(offscreen):
    actor = blushing("color", (1.0, 0.0, 0.0, 1.0))
    left, right = actor, Actor(actor.figure)
    left.placement, right.placement = np.diag([0.5, 1, 1, 1.0]), np.diag([0.5, 1, 1, 1.0])
    left.placement[0, 3], right.placement[0, 3] = -1.0, 1.0
    left.pose.shape_weights[:] = 1.0
    shown = front_view(offscreen, Scene([left, right]), lights=dark(), shadows=False)
    assert pixel(shown, -1.0, 0.1)[:3] == [255, 0, 0]
    assert pixel(shown, 1.0, 0.1)[:3] == [255, 255, 255]


def test_crowds_show_their_expression(offscreen):
    actor = blushing("color", (1.0, 0.0, 0.0, 1.0))
    actors = [Actor(actor.figure) for _ in range(12)]
    for each in actors:
        each.pose.shape_weights[:] = 1.0
    shown = front_view(offscreen, Scene(actors), lights=dark(), shadows=False)
    assert pixel(shown, 0.1, 0.1)[:3] == [255, 0, 0]


def test_opacity_of_blended_materials_changes(offscreen):
    actor = blushing("color", (1.0, 1.0, 1.0, 0.25), alpha_mode="blend", base_color=WHITE)
    actor.pose.shape_weights[:] = 1.0
    shown = front_view(offscreen, Scene([actor]), lights=dark(), shadows=False)
    assert pixel(shown, 0.1, 0.1)[3] == pytest.approx(64, abs=1)


def test_textures_are_moved(offscreen):
    """The left half of the picture is red; an offset of a half shows the right half there."""
    halves = texture([(255, 0, 0), (0, 255, 0)], wrap=("repeat", "repeat"), is_smooth=False)
    actor = blushing("transform", (1.0, 1.0, 0.5, 0.0), base_texture=halves)
    colors = []
    for weight in (0.0, 1.0):
        actor.pose.shape_weights[:] = weight
        shown = front_view(offscreen, Scene([actor]), lights=dark(), shadows=False)
        colors.append(pixel(shown, -0.7, 0.1)[:3])
    assert colors == [[255, 0, 0], [0, 255, 0]]
