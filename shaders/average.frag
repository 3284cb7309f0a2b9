#version 330
// Multiplies a texture by a factor.

in vec2 v_place;

uniform sampler2D u_texture;
uniform float u_factor;

out vec4 f_color;

void main() {
    f_color = u_factor * texelFetch(u_texture, ivec2(gl_FragCoord.xy), 0);
}
