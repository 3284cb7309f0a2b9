#version 330
// A line with round caps and an optional border, antialiased over one pixel; premultiplied by
// alpha.

in vec4 v_color;                // sRGB and opacity
noperspective in vec2 v_place;  // pixels along and across the segment
flat in float v_length;         // pixels
flat in float v_radius;         // pixels

uniform float u_opacity;
uniform float u_border;         // pixels
uniform vec3 u_border_color;    // sRGB

out vec4 f_color;

void main() {
    float away = length(v_place - vec2(clamp(v_place.x, 0.0, v_length), 0.0));
    float inside = clamp(v_radius + 0.5 - away, 0.0, 1.0);
    float cover = clamp(v_radius + u_border + 0.5 - away, 0.0, 1.0);
    vec3 color = u_border > 0.0 ? mix(u_border_color, v_color.rgb, inside) : v_color.rgb;
    f_color = vec4(color, 1.0) * v_color.a * cover * u_opacity;
}
