"""Mipmap levels of textures: sizes, averages in linear light, and sampled values."""

from __future__ import annotations

import moderngl
import numpy as np
import pytest

from viewer.rendering.gpu import mipmaps
from viewer.rendering.gpu.mipmaps import add_mipmaps, halved_pictures

RGBA8, SRGB8_ALPHA8 = 0x8058, 0x8C43


def noise(height: int, width: int):
    rng = np.random.default_rng(0)
    return rng.integers(0, 256, (height, width, 4)).astype(np.uint8)


@pytest.mark.parametrize(
    ("size", "wanted"),
    [
        ((1, 1), []),
        ((4, 4), [(2, 2), (1, 1)]),
        ((5, 3), [(2, 1), (1, 1)]),
        ((1, 8), [(1, 4), (1, 2), (1, 1)]),
        ((6, 1), [(3, 1), (1, 1)]),
    ],
)
def test_sides_are_halved_rounding_down_to_one_pixel(size, wanted):
    assert [picture.shape for picture in halved_pictures(noise(*size))] == [
        (*shape, 4) for shape in wanted
    ]


def test_uniform_colour_is_unchanged():
    for value in range(256):
        pixels = np.full((4, 4, 4), value, dtype=np.uint8)
        for picture in halved_pictures(pixels):
            assert np.abs(picture.astype(int) - value).max() <= 1


def test_black_and_white_average_to_half_the_light():
    """Linear 0.5 is 1.055 0.5^(1/2.4) - 0.055 = 0.7354 or 188 of 255; 0.25 is 0.5371 or 137."""
    pixels = np.zeros((2, 4, 4), dtype=np.uint8)
    pixels[0, :2] = 255
    pixels[0, 2] = 255
    (first, second) = halved_pictures(pixels)
    assert first[0, :, 0].tolist() == [188, 137]
    assert abs(int(second[0, 0, 0]) - 165) <= 1  # 0.375 in linear light


def test_every_pixel_is_the_average_of_four_pixels():
    pixels = noise(8, 6)
    coded = pixels / 255.0
    linear = np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)
    mean = linear.reshape(4, 2, 3, 2, 4).mean(axis=(1, 3))
    wanted = np.where(mean <= 0.0031308, 12.92 * mean, 1.055 * mean ** (1 / 2.4) - 0.055)
    assert np.abs(halved_pictures(pixels)[0] - 255.0 * wanted).max() <= 1.0


def test_linear_pixels_are_rounded_averages():
    pixels = noise(8, 6)
    sums = pixels.astype(int).reshape(4, 2, 3, 2, 4).sum(axis=(1, 3))
    first, second, third = halved_pictures(pixels, is_linear=True)
    np.testing.assert_array_equal(first, (sums + 2) // 4)
    # The second level averages the exact means, not the rounded ones, and drops the third column.
    exact = sums[:, :2].reshape(2, 2, 1, 2, 4).sum(axis=(1, 3))
    np.testing.assert_array_equal(second, (exact + 8) // 16)
    assert third.shape == (1, 1, 4)


@pytest.mark.parametrize("height", [1, 2, 3, 4, 5, 6, 7, 12])
@pytest.mark.parametrize("is_linear", [False, True])
def test_levels_do_not_depend_on_the_size_of_blocks(monkeypatch, height, is_linear):
    pixels = noise(height, 3)
    whole = halved_pictures(pixels, is_linear)
    monkeypatch.setattr(mipmaps, "_BLOCK", 12)  # four rows
    parts = halved_pictures(pixels, is_linear)
    assert [part.tolist() for part in parts] == [level.tolist() for level in whole]


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


@pytest.mark.parametrize("size", [(16, 16), (64, 16), (5, 3), (1, 8)])
@pytest.mark.parametrize("own", [True, False])
def test_shaders_see_every_level(ctx, monkeypatch, size, own):
    """Our levels and the driver's match the averages; drivers may treat odd sizes differently."""
    monkeypatch.setattr(mipmaps, "is_software", lambda context: own)
    pixels = noise(*size)
    texture = ctx.texture(size[::-1], 4, pixels.tobytes(), internal_format=SRGB8_ALPHA8)
    add_mipmaps(texture, pixels)
    odd = any(side & (side - 1) for side in size)
    for level, picture in enumerate(halved_pictures(pixels), 1):
        coded = picture[..., :3] / 255.0
        wanted = np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)
        seen = level_as_drawn(ctx, texture, level, picture.shape[1::-1])[..., :3]
        if own or not odd:
            # llvmpipe decodes sRGB with an error of 0.0012. Steps of 8-bit sRGB are at most 0.009
            # in linear light, and the driver rounds at every level.
            np.testing.assert_allclose(seen, wanted, rtol=0, atol=2e-3 if own else 0.01 * level)
    texture.release()


def test_driver_makes_the_levels_of_large_textures(ctx, monkeypatch):
    monkeypatch.setattr(mipmaps, "is_software", lambda context: True)
    monkeypatch.setattr(mipmaps, "_MOST_PIXELS", 15)
    monkeypatch.setattr(mipmaps, "halved_pictures", None)  # must not be called
    pixels = np.full((4, 4, 4), 128, dtype=np.uint8)
    texture = ctx.texture((4, 4), 4, pixels.tobytes(), internal_format=RGBA8)
    add_mipmaps(texture, pixels, is_linear=True)
    seen = level_as_drawn(ctx, texture, 2, (1, 1))
    np.testing.assert_allclose(seen, 128 / 255.0, rtol=0, atol=1e-3)  # 8 bits store it exactly
    texture.release()
