"""Colors of surfaces, mipmaps of textures, and the light of the studio."""

import math
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import moderngl
import numpy as np
import pytest
from numpy.testing import assert_allclose
from rendering.drawn_figures import square
from rendering.front_view import (
    WHITE,
    alone,
    dark,
    draw,
    encoded,
    front_view,
    painted,
    pixel,
    texture,
)

from viewer.rendering.gpu.ownership import Owner
from viewer.rendering.gpu.surfaces import upload_surfaces
from viewer.rendering.gpu.upload import picture_texture, reduced
from viewer.resources import resource
from viewer.rigs.figure import Figure
from viewer.rigs.material import Material
from viewer.rigs.scene import Actor, Scene

# Textures


def test_textures_use_their_set_of_coordinates(offscreen):
    """All four sets of coordinates are tested; opacity is read from the texel of the colour."""
    colors = [(255, 0, 0), (0, 255, 0)], [(0, 0, 255), (255, 255, 255)]
    uvs = square().uvs
    sets = (np.full_like(uvs, 0.25), uvs[:, ::-1], np.full_like(uvs, 0.75), uvs * -1.0)
    seen = []
    for number in range(1, 5):
        made = texture(*colors, is_smooth=False, uv_set=number, wrap=("repeat", "repeat"))
        light = Material("", made, unlit=True, is_physical=True, emissive_texture=made)
        shown = front_view(offscreen, alone(painted(light, other_uvs=sets)), lights=dark())
        seen.append(tuple(pixel(shown, -0.5, 0.5)[:3]))
    # Texels at (0.25, 0.25), (0.75, 0.25), (0.75, 0.75) and (-0.25, -0.75).
    assert seen == [(0, 0, 255), (255, 255, 255), (0, 255, 0), (255, 255, 255)]


@pytest.mark.parametrize(
    ("minified", "wanted"), [("", 188), ("linear_mipmap_nearest", 188), ("nearest", (0, 255))]
)
def test_reduced_textures_are_averaged_unless_the_sampler_forbids_it(offscreen, minified, wanted):
    """The mean of a checkerboard with 3.2 texels per pixel is half of the light, sRGB 188."""
    white, black = (255, 255, 255), (0, 0, 0)
    rows = [[(white, black)[(x + y) % 2] for x in range(256)] for y in range(256)]
    made = texture(*rows, minification=minified)
    shown = draw(offscreen, Material("", made, unlit=True, is_physical=True))
    inner = shown[30:50, 30:50, 0].astype(int)
    if isinstance(wanted, tuple):
        assert set(np.unique(inner)) <= set(wanted)
    else:
        assert np.abs(inner - wanted).max() <= 2


def test_image_is_uploaded_once_per_sampler(offscreen):
    """Three materials have three maps each: one image, two wrap modes, colours and data."""
    made = texture([(1, 2, 3)], wrap=("repeat", "repeat"))
    clamped = replace(made, wrap=("clamp", "clamp"))
    data = {"metallic_texture": made, "roughness_texture": made}
    materials = [Material("", base, **data) for base in (made, made, clamped)]
    with offscreen.context, ExitStack() as stack:
        owner = Owner()
        stack.callback(owner.release)
        surfaces = upload_surfaces(offscreen.context, materials, (0,), [], owner)
        used = {map.glo for surface in surfaces for _, map in surface.textures}
    assert [len(surface.textures) for surface in surfaces] == [3, 3, 3] and len(used) == 3


# Vertex colours


@pytest.mark.parametrize("count", [1, 8])
def test_vertex_colours_multiply_the_base_colour(offscreen, count):
    """The colours change from red on the left to half blue on the right."""
    colors = [[1, 0, 0, 1.0] if x < 0 else [0, 0, 0.5, 0.5] for x in square().positions[:, 0]]
    base = (0.5, 1.0, 1.0, 1.0)
    for material, factor in (
        (Material("", None, base, unlit=True, is_physical=True), 0.5),
        (Material("", texture([(255, 255, 255)]), unlit=True, is_physical=True), 1.0),
        (Material("", None, base, unlit=True, is_physical=True, alpha_mode="blend"), 0.5),
    ):
        figure = painted(material, colors=np.array(colors))
        scene = Scene([Actor(figure) for _ in range(count)])
        shown = front_view(offscreen, scene, lights=dark())
        found = np.array(pixel(shown, 0.0, 0.0))  # centred at x = 0.025
        expected = encoded([factor * 0.4875, 0.0, 0.5 * 0.5125])
        assert np.allclose(found[:3], expected, atol=2)
        if count == 1:
            is_blended = material.alpha_mode == "blend"
            assert abs(int(found[3]) - 255 * (0.74375 if is_blended else 1.0)) <= 2
        plain = front_view(offscreen, scene, lights=dark(), vertex_colors=False)
        assert np.allclose(pixel(plain, 0.0, 0.0)[:3], encoded([factor, 1.0, 1.0]), atol=2)


@pytest.mark.parametrize("shading", ["auto", "phong", "pbr"])
def test_vertex_colours_replace_the_colour_of_figures_without_materials(offscreen, shading):
    mesh = square()
    bare = replace(mesh, materials=(), triangle_materials=None)
    green = replace(bare, colors=np.tile([0.0, 1.0, 0.0, 1.0], (4, 1)))
    same = square(material=Material("", None, (0.0, 1.0, 0.0, 1.0)))
    pictures = [
        front_view(offscreen, alone(Figure("s", one)), shading=shading) for one in (green, same)
    ]
    assert np.array_equal(*pictures)


def test_masks_apply_to_the_opacity_of_vertex_colours(offscreen):
    colors = np.ones((4, 4))
    colors[:, 3] = np.where(square().positions[:, 0] < 0, 0.0, 1.0)
    material = Material("", None, WHITE, alpha_mode="mask", unlit=True, is_physical=True)
    shown = front_view(offscreen, alone(painted(material, colors=colors)), lights=dark())
    assert [pixel(shown, x, 0.0)[3] for x in (-0.2, 0.2)] == [0, 255]


def noise(height: int, width: int):
    rng = np.random.default_rng(0)
    return rng.integers(0, 256, (height, width, 4)).astype(np.uint8)


SHOW_LEVEL = """#version 330
uniform sampler2D u_texture;
uniform float u_level;
uniform vec2 u_size;
out vec4 f_color;
void main() {
    f_color = textureLod(u_texture, gl_FragCoord.xy / u_size, u_level);
}
"""
COVER = """#version 330
void main() {
    gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0);
}
"""


def level_as_drawn(ctx, texture, level: int, size):
    """Return the texels of a level in linear light, 0 to 1, as sampled by a shader."""
    program = ctx.program(vertex_shader=COVER, fragment_shader=SHOW_LEVEL)
    program["u_level"], program["u_size"] = float(level), size
    target = ctx.framebuffer([ctx.renderbuffer(size, 4, dtype="f4")])
    array = ctx.vertex_array(program, [])
    texture.filter = (moderngl.NEAREST_MIPMAP_NEAREST, moderngl.NEAREST)
    texture.use(0)
    with ctx.scope(target):
        array.render(moderngl.TRIANGLES, vertices=3)
        values = np.frombuffer(target.read(components=4, dtype="f4"), "f4")
    for item in (array, program, *target.color_attachments, target):
        item.release()
    return values.reshape(size[1], size[0], 4)


@pytest.mark.parametrize("size", [(16, 16), (64, 16), (1, 8)])
@pytest.mark.parametrize("is_linear", [False, True])
def test_every_level_has_averages_of_linear_light(ctx, size, is_linear):
    pixels = noise(*size)
    texture = picture_texture(ctx, pixels, [], is_linear)
    coded = pixels[::-1] / 255.0
    light = np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)
    light = coded if is_linear else np.dstack([light[..., :3], coded[..., 3]])
    for level in range(1, int(np.log2(max(size))) + 1):
        rows, columns = (max(side >> level, 1) for side in size)
        squares = light.reshape(rows, size[0] // rows, columns, size[1] // columns, 4)
        seen = level_as_drawn(ctx, texture, level, (columns, rows))
        # Steps of 8-bit sRGB are at most 0.009 in linear light, and drivers round at every level.
        np.testing.assert_allclose(seen, squares.mean(axis=(1, 3)), rtol=0, atol=0.01 * level)
    texture.release()


@pytest.mark.parametrize(("is_linear", "stored_as"), [(False, 0x8C43), (True, 0x8058)])
def test_mipmaps_of_the_processor_are_those_of_the_driver(ctx, is_linear, stored_as):
    """The driver rounds each level to 8 bits, so it may be one further off at each."""
    pixels = noise(16, 64)
    texture = ctx.texture((64, 16), 4, pixels, internal_format=stored_as)
    texture.build_mipmaps()
    levels = [*reduced(pixels, is_linear)]
    sides = [(max(16 >> level, 1), max(64 >> level, 1), 4) for level in range(1, 7)]
    assert [one.shape for one in levels] == sides
    for level, texels in enumerate(levels, 1):
        made = np.frombuffer(texture.read(level=level), dtype=np.uint8).reshape(texels.shape)
        np.testing.assert_allclose(texels.astype(int), made, rtol=0, atol=level)
    texture.release()


def test_mipmaps_of_odd_sides_are_means_of_the_texels_that_they_cover():
    """Five rows become two of 2.5 each, then one; three columns become one."""
    pixels = noise(5, 3).astype(float)
    halves = np.array([[2.0, 2, 1, 0, 0], [0, 0, 1, 2, 2]]) / 5.0
    wanted = np.einsum("yr,rxc->yc", halves, pixels)[:, None] / 3.0
    first, second = reduced(pixels.astype(np.uint8), True)
    np.testing.assert_allclose(first, wanted, rtol=0, atol=0.51)
    np.testing.assert_allclose(second[0, 0], pixels.mean(axis=(0, 1)), rtol=0, atol=0.51)
    # 1000 bright rows would not fit into 16 bits if they were added up.
    bright = np.full((1001, 2, 4), 255, dtype=np.uint8)
    assert all((level == 255).all() for level in reduced(bright, False))


def test_sides_of_any_length_have_all_levels(ctx):
    texture = picture_texture(ctx, np.full((5, 3, 4), 128, dtype=np.uint8), [], is_linear=True)
    for level, size in enumerate([(3, 5), (1, 2), (1, 1)]):
        seen = level_as_drawn(ctx, texture, level, size)
        np.testing.assert_allclose(seen, 128 / 255.0, rtol=0, atol=1e-3)  # 8 bits store it exactly
    texture.release()


ROWS = np.array([3, 40, 70, 101])
STEPS = 240  # steps of the quadrature from pole to pole


@pytest.fixture
def generator(monkeypatch):
    """Return the modules of the script."""
    monkeypatch.syspath_prepend(str(Path(__file__).resolve().parents[3] / "assets"))
    import make_studio

    return make_studio


@pytest.fixture(scope="module")
def bundled():
    with np.load(resource("assets", "studio", "studio.npz")) as stored:
        return {name: stored[name].astype(float) for name in stored.files}


def sphere() -> tuple[np.ndarray, np.ndarray]:
    """Return directions over the sphere about +z, and the solid angle of each."""
    polar = (np.arange(STEPS) + 0.5) * math.pi / STEPS
    around = (np.arange(2 * STEPS) + 0.5) * math.pi / STEPS
    p, a = np.meshgrid(polar, around, indexing="ij")
    points = np.stack([np.sin(p) * np.cos(a), np.sin(p) * np.sin(a), np.cos(p)], axis=-1)
    return points.reshape(-1, 3), (np.sin(p) * (math.pi / STEPS) ** 2).ravel()


def lobe(alpha: float, n_h: np.ndarray) -> np.ndarray:
    """Return the GGX distribution of half vectors (Walter et al. 2007, eq. 33)."""
    return alpha**2 / (math.pi * (n_h**2 * (alpha**2 - 1.0) + 1.0) ** 2)


def test_bundled_light_is_the_output_of_the_script(generator, bundled):
    directions = generator.octahedral_directions(generator.SIZE)[np.ix_(ROWS, ROWS)]
    light, samples = generator.radiance, generator.SAMPLES
    for layer in (0, 2, 7):
        made = generator.specular(light, directions, (layer / 7) ** 2, samples)
        stored = bundled["light"][layer][np.ix_(ROWS, ROWS)]
        assert_allclose(stored, made, rtol=0.004)  # eight bits of the mantissa are stored
    stored = bundled["light"][8][np.ix_(ROWS, ROWS)]
    assert_allclose(stored, generator.irradiance(light, directions, samples), rtol=0.004)
    with np.load(resource("assets", "studio", "matcaps.npz")) as matcaps:
        assert sorted(matcaps.files) == sorted(generator.MATCAPS)
        small = generator.matcap("clay", 64).astype(float)
        stored = matcaps["clay"].reshape(64, 4, 64, 4, 3).mean(axis=(1, 3))
    inside = np.hypot(*np.meshgrid(*2 * (np.linspace(-1, 1, 64),))) < 0.9
    assert np.abs(stored - small)[inside].max() < 3.0


def test_borders_continue_the_octahedral_map(generator):
    """Beyond an edge is the texel of the edge, mirrored about the centre of the edge."""
    points = generator.octahedral_directions(8)
    assert_allclose(points[0, 1:-1], points[1, 1:-1][::-1], atol=1e-12)
    assert_allclose(points[1:-1, -1], points[1:-1, -2][::-1], atol=1e-12)


@pytest.mark.parametrize("layer", [3, 5, 7])
def test_light_is_the_integral_of_the_lobe(generator, bundled, layer):
    """The expected value is the mean radiance, weighted by D(h) (n . l), along the normal."""
    points, angles = sphere()
    light = generator.radiance(points)
    for row, column in ((20, 20), (60, 75), (110, 40)):
        normal = generator.octahedral_directions(generator.SIZE)[row, column]
        n_l = points @ normal
        above = n_l > 0.0
        n_h = np.sqrt(0.5 + 0.5 * n_l[above])
        weights = lobe((layer / 7) ** 2, n_h) * n_l[above] * angles[above]
        wanted = weights @ light[above] / weights.sum()
        assert_allclose(bundled["light"][layer][row, column], wanted, rtol=0.02)


def test_last_layer_is_the_irradiance(generator, bundled):
    points, angles = sphere()
    light = generator.radiance(points)
    for row, column in ((20, 20), (60, 75), (110, 40)):
        normal = generator.octahedral_directions(generator.SIZE)[row, column]
        weights = np.maximum(points @ normal, 0.0) * angles / math.pi
        assert_allclose(bundled["light"][8][row, column], weights @ light, rtol=0.01)


@pytest.mark.parametrize("roughness", [0.3, 0.5, 0.9])
@pytest.mark.parametrize("n_v", [0.2, 0.7])
def test_table_is_the_integral_of_the_brdf(bundled, roughness, n_v):
    """The reflectance of F0 = 1 is factor + summand, that of F0 = 0 the summand; both are < 1."""
    row, column = int(64 * roughness), int(64 * n_v)
    alpha, n_v = ((row + 0.5) / 64) ** 2, (column + 0.5) / 64
    points, angles = sphere()
    points, angles = points[points[:, 2] > 0.0], angles[points[:, 2] > 0.0]
    view = np.array([math.sqrt(1.0 - n_v**2), 0.0, n_v])
    half = points + view
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    n_l, n_h, v_h = points[:, 2], half[:, 2], half @ view

    def shadowing(cosine):
        """Return Smith's Lambda of GGX (Heitz 2014, eq. 72)."""
        return 0.5 * (np.sqrt(1.0 + alpha**2 * (1.0 / cosine**2 - 1.0)) - 1.0)

    visible = 1.0 / (1.0 + shadowing(n_l) + shadowing(n_v))
    reflected = lobe(alpha, n_h) * visible / (4.0 * n_l * n_v) * n_l * angles
    factor, summand = bundled["split_sum"][row, column]
    assert factor + summand == pytest.approx(reflected.sum(), rel=0.01)
    assert summand == pytest.approx((reflected * (1.0 - v_h) ** 5).sum(), rel=0.02, abs=1e-3)
    assert factor + summand <= 1.0
