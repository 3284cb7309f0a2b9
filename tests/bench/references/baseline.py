"""A minimal program that draws and saves a frame with numpy, moderngl, Pillow and one shader.
``viewer render`` is compared with ``python references/baseline.py OUTPUT.png``, which draws as many
triangles as the bundled figure has at 1280 x 720, four samples per pixel, without reading any file.
"""

import io
import sys
from pathlib import Path

import moderngl
import numpy as np
from PIL import Image

SIZE = 1280, 720
VERTEX = """#version 330
in vec3 in_position;
out vec3 v_color;
void main() {
    v_color = 0.5 + 0.5 * in_position;
    gl_Position = vec4(in_position, 1.0);
}
"""
FRAGMENT = """#version 330
in vec3 v_color;
out vec4 f_color;
void main() {
    f_color = vec4(pow(v_color, vec3(1.0 / 2.2)), 1.0);
}
"""


def main() -> None:
    """Draw a ball and write the picture."""
    context = moderngl.create_context(
        standalone=True, backend="egl", libegl="libEGL.so.1", libgl="libGL.so.1"
    )
    program = context.program(vertex_shader=VERTEX, fragment_shader=FRAGMENT)
    rings, sides = 60, 130
    polar, around = np.linspace(0, np.pi, rings), np.linspace(0, 2 * np.pi, sides)
    p, a = np.meshgrid(polar, around, indexing="ij")
    points = 0.5 * np.stack([np.sin(p) * np.sin(a), np.cos(p), np.sin(p) * np.cos(a)], -1)
    corner = (np.arange(rings - 1)[:, None] * sides + np.arange(sides - 1)).ravel()
    quads = np.stack([corner, corner + 1, corner + sides, corner + 1, corner + sides + 1], 1)
    indices = np.ascontiguousarray(quads[:, [0, 1, 2, 3, 4, 2]], dtype="u4")
    vertices, elements = context.buffer(points.astype("f4")), context.buffer(indices)
    array = context.vertex_array(program, [(vertices, "3f4", "in_position")], elements)
    samples = min(4, context.max_samples)
    color, depth = (
        context.renderbuffer(SIZE, 4, samples=samples),
        context.depth_renderbuffer(SIZE, samples=samples),
    )
    target = context.framebuffer([color], depth)
    resolved = context.framebuffer([context.renderbuffer(SIZE, 4)])
    target.use()
    target.clear(0.4, 0.5, 0.6, 1.0)
    context.enable(moderngl.DEPTH_TEST)
    array.render()
    context.copy_framebuffer(resolved, target)
    rows = np.frombuffer(resolved.read(components=4), dtype=np.uint8)
    pixels = rows.reshape(SIZE[1], SIZE[0], 4)[::-1]
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, "PNG", compress_level=1)
    Path(sys.argv[1]).write_bytes(stream.getvalue())


main()
