#version 330
// Motion path that fades with the time difference to the current frame; premultiplied sRGB.

in vec3 v_color;
in float v_time;        // scene time, seconds

uniform float u_now;    // seconds
uniform float u_reach;  // seconds before and after u_now over which the path fades; 0: no fading
uniform float u_opacity;

out vec4 f_color;

void main() {
    float near = u_reach > 0.0 ? clamp(1.0 - abs(v_time - u_now) / u_reach, 0.0, 1.0) : 1.0;
    f_color = vec4(v_color, 1.0) * near * u_opacity;
}
