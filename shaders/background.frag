#version 330
// Vertical gradient, dithered by half a quantization step so that 8 bits show no banding.

in vec2 v_place;        // 0 to 1 from the lower left corner

uniform vec3 u_bottom;  // sRGB
uniform vec3 u_top;     // sRGB

out vec4 f_color;

void main() {
    float noise = fract(52.9829189 * fract(dot(gl_FragCoord.xy, vec2(0.06711056, 0.00583715))));
    f_color = vec4(mix(u_bottom, u_top, v_place.y) + (noise - 0.5) / 255.0, 1.0);
}
