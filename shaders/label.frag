#version 330
// Text in one colour with a dark outline.

in vec2 v_pixel;                // texel coordinates
flat in vec3 v_color;           // sRGB colour of the letters

uniform sampler2D u_texture;    // grey value premultiplied by opacity, and opacity

out vec4 f_color;               // sRGB, premultiplied by alpha

void main() {
    vec2 ink = texelFetch(u_texture, ivec2(v_pixel), 0).rg;
    f_color = vec4(ink.r * v_color, ink.g);
}
