#version 330
// Edges of a posed mesh, with a depth bias that puts them in front of its surface.

in vec3 in_position;    // figure units, minus the posed centre

uniform mat4 u_model_view;
uniform mat4 u_projection;

void main() {
    gl_Position = u_projection * u_model_view * vec4(in_position, 1.0);
    gl_Position.z -= 1e-4 * gl_Position.w;
}
