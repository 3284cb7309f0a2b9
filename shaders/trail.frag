#version 330
// A colour that fades, sRGB; the result is multiplied by alpha.

in vec3 v_color;
in float v_opacity;

out vec4 f_color;

void main() {
    f_color = vec4(v_color * v_opacity, v_opacity);
}
