#version 330
// A colour that fades away from the present, sRGB; the result is multiplied by alpha.

in vec3 v_color;
in float v_time;        // seconds of the scene's clock

uniform float u_now;    // seconds
uniform float u_reach;  // seconds back and forth at which nothing is left; 0: all is as strong
uniform float u_opacity;

out vec4 f_color;

void main() {
    float near = u_reach > 0.0 ? clamp(1.0 - abs(v_time - u_now) / u_reach, 0.0, 1.0) : 1.0;
    f_color = vec4(v_color, 1.0) * near * u_opacity;
}
