"""Mipmap levels of textures: averages in linear light, as shaders sample them."""

import moderngl
import numpy as np
import pytest

from viewer.rendering.gpu.upload import picture_texture


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


def test_sides_of_any_length_have_all_levels(ctx):
    texture = picture_texture(ctx, np.full((5, 3, 4), 128, dtype=np.uint8), [], is_linear=True)
    for level, size in enumerate([(3, 5), (1, 2), (1, 1)]):
        seen = level_as_drawn(ctx, texture, level, size)
        np.testing.assert_allclose(seen, 128 / 255.0, rtol=0, atol=1e-3)  # 8 bits store it exactly
    texture.release()
