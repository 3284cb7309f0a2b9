"""The colour map, in which perceived lightness rises from one end to the other."""

import math
from dataclasses import replace

import numpy as np
import pytest
from rendering.drawn_figures import picture, scene_of, square
from rendering.plain_pictures import draw, lights, plain

import viewer
from viewer.rendering.colors import (
    NOTHING,
    colormap,
    count_palette,
    diverging_map,
    joint_palette,
    named_map,
    oklab,
    part_colors,
    part_palette,
)
from viewer.rendering.options import COLORMAPS
from viewer.rigs.srgb import decode_srgb, encode_srgb

# Matrices from sRGB to CIE XYZ (IEC 61966-2-1), and from XYZ to the lightness of OKLab (Ottosson
# 2020).
TO_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
TO_LMS = np.array(
    [
        [0.8189330101, 0.3618667424, -0.1288597137],
        [0.0329845436, 0.9293118715, 0.0361456387],
        [0.0482003018, 0.2643662691, 0.6338517070],
    ]
)
TO_LIGHTNESS = np.array([0.2104542553, 0.7936177850, -0.0040720468])


def linear(pixels):
    """Decode sRGB to linear light."""
    share = pixels[:, :3] / 255.0
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


def luminance(pixels):
    return linear(pixels) @ TO_XYZ[1]


def lightness(pixels):
    return np.cbrt(linear(pixels) @ TO_XYZ.T @ TO_LMS.T) @ TO_LIGHTNESS


def test_luminance_rises_with_every_colour():
    assert (np.diff(luminance(colormap())) > 0.0).all()


def test_lightness_rises_evenly_from_dark_to_bright():
    found = lightness(colormap())
    assert found[0] < 0.25
    assert found[-1] > 0.9
    assert (np.diff(found) > 0.0).all()
    # A step of 1/255 in one channel is up to 0.01 for dark colours.
    even = np.linspace(found[0], found[-1], len(found))
    assert np.abs(found - even).max() < 0.03


def test_all_colours_are_distinct_and_opaque():
    pixels = colormap()
    assert pixels.shape == (256, 4)
    assert pixels.dtype == np.uint8
    assert len(np.unique(pixels, axis=0)) == 256
    assert (pixels[:, 3] == 255).all()


def test_any_number_of_colours_spans_the_same_map():
    whole = colormap(256)
    for count in (2, 4, 16, 52):
        step = 255 / (count - 1)
        if step == int(step):
            assert np.array_equal(colormap(count), whole[:: int(step)])


@pytest.mark.parametrize(
    ("name", "first", "middle", "last"),
    [
        # As published: #440154, #21918c and #fde725 are viridis at 0, 1/2 and 1.
        ("viridis", 0x440154, 0x21918C, 0xFDE725),
        ("magma", 0x000004, 0xB73779, 0xFCFDBF),
        ("inferno", 0x000004, 0xBC3754, 0xFCFFA4),
        ("plasma", 0x0D0887, 0xCC4778, 0xF0F921),
        ("cividis", 0x00224E, 0x7D7C78, 0xFEE838),
        ("turbo", 0x30123B, 0xA4FC3C, 0x7A0403),
        ("coolwarm", 0x3B4CC0, 0xDDDCDC, 0xB40426),
    ],
)
def test_named_maps_have_the_published_colours(name, first, middle, last):
    pixels = named_map(name)
    assert pixels.shape == (256, 4) and (pixels[:, 3] == 255).all()
    found = pixels[[0, 128, 255], :3].astype(int) @ [1 << 16, 1 << 8, 1]
    assert found.tolist() == [first, middle, last]


def test_every_name_has_a_map():
    assert all(len(named_map(name)) == 256 for name in COLORMAPS if name != "auto")


# Vienot, Brettel and Mollon 1999 for linear sRGB; the palettes were designed with Machado 2009.
PROTAN = [[0.11238, 0.88762, 0.0], [0.11238, 0.88762, 0.0], [0.00401, -0.00401, 1.0]]
DEUTAN = [[0.29275, 0.70725, 0.0], [0.29275, 0.70725, 0.0], [-0.02234, 0.02234, 1.0]]
EYES = {"usual": np.eye(3), "no long cones": np.array(PROTAN), "no middle": np.array(DEUTAN)}


def lab(pixels, eyes=EYES["usual"]):
    """Return OKLab (Ottosson 2020) of sRGB pixels under a colour vision deficiency."""
    share = pixels[:, :3] / 255.0
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    linear = np.clip(linear @ eyes.T, 0.0, 1.0)
    to_lms = np.array(
        [
            [0.4122214708, 0.5363325363, 0.0514459929],
            [0.2119034982, 0.6806995451, 0.1073969566],
            [0.0883024619, 0.2817188376, 0.6299787005],
        ]
    )
    to_lab = np.array(
        [
            [0.2104542553, 0.7936177850, -0.0040720468],
            [1.9779984951, -2.4285922050, 0.4505937099],
            [0.0259040371, 0.7827717662, -0.8086757660],
        ]
    )
    return np.cbrt(linear @ to_lms.T) @ to_lab.T


def skeletons():
    body = viewer.load(_body()).actors[0].figure.skeleton
    return {
        "body": body.parents,
        "fox": viewer.load().actors[0].figure.skeleton.parents,
        "chain": np.arange(60) - 1,
        "star": np.array([-1] + [0] * 12),
        "roots": np.full(8, -1),
    }


def _body():
    from viewer.resources import resource

    return resource("assets", "samples", "body.npz")


@pytest.mark.parametrize("eyes", EYES)
@pytest.mark.parametrize("name", ["body", "fox", "chain", "star", "roots"])
def test_neighbouring_joints_differ(name, eyes):
    parents = skeletons()[name]
    colors = lab(joint_palette(parents), EYES[eyes])
    for joint, parent in enumerate(parents):
        siblings = [other for other in range(joint) if parents[other] == parent]
        for other in [*siblings, *([parent] if parent >= 0 else [])]:
            # A difference of 0.02 is just noticeable between adjacent areas.
            assert np.linalg.norm(colors[joint] - colors[other]) > 0.05, (joint, other)


@pytest.mark.parametrize("count", [1, 24, 48])
def test_joints_have_distinct_colours(count):
    palette = joint_palette(np.arange(count) - 1)
    assert palette.shape == (count, 4) and palette.dtype == np.uint8
    assert len(np.unique(palette, axis=0)) == count
    assert not (palette[:, :3] == NOTHING).all(axis=1).any()


def test_more_joints_than_colours_use_them_equally():
    palette = joint_palette(np.arange(96) - 1)
    _, uses = np.unique(palette, axis=0, return_counts=True)
    assert (uses == 2).all()
    assert joint_palette(np.zeros(0, dtype=int)).shape == (0, 4)


def test_count_colours_rise_from_dark_grey():
    palette = count_palette(4)
    assert palette.shape == (5, 4)
    assert tuple(palette[0, :3]) == NOTHING
    lightness = lab(palette)[:, 0]
    assert (np.diff(lightness[1:]) > 0.1).all()
    assert count_palette(0).shape == (1, 4)
    assert count_palette(1).shape == (2, 4)


def test_part_colours_match_the_part_shading():
    linear = part_colors(9)
    expected = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    np.testing.assert_allclose(part_palette(9)[:, :3] / 255.0, expected, atol=0.5001 / 255)


def test_zero_colour_is_not_in_any_colour_map():
    grey = lab(np.array([NOTHING]))
    for pixels in (colormap(), diverging_map()):
        assert np.linalg.norm(lab(pixels) - grey, axis=1).min() > 0.05


def test_difference_map_is_white_in_the_middle_and_darker_to_both_sides():
    pixels = diverging_map(255)
    assert (pixels[127, :3] == pixels[127, 0]).all() and pixels[127, 0] > 240
    lightness = lab(pixels)[:, 0]
    assert (np.diff(lightness[:128]) > 0.0).all() and (np.diff(lightness[127:]) < 0.0).all()
    # Equal magnitudes are equally dark.
    assert np.abs(lightness - lightness[::-1]).max() < 0.02
    assert pixels[0, 2] > pixels[0, 0] and pixels[-1, 0] > pixels[-1, 2]


@pytest.mark.parametrize("eyes", EYES)
def test_sides_of_the_difference_map_are_distinguishable(eyes):
    colors = lab(diverging_map(101), EYES[eyes])
    for step in (15, 30, 50):
        assert np.linalg.norm(colors[50 - step] - colors[50 + step]) > 0.08


def test_colour_conversions_match_published_values():
    values = np.linspace(0.0, 1.0, 11)
    np.testing.assert_allclose(decode_srgb(encode_srgb(values)), values, atol=1e-4)
    assert decode_srgb(np.array(0.5)) == pytest.approx(0.21404114)
    assert encode_srgb(np.array([-1.0, 2.0])).tolist() == [0.0, pytest.approx(1.0)]
    # White, and red with the values in Ottosson 2020.
    np.testing.assert_allclose(oklab(np.ones(3)), [1, 0, 0], atol=1e-3)
    np.testing.assert_allclose(oklab(np.array([1.0, 0, 0])), [0.628, 0.2249, 0.1258], atol=1e-3)


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
