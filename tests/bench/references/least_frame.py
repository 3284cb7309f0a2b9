"""A minimal program that draws frames of a moving figure, for ``bench_frames.py``.

The four strongest influences of each vertex are attributes; one shader skins and projects the
vertices, another shades them with two lights. Back faces are culled, the background has one colour,
and the picture is read as OpenGL stores it. Without options, textures or error handling, it is a
lower bound for the same driver, not a goal.
"""

import moderngl
import numpy as np

from viewer.rendering.camera import Camera
from viewer.rigs.arrays import Floats
from viewer.rigs.figure import Figure

__all__ = ["LeastFrame"]

_VERTEX = """#version 330
in vec3 in_position; in vec3 in_normal; in uvec4 in_joints; in vec4 in_weights;
uniform sampler2D u_palette; uniform mat4 u_projection; uniform mat4 u_view;
out vec3 v_position; out vec3 v_normal;
vec4 row(uint joint, int row) { return texelFetch(u_palette, ivec2(3 * int(joint) + row, 0), 0); }
void main() {
    vec4 x = vec4(0.0), y = vec4(0.0), z = vec4(0.0), p = vec4(in_position, 1.0);
    for (int i = 0; i < 4; ++i) {
        x += in_weights[i] * row(in_joints[i], 0);
        y += in_weights[i] * row(in_joints[i], 1);
        z += in_weights[i] * row(in_joints[i], 2);
    }
    vec4 n = vec4(in_normal, 0.0);
    v_normal = mat3(u_view) * vec3(dot(x, n), dot(y, n), dot(z, n));
    v_position = (u_view * vec4(dot(x, p), dot(y, p), dot(z, p), 1.0)).xyz;
    gl_Position = u_projection * vec4(v_position, 1.0);
}
"""
_FRAGMENT = """#version 330
in vec3 v_position; in vec3 v_normal;
uniform vec3 u_lights[2]; uniform vec3 u_colors[2];
out vec4 f_color;
void main() {
    vec3 normal = normalize(v_normal), to_eye = -normalize(v_position);
    vec3 color = vec3(0.1);
    for (int i = 0; i < 2; ++i) {
        vec3 halfway = normalize(u_lights[i] + to_eye);
        float shine = pow(max(dot(normal, halfway), 0.0), 32.0);
        color += u_colors[i] * (0.6 * max(dot(normal, u_lights[i]), 0.0) + 0.18 * shine);
    }
    f_color = vec4(pow(color, vec3(1.0 / 2.2)), 1.0);
}
"""


class LeastFrame:
    """A figure that is drawn and read as a picture.

    Parameters
    ----------
    context : moderngl.Context
        The current context.
    figure : Figure
        Figure with a mesh, a skeleton and a skin.
    camera : Camera
        The fixed camera.
    box : (2, 3)
        Bounds for the depth range.
    size : (int, int)
        Width and height, pixels.
    samples : int
        Samples per pixel.
    """

    def __init__(
        self,
        context: moderngl.Context,
        figure: Figure,
        camera: Camera,
        box: Floats,
        size: tuple[int, int],
        samples: int,
    ) -> None:
        self.context = context
        self.skeleton, self.skin = figure.require_skeleton(), figure.require_skin()
        mesh = figure.require_mesh()
        joints, weights = _strongest(figure)
        context.disable(moderngl.BLEND)
        self.program = context.program(vertex_shader=_VERTEX, fragment_shader=_FRAGMENT)
        content = [
            (context.buffer(mesh.positions.astype("f4").tobytes()), "3f4", "in_position"),
            (context.buffer(mesh.normals.astype("f4").tobytes()), "3f4", "in_normal"),
            (context.buffer(joints.astype("u1").tobytes()), "4u1", "in_joints"),
            (context.buffer(weights.astype("f4").tobytes()), "4f4", "in_weights"),
        ]
        indices = context.buffer(mesh.triangles.astype("u4").tobytes())
        self.array = context.vertex_array(self.program, content, index_buffer=indices)
        self.palette = context.texture((3 * self.skin.n_joints, 1), 4, dtype="f4")
        self.palette.filter = (moderngl.NEAREST, moderngl.NEAREST)
        projection = camera.projection_matrix(size[0] / size[1], box)
        self.program["u_projection"].write(projection.T.astype("f4").tobytes())
        self.program["u_view"].write(camera.view_matrix().T.astype("f4").tobytes())
        self.program["u_lights"].value = [(-0.51, 0.64, 0.57), (0.88, 0.28, -0.39)]
        self.program["u_colors"].value = [(1.05, 0.9, 0.71), (0.35, 0.62, 1.15)]
        self.image = context.framebuffer(
            [context.texture(size, 4)], None if samples > 1 else context.depth_renderbuffer(size)
        )
        self.target = self.image
        if samples > 1:
            self.target = context.framebuffer(
                [context.renderbuffer(size, 4, samples=samples)],
                context.depth_renderbuffer(size, samples=samples),
            )
        self.levels = _levels(self.skeleton.parents)
        self.rest = np.zeros((self.skeleton.n_joints, 4, 4))
        self.rest[:, :3, 3], self.rest[:, 3, 3] = self.skeleton.rest_translations, 1.0

    def frame(self, angles: Floats) -> bytes:
        """Pose by (J, 3) Euler angles in radians, draw, and return the bytes of the picture."""
        world = self.rest.copy()
        world[:, :3, :3] = _rotations(angles)
        for above, below in self.levels:
            world[below] = world[above] @ world[below]
        rows = (world @ self.skin.inverse_bind)[:, :3].astype("f4")
        self.palette.write(rows.tobytes())
        self.target.use()
        self.target.clear(0.6, 0.65, 0.7, 1.0)
        self.context.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        self.palette.use(0)
        self.array.render()
        if self.target is not self.image:
            self.context.copy_framebuffer(self.image, self.target)
        return self.image.read(components=4)


def _strongest(figure: Figure) -> tuple[Floats, Floats]:
    """Return the four strongest joints of each vertex and their normalised weights, (V, 4)."""
    skin, count = figure.require_skin(), figure.require_mesh().n_vertices
    joints, weights = np.zeros((count, 4)), np.zeros((count, 4))
    for vertex in range(count):
        span = slice(skin.starts[vertex], skin.starts[vertex + 1])
        order = np.argsort(-skin.weights[span])[:4]
        joints[vertex, : len(order)] = skin.joints[span][order]
        weights[vertex, : len(order)] = skin.weights[span][order]
    return joints, weights / weights.sum(axis=1, keepdims=True)


def _levels(parents: Floats) -> list[tuple[Floats, Floats]]:
    """Return the passes of pointer doubling: indices of ancestors and joints."""
    ancestors, passes = parents.copy(), []
    below = np.flatnonzero(ancestors >= 0)
    while len(below):
        above = ancestors[below]
        passes.append((above, below))
        ancestors[below] = ancestors[above]
        below = below[ancestors[below] >= 0]
    return passes


def _rotations(angles: Floats) -> Floats:
    """Return Rz Ry Rx of Euler angles: (J, 3, 3)."""
    (a, b, c), (p, q, r) = np.cos(angles).T, np.sin(angles).T
    rows = [b * c, c * p * q - a * r, a * c * q + p * r]
    rows += [b * r, a * c + p * q * r, a * q * r - c * p, -q, b * p, a * b]
    return np.stack(rows, axis=1).reshape(-1, 3, 3)
