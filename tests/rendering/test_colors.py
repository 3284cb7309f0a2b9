"""The colour map, in which perceived lightness rises from one end to the other."""

import numpy as np
import pytest

from viewer.rendering.colors import colormap, named_map
from viewer.rendering.options import COLORMAPS

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
