#version 330
// Coverage of the outlined parts: one channel for each kind of outline.

uniform vec4 u_mask;

out vec4 f_color;

void main() {
    f_color = u_mask;
}
