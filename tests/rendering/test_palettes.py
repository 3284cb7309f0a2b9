"""Palettes with distinguishable neighbours, also for colour vision deficiencies."""

import numpy as np
import pytest

import viewer
from viewer.rendering.colors import (
    NOTHING,
    colormap,
    count_palette,
    diverging_map,
    joint_palette,
    oklab,
    part_colors,
    part_palette,
)
from viewer.rig.srgb import decode_srgb, encode_srgb

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
