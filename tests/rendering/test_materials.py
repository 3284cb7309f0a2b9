"""Pixels of materials: metallic-roughness formula, normal maps, opacity, sides, and matcaps."""

import math
from dataclasses import replace

import numpy as np
import pytest
from rendering.drawn_figures import scene_of, sphere, square
from rendering.front_view import (
    PIXELS,
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

from viewer.rendering.camera import Camera
from viewer.rendering.options import DisplayOptions, Light, Lights
from viewer.resources import resource
from viewer.rigs.figure import Figure
from viewer.rigs.material import Material
from viewer.rigs.mesh import Mesh
from viewer.rigs.scene import Actor, Scene, scene_box

FLAT = (128, 128, 255)


@pytest.fixture
def furnace(offscreen):
    """A renderer with a studio of uniform radiance 0.5."""
    with np.load(resource("assets", "studio", "studio.npz")) as stored:
        light = stored["light"]
    with offscreen.context:
        studio = offscreen.renderer.late.studio
        studio._light.write(np.full_like(light, 0.5).tobytes())
    yield offscreen
    with offscreen.context:
        studio._light.write(light.tobytes())


# The formula


@pytest.mark.parametrize("metallic", [0.0, 1.0])
@pytest.mark.parametrize("roughness", [0.1, 0.5, 1.0])
def test_white_surfaces_vanish_in_a_white_furnace(furnace, metallic, roughness):
    """No energy is lost or added: every pixel of a white sphere has the studio's radiance."""
    material = Material("", None, WHITE, metallic, roughness, is_physical=True)
    ball = replace(sphere(radius=1.0, rings=24, sides=48), materials=(material,))
    ball = replace(ball, triangle_materials=np.zeros(ball.n_triangles, np.int32))
    shown = front_view(furnace, alone(Figure("ball", ball)), lights=dark())
    seen = shown[shown[..., 3] == 255][:, :3].astype(float)
    assert len(seen) > 1000
    assert np.abs(seen - encoded(0.5)).max() <= 2.0


def sampled(light: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Return the bilinear samples of an octahedral map with a border of one texel at directions."""
    d = directions / np.abs(directions).sum(axis=1, keepdims=True)
    fold = (1.0 - np.abs(d[:, [2, 0]])) * np.where(d[:, [0, 2]] < 0.0, -1.0, 1.0)
    uv = np.where(d[:, 1:2] < 0.0, fold, d[:, [0, 2]])
    place = (0.5 * uv + 0.5) * (light.shape[0] - 2) + 0.5
    low = np.floor(place).astype(int)
    (a, b), (x, y) = (place - low).T[:, :, None], low.T
    upper = (1 - a) * light[y, x] + a * light[y, x + 1]
    return (1 - b) * upper + b * ((1 - a) * light[y + 1, x] + a * light[y + 1, x + 1])


def reference(normals, metallic, roughness, base, key):
    """Return the linear colours of a sphere seen along -z, by the formulas cited in pbr.glsl."""
    with np.load(resource("assets", "studio", "studio.npz")) as stored:
        light, table = stored["light"].astype(float), stored["split_sum"].astype(float)
    n_v = normals[:, 2:3]
    reflected = 2.0 * n_v * normals - [0.0, 0.0, 1.0]
    layer = 7.0 * roughness
    low = int(layer)
    above = sampled(light[min(low + 1, 7)], reflected)
    arriving = sampled(light[low], reflected) * (low + 1 - layer) + above * (layer - low)
    columns, row = np.clip(64.0 * n_v[:, 0] - 0.5, 0.0, 63.0), 64.0 * roughness - 0.5
    rows = table[int(row)] * (int(row) + 1 - row) + table[min(int(row) + 1, 63)] * (row - int(row))
    factor, summand = (np.interp(columns, np.arange(64), rows[:, k])[:, None] for k in (0, 1))
    specular = 0.04 * (1.0 - metallic) + base * metallic
    single = specular * factor + summand
    lost = 1.0 - factor - summand
    average = specular + (1.0 - specular) / 21.0
    several = single * average * lost / (1.0 - lost * average)
    albedo = base * (1.0 - metallic)
    around = several + albedo * (1.0 - single - several)
    color = single * arriving + around * sampled(light[8], normals)
    halfway = np.add(key, [0.0, 0.0, 1.0])
    halfway /= np.linalg.norm(halfway)
    n_l, n_h = np.maximum(normals @ key, 0.0)[:, None], (normals @ halfway)[:, None]
    v_h = halfway[2]
    alpha2 = roughness**4
    distribution = alpha2 / (math.pi * (n_h**2 * (alpha2 - 1.0) + 1.0) ** 2)

    def smith(cosine):
        return np.sqrt(alpha2 + (1.0 - alpha2) * cosine**2)

    # Height-correlated visibility, V = G / (4 (n . l) (n . v)).
    visibility = 0.5 / np.maximum(n_l * smith(n_v) + n_v * smith(n_l), 1e-9)
    fresnel = specular + (1.0 - specular) * (1.0 - v_h) ** 5
    brdf = (1.0 - fresnel) * albedo / math.pi + fresnel * distribution * visibility
    return color + 0.30 * math.pi * brdf * n_l


def toned(color):
    """Apply Khronos PBR Neutral without its toe."""
    peak = color.max(axis=1, keepdims=True)
    lowered = np.where(peak > 0.8, 1.0 - 0.04 / np.maximum(peak - 0.6, 0.2), peak)
    kept = 1.0 / (0.15 * (peak - lowered) + 1.0)
    return np.where(peak > 0.8, lowered * (1 - kept) + color * (lowered / peak) * kept, color)


@pytest.mark.parametrize(("metallic", "roughness"), [(0.0, 0.35), (1.0, 0.5), (0.5, 0.8)])
def test_sphere_has_the_colours_of_the_formula(offscreen, metallic, roughness):
    base = np.array([0.8, 0.4, 0.1])
    material = Material("", None, (*base, 1.0), metallic, roughness, is_physical=True)
    ball = replace(sphere(radius=1.6, rings=64, sides=128), materials=(material,))
    ball = replace(ball, triangle_materials=np.zeros(ball.n_triangles, np.int32))
    lights = dark()
    lights.key = Light(30.0, 40.0, (1.0, 1.0, 1.0), 1.0)
    shown = front_view(offscreen, alone(Figure("ball", ball)), lights=lights)
    y, x = np.mgrid[:PIXELS, :PIXELS]
    places = np.stack([(x + 0.5) / 20.0 - 2.0, 2.0 - (y + 0.5) / 20.0], axis=-1) / 1.6
    inside = (places**2).sum(axis=-1) < 0.8
    across = places[inside]
    normals = np.column_stack([across, np.sqrt(1.0 - (across**2).sum(axis=1))])
    a, i = math.radians(30.0), math.radians(40.0)
    key = np.array([math.cos(i) * math.sin(a), math.sin(i), math.cos(i) * math.cos(a)])
    wanted = encoded(toned(reference(normals, metallic, roughness, base, key)))
    # The tolerance covers interpolated normals on 128 sides, and eight bits.
    assert np.abs(shown[inside][:, :3] - wanted).max() <= 3.0


# Materials


def test_figures_are_shaded_by_their_materials(offscreen):
    plain = Material("", None, (0.8, 0.2, 0.1, 1.0))
    for material, shading in ((plain, "phong"), (replace(plain, is_physical=True), "pbr")):
        pictures = [
            draw(offscreen, material, shading=name, lights=Lights()) for name in ("auto", shading)
        ]
        assert np.array_equal(*pictures)
    shiny, rough = (
        front_view(offscreen, scene_of(sphere()), shading="pbr", roughness=value)
        for value in (0.1, 0.9)
    )
    assert np.abs(shiny.astype(int) - rough).max() > 5


def test_unlit_and_emissive_colours_are_unchanged(furnace):
    unlit = Material("", None, (0.25, 0.5, 0.75, 1.0), unlit=True, is_physical=True)
    assert np.allclose(pixel(draw(furnace, unlit), 0, 0)[:3], encoded([0.25, 0.5, 0.75]), atol=1)
    glowing = Material(
        "", None, (0.0, 0.0, 0.0, 1.0), 1.0, emissive=(0.5, 0.25, 0.0), is_physical=True
    )
    found = pixel(draw(furnace, glowing, lights=dark(studio=0.0)), 0, 0)
    assert np.allclose(found[:3], encoded([0.5, 0.25, 0.0]), atol=1)


def test_toon_surfaces_mix_two_colours_by_the_angle_of_the_key_light(offscreen):
    half = texture([(0, 255, 255)])
    toon = Material(
        "", None, (0.5, 0.5, 0.5, 1.0), unlit=True, is_physical=True,
        shade_color=(1.0, 0.25, 0.0), shade_texture=half,
    )  # fmt: skip
    # The light is at 60 degrees from the normal, so the cosine is 0.5.
    off = Light(60.0, 0.0, (1.0, 1.0, 1.0), 0.0)
    lights = Lights(key=off, rim=off, ambient=0.0, specular=0.0)
    wanted = {
        (0.0, 0.4): [0.5, 0.5, 0.5],
        (0.6, 1.0): [0.0, 0.25, 0.0],
        (0.25, 0.75): [0.25, 0.375, 0.25],
    }
    for limits, color in wanted.items():
        shown = draw(offscreen, replace(toon, shade_range=limits), lights=lights, shadows=False)
        assert np.allclose(pixel(shown, 0, 0)[:3], encoded(color), atol=1)


def test_factors_are_multiplied_by_the_channels_of_their_maps(furnace):
    """Black metal reflects almost nothing; occlusion removes the light of the studio."""
    half = texture([(0, 128, 255)], channel=1)
    occluded = Material("", None, WHITE, occlusion_texture=half, is_physical=True)
    found = pixel(draw(furnace, occluded), 0, 0)
    assert np.allclose(found[:3], encoded(0.5 * 128 / 255), atol=2)
    weak = replace(occluded, occlusion_strength=0.5)
    assert np.allclose(
        pixel(draw(furnace, weak), 0, 0)[:3], encoded(0.25 * (1 + 128 / 255)), atol=2
    )
    base = (0.0, 0.0, 0.0, 1.0)
    metal = Material("", None, base, 1.0, metallic_texture=half, is_physical=True)
    same = Material("", None, base, 128 / 255, is_physical=True)
    assert np.array_equal(draw(furnace, metal), draw(furnace, same))
    rough = Material("", None, WHITE, 1.0, 1.0, roughness_texture=half, is_physical=True)
    assert np.array_equal(
        draw(furnace, rough),
        draw(furnace, replace(rough, roughness=128 / 255, roughness_texture=None)),
    )


def test_base_colours_tint_textures_and_textures_can_be_switched_off(offscreen):
    material = Material(
        "", texture([(255, 255, 255)]), (1.0, 0.5, 0.0, 1.0), unlit=True, is_physical=True
    )
    assert np.allclose(pixel(draw(offscreen, material), 0, 0)[:3], encoded([1.0, 0.5, 0.0]), atol=1)
    plain = draw(offscreen, material, texture=False)
    assert np.allclose(pixel(plain, 0, 0)[:3], encoded([0.62, 0.60, 0.57]), atol=1)


def test_textures_are_placed_wrapped_and_taken_from_the_second_set(offscreen):
    red, green, blue, white = (255, 0, 0), (0, 255, 0), (0, 0, 255), (255, 255, 255)
    corners = [red, green], [blue, white]

    def seen(**placing):
        made = texture(*corners, is_smooth=False, **placing)
        material = Material("", made, unlit=True, is_physical=True)
        figure = painted(material, other_uvs=(square().uvs[:, ::-1],))
        shown = front_view(offscreen, alone(figure), lights=dark())
        return [tuple(pixel(shown, x, y)[:3]) for y in (0.5, -0.5) for x in (-0.5, 0.5)]

    assert seen() == [red, green, blue, white]
    assert seen(uv_set=1) == [white, green, blue, red]
    # The image is repeated twice, so the lower left quarter is a whole image with a change in its
    # middle.
    moved = [[1.0, 0.0, 0.5], [0.0, 1.0, 0.0]]
    assert seen(transform=moved, wrap=("repeat", "clamp")) == [green, red, white, blue]
    assert seen(transform=moved, wrap=("clamp", "clamp")) == [green, green, white, white]
    moved[0][2] = 1.0
    assert seen(transform=moved, wrap=("mirror", "clamp")) == [green, red, white, blue]
    flipped = [[1.0, 0.0, 0.0], [0.0, 1.0, 1.0]]
    assert seen(transform=flipped, wrap=("clamp", "mirror")) == [blue, white, red, green]


# Opacity and sides


def test_masks_discard_pixels_and_blending_mixes_them(offscreen):
    both = texture([(255, 0, 0, 100), (255, 0, 0, 200)], is_smooth=False)
    cut = Material("", both, alpha_mode="mask", unlit=True, is_physical=True)
    shown = draw(offscreen, cut)
    assert pixel(shown, -0.5, 0)[3] == 0
    assert pixel(shown, 0.5, 0) == [255, 0, 0, 255]
    opaque = draw(offscreen, replace(cut, alpha_mode="opaque"))
    assert pixel(opaque, -0.5, 0) == [255, 0, 0, 255]
    glass = replace(cut, alpha_mode="blend")
    assert pixel(draw(offscreen, glass), -0.5, 0) == [255, 0, 0, 100]


def test_blended_surfaces_are_drawn_last_and_from_far_to_near(offscreen):
    """The list starts with the nearest: glass over glass over a wall, in encoded colours."""

    def glass(color, alpha, z, mode="blend"):
        material = Material(
            "", None, (*color, alpha), alpha_mode=mode, unlit=True, is_physical=True
        )
        return Actor(painted(material, z))

    scene = Scene(
        [
            glass((1.0, 0.0, 0.0), 0.5, 1.0),
            glass((0.0, 1.0, 0.0), 0.5, 0.5),
            glass((0.0, 0.0, 1.0), 1.0, 0.0, "opaque"),
        ]
    )
    shown = front_view(offscreen, scene, lights=dark())
    assert np.allclose(pixel(shown, 0, 0), [128, 64, 64, 255], atol=1)


def test_back_faces_of_single_sided_materials_are_not_drawn(offscreen):
    material = Material("", None, WHITE, double_sided=False)
    for clockwise, alpha in ((False, 255), (True, 0)):
        figure = Figure("square", square(material=material, clockwise=clockwise))
        assert pixel(front_view(offscreen, alone(figure)), 0, 0)[3] == alpha


# Normals and matcaps


def test_flat_normal_maps_have_no_effect(offscreen):
    material = Material("", None, (0.8, 0.4, 0.2, 1.0), is_physical=True)
    bent = replace(material, normal_texture=texture([FLAT]))
    pictures = [draw(offscreen, one, lights=Lights()).astype(int) for one in (material, bent)]
    assert np.abs(pictures[0] - pictures[1]).max() <= 2


def bumpy(**changes) -> Material:
    """Return a material with normals of (0.6, 0, 0.8) in tangent space."""
    return Material("", normal_texture=texture([(204, 128, 230)]), **changes)


def test_normal_maps_bend_normals_along_u_and_v(offscreen):
    """Normals are shown as (0.5 n + 0.5)^2; the square has u to the right and v upwards."""
    for scale, wanted in ((1.0, (0.6, 0.0, 0.8)), (-1.0, (-0.6, 0.0, 0.8)), (0.0, (0.0, 0.0, 1.0))):
        shown = draw(offscreen, bumpy(normal_scale=scale), shading="normals")
        expected = encoded((0.5 * np.array(wanted) + 0.5) ** 2)
        assert np.allclose(pixel(shown, 0.3, 0.2)[:3], expected, atol=2)
    # With u upwards, the same map bends the normals upwards.
    mesh = square(material=bumpy())
    shown = front_view(
        offscreen, alone(Figure("s", replace(mesh, uvs=mesh.uvs[:, ::-1]))), shading="normals"
    )
    assert np.allclose(pixel(shown, 0.3, 0.2)[:3], encoded(np.array([0.5, 0.8, 0.9]) ** 2), atol=2)


def test_normal_maps_follow_mirrored_coordinates_and_are_inverted_on_the_back(offscreen):
    """Bumps point along u, to the left if u increases to the left; from behind they are dents."""
    mesh = square(material=bumpy())
    mirrored = Figure("s", replace(mesh, uvs=mesh.uvs * [-1.0, 1.0]))
    shown = front_view(offscreen, alone(mirrored), shading="normals")
    wanted = encoded((0.5 * np.array([-0.6, 0.0, 0.8]) + 0.5) ** 2)
    assert np.allclose(pixel(shown, 0.3, 0.2)[:3], wanted, atol=2)
    # After a rotation by 180 degrees about y, u increases to the left, and the normal (0.6, 0, 0.8)
    # of the front becomes -(-0.6, 0, -0.8).
    behind = Actor(Figure("s", mesh), placement=np.diag([-1.0, 1.0, -1.0, 1.0]))
    shown = front_view(offscreen, Scene([behind]), shading="normals")
    wanted = encoded((0.5 * np.array([0.6, 0.0, 0.8]) + 0.5) ** 2)
    assert np.allclose(pixel(shown, 0.3, 0.2)[:3], wanted, atol=2)


@pytest.mark.parametrize("name", ["clay", "chrome"])
def test_matcaps_are_looked_up_by_the_normal(offscreen, name):
    with np.load(resource("assets", "studio", "matcaps.npz")) as stored:
        sphere_picture = stored[name].astype(float)
    mesh = square()
    for normal in ((0.0, 0.0, 1.0), (0.6, 0.0, 0.8), (0.0, -0.6, 0.8)):
        turned = Mesh(mesh.positions, np.tile(normal, (4, 1)), mesh.triangles)
        shown = front_view(offscreen, alone(Figure("s", turned)), shading="matcap", matcap=name)
        row, column = 127.5 - 127.5 * normal[1], 127.5 + 127.5 * normal[0]
        rows, columns = (slice(int(v) - 1, int(v) + 3) for v in (row, column))
        around = sphere_picture[rows, columns]
        found = np.array(pixel(shown, 0, 0)[:3])
        assert (found >= around.min(axis=(0, 1)) - 1).all()
        assert (found <= around.max(axis=(0, 1)) + 1).all()


# Backgrounds


def test_background_is_white_or_the_studio(furnace):
    scene = alone(painted(Material(), 0.0))
    white = front_view(furnace, scene, background="white")
    assert pixel(white, 1.8, 1.8) == [255, 255, 255, 255]
    studio = front_view(furnace, scene, background="environment", lights=dark())
    assert np.allclose(pixel(studio, 1.8, 1.8), [*[encoded(0.5)] * 3, 255], atol=1)


def test_studio_is_upright_behind_the_scene(offscreen):
    """An orthographic horizontal camera sees the studio's map at -z, with +y up."""
    shown = front_view(offscreen, scene_of(square()), background="environment", lights=dark())
    with np.load(resource("assets", "studio", "studio.npz")) as stored:
        light = stored["light"].astype(float)
    height = math.tan(math.radians(17.5))
    for x, y in ((-1.9, 1.9), (1.9, 1.9), (0.0, -1.9)):
        ray = np.array([[x / 2 * height, y / 2 * height, -1.0]])
        ray /= np.linalg.norm(ray)
        blurred = 0.8 * sampled(light[4], ray) + 0.2 * sampled(light[5], ray)
        assert np.allclose(pixel(shown, x, y)[:3], encoded(toned(blurred))[0], atol=3)


def test_transparent_pictures_contain_the_shadow_in_their_alpha(offscreen):
    """Pixels below the ball are translucent black, and those far from it are transparent."""
    camera = Camera(azimuth=0.0, inclination=40.0, distance=6.0)
    pictures = []
    for quality in ("draft", "normal"):
        options = DisplayOptions(background="transparent", grid=False, samples=1, quality=quality)
        scene = alone(Figure("ball", sphere()))
        pictures.append(
            offscreen.render(scene, (PIXELS, PIXELS), camera, options, scene_box(scene))
        )
    plain, shadowed = pictures
    ground = plain[..., 3] == 0
    shadow = ground & (shadowed[..., 3] > 0)
    assert shadow.sum() > 50
    assert (shadowed[shadow][:, :3] == 0).all() and shadowed[shadow][:, 3].max() < 200
    assert (shadowed[0] == 0).all()
