#version 330
// Letters in one colour with a dark rim.

in vec2 v_pixel;                // of the texture
flat in vec3 v_color;           // sRGB: what white becomes

uniform sampler2D u_texture;    // grey and opacity, the first multiplied by the second

out vec4 f_color;               // sRGB, multiplied by alpha

void main() {
    vec2 ink = texelFetch(u_texture, ivec2(v_pixel), 0).rg;
    f_color = vec4(ink.r * v_color, ink.g);
}
