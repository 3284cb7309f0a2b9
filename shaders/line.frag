#version 330
// Uniform colour: sRGB, premultiplied by alpha.

uniform vec4 u_line_color;

out vec4 f_color;

void main() {
    f_color = u_line_color;
}
