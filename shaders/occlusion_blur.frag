#version 330
// Bilateral blur of ambient occlusion: means of 5 by 5 neighbours of similar depth.

uniform sampler2D u_occlusion;  // fraction of the ambient light, and z in camera space
uniform float u_radius;         // depth difference beyond which neighbours are ignored

out vec2 f_occlusion;

void main() {
    ivec2 middle = ivec2(gl_FragCoord.xy), last = textureSize(u_occlusion, 0) - 1;
    vec2 found = texelFetch(u_occlusion, middle, 0).rg;
    f_occlusion = found;
    if (found.g >= 0.0)
        return;
    float sum = 0.0, weights = 0.0;
    for (int i = 0; i < 25; ++i) {
        ivec2 at = clamp(middle + ivec2(i % 5 - 2, i / 5 - 2), ivec2(0), last);
        vec2 other = texelFetch(u_occlusion, at, 0).rg;
        float weight = max(1.0 - abs(other.g - found.g) / u_radius, 0.0);
        sum += weight * other.r;
        weights += weight;
    }
    f_occlusion.r = sum / weights;
}
