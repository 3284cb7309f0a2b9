#version 330
// A large square on the ground.

in vec2 in_corner;      // -1 or 1

uniform mat4 u_model_view;  // ground space (x right, y up in the image seen from above) to camera
uniform mat4 u_projection;
uniform float u_extent;     // half the side length of the square, scene units

out vec2 v_ground;          // scene units from the grid's centre, where two lines cross

void main() {
    v_ground = u_extent * in_corner;
    gl_Position = u_projection * u_model_view * vec4(v_ground, 0.0, 1.0);
}
