#version 330
// A disc, or a line with round ends, in a bright colour with a dark border; multiplied by alpha.

flat in vec2 v_start;   // pixels
flat in vec2 v_end;
flat in float v_radius;

uniform float u_border;     // pixels
uniform float u_opacity;
uniform vec3 u_mark_color;  // sRGB
uniform vec3 u_border_color;

out vec4 f_color;

void main() {
    vec2 way = v_end - v_start, from_start = gl_FragCoord.xy - v_start;
    float along = dot(way, way) > 0.0 ? clamp(dot(from_start, way) / dot(way, way), 0.0, 1.0) : 0.0;
    float away = length(from_start - along * way);
    float inside = clamp(v_radius + 0.5 - away, 0.0, 1.0);
    float covered = clamp(v_radius + u_border + 0.5 - away, 0.0, 1.0);
    if (covered <= 0.0) discard;
    f_color = vec4(mix(u_border_color, u_mark_color, inside), 1.0) * covered * u_opacity;
}
