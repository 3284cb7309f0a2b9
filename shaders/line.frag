#version 330
// One colour, sRGB, multiplied by alpha.

uniform vec4 u_line_color;

out vec4 f_color;

void main() {
    f_color = u_line_color;
}
