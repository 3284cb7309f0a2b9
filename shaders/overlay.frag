#version 330
// Shows a texture as it is.

in vec2 v_pixel;                // from the lower left corner

uniform sampler2D u_texture;    // sRGB, multiplied by alpha

out vec4 f_color;               // sRGB, multiplied by alpha

void main() {
    f_color = texelFetch(u_texture, ivec2(v_pixel), 0);
}
