#version 330
// Copies a texture unchanged.

in vec2 v_pixel;                // pixels from the lower left corner

uniform sampler2D u_texture;    // sRGB, premultiplied by alpha

out vec4 f_color;               // sRGB, premultiplied by alpha

void main() {
    f_color = texelFetch(u_texture, ivec2(v_pixel), 0);
}
