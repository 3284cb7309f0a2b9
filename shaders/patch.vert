#version 330
// A parallelogram on the ground.

in vec2 in_corner;          // 0 or 1 along both sides

uniform mat4 u_model_view;  // from the parallelogram's own axes to camera space
uniform mat4 u_projection;

out vec2 v_place;           // 0 to 1

void main() {
    v_place = in_corner;
    gl_Position = u_projection * u_model_view * vec4(in_corner, 0.0, 1.0);
}
