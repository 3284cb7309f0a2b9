#version 330
// Vertex normals as lines: each instance is one line of two vertices.

in vec3 in_position;    // figure units, minus the posed centre
in vec3 in_normal;      // unit length
in float in_shown;      // 0 for vertices of hidden parts, whose lines have no length

uniform mat4 u_model_view;
uniform mat4 u_projection;
uniform float u_length;  // figure units

void main() {
    vec3 position = in_position + float(gl_VertexID % 2) * u_length * in_shown * in_normal;
    gl_Position = u_projection * u_model_view * vec4(position, 1.0);
    gl_Position.z -= 1e-4 * gl_Position.w;
}
