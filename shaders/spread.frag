#version 330
// Distance along a row to the nearest covered pixel, for both channels of a mask.

uniform sampler2D u_mask;       // coverage, 0 to 1
uniform int u_reach;            // pixels

out vec4 f_color;               // distances, in units of u_reach + 1 pixels

void main() {
    ivec2 place = ivec2(gl_FragCoord.xy);
    ivec2 size = textureSize(u_mask, 0);
    vec2 nearest = vec2(float(u_reach) + 1.0);
    for (int step = -u_reach; step <= u_reach; ++step) {
        int x = clamp(place.x + step, 0, size.x - 1);
        vec2 cover = texelFetch(u_mask, ivec2(x, place.y), 0).rg;
        // The more of a pixel is covered, the farther the edge moves towards its far side.
        vec2 away = max(abs(float(step)) + 0.5 - cover, 0.0);
        nearest = mix(nearest, min(nearest, away), greaterThan(cover, vec2(0.0)));
    }
    f_color = vec4(nearest / (float(u_reach) + 1.0), 0.0, 1.0);
}
