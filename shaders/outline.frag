#version 330
// Outlines around a mask: a coloured line with a thin dark border.

uniform sampler2D u_mask;       // coverage, 0 to 1: selected, hovered
uniform sampler2D u_distance;   // distance along the row, in units of u_reach + 1 pixels
uniform int u_reach;            // pixels
uniform float u_width;          // width of the coloured line, pixels
uniform vec3 u_colors[2];       // sRGB, selected and hovered

uniform bool u_straight;        // do not multiply by alpha

out vec4 f_color;               // sRGB, premultiplied by alpha unless u_straight

const vec3 DARK = vec3(0.03, 0.04, 0.06);

vec4 line(float away, float cover, vec3 color) {
    float inner = clamp(u_width + 0.5 - away, 0.0, 1.0);
    float outer = clamp(u_width + 1.5 - away, 0.0, 1.0);
    float alpha = max(inner, 0.6 * outer) * (1.0 - cover);
    return vec4(mix(DARK, color, inner), 1.0) * alpha;
}

void main() {
    ivec2 place = ivec2(gl_FragCoord.xy);
    int last = textureSize(u_distance, 0).y - 1;
    float largest = float(u_reach) + 1.0;
    vec2 away = vec2(largest);
    for (int step = -u_reach; step <= u_reach; ++step) {
        ivec2 beside = ivec2(place.x, clamp(place.y + step, 0, last));
        vec2 along = texelFetch(u_distance, beside, 0).rg * largest;
        vec2 found = sqrt(along * along + float(step * step));
        away = mix(away, min(away, found), lessThan(along, vec2(largest - 1e-3)));
    }
    vec2 cover = texelFetch(u_mask, place, 0).rg;
    vec4 selected = line(away.x, cover.x, u_colors[0]);
    vec4 hovered = line(away.y, cover.y, u_colors[1]);
    f_color = hovered + selected * (1.0 - hovered.a);
    if (f_color.a == 0.0) {
        discard;
    }
    f_color.rgb /= u_straight ? f_color.a : 1.0;
}
