"""Scene-linear light on the screen, with the tone curve and hemisphere ambient light."""

import math
from dataclasses import replace

import numpy as np
import pytest
from rendering.drawn_figures import picture, scene_of, square
from rendering.plain_pictures import draw, lights, plain

from viewer.rig.srgb import encode_srgb

WHITE = square(material=picture([[(255, 255, 255)]]))


def neutral(color) -> np.ndarray:
    """Return Khronos PBR Neutral of a linear colour, as specified, with F90 = 0."""
    color = np.array(color)
    peak = color.max()
    if peak <= 0.8:
        return color
    top = 1.0 - (1.0 - 0.8) ** 2 / (peak + 1.0 - 2.0 * 0.8)
    g = 1.0 / (0.15 * (peak - top) + 1.0)
    return color * (top / peak) * g + top * (1.0 - g)


@pytest.mark.parametrize(
    "light",
    [(0.7, 0.2, 0.1), (0.8, 0.8, 0.8), (1.0, 1.0, 1.0), (2.0, 0.5, 0.1), (0.3, 1.2, 9.0)],
)
def test_bright_light_follows_the_tone_curve(offscreen, light):
    options = plain(lights=lights(sky=light, ground=light))
    pixel = draw(offscreen, scene_of(WHITE), options)[50, 50, :3]
    np.testing.assert_allclose(pixel, 255.0 * encode_srgb(neutral(light)), atol=1.0)
    assert pixel.max() < 255


def test_scalar_colours_have_no_tone_curve(offscreen):
    """A normal towards the eye is pure blue."""
    assert draw(offscreen, scene_of(WHITE), plain(shading="normals"))[50, 50, 2] == 255


@pytest.mark.parametrize("tilt", [-60.0, 0.0, 30.0, 75.0])
def test_ambient_light_follows_the_height_of_the_normal(offscreen, tilt):
    """The light on a slope is ground + (sky - ground) (1 + sin tilt) / 2."""
    sky, ground = np.array([0.2, 0.4, 0.7]), np.array([0.5, 0.3, 0.1])
    angle = math.radians(tilt)
    turned = np.array([[1, 0, 0], [0, math.cos(angle), math.sin(angle)],
                       [0, -math.sin(angle), math.cos(angle)]])  # fmt: skip
    mesh = replace(WHITE, positions=WHITE.positions @ turned.T, normals=WHITE.normals @ turned.T)
    options = plain(lights=lights(sky=tuple(sky), ground=tuple(ground)))
    pixel = draw(offscreen, scene_of(mesh), options)[50, 50, :3]
    wanted = ground + (sky - ground) * (1.0 + math.sin(angle)) / 2.0
    np.testing.assert_allclose(pixel, 255.0 * encode_srgb(wanted), atol=1.0)
