"""Pixels of vertex colours, additional texture coordinates, and texture filters."""

from contextlib import ExitStack
from dataclasses import replace

import numpy as np
import pytest
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
from viewer.rendering.offscreen import Offscreen
from viewer.rig.figure import Figure
from viewer.rig.material import Material
from viewer.rig.scene import Actor, Scene


@pytest.fixture(scope="module")
def offscreen():
    with Offscreen() as result:
        yield result


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
