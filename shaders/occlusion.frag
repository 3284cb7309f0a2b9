#version 330
// Ambient occlusion in screen space from the horizons around each pixel (Jimenez et al. 2016, GTAO).

uniform sampler2D u_geometry;   // unit normal and z, camera space; z is 0 in the background
uniform vec4 u_unproject;       // camera x and y at depth 1, or at any depth: scale and shift of pixels
uniform bool u_orthographic;
uniform float u_radius;         // scene units
uniform float u_pixels;         // pixels per scene unit, at depth 1 or at any depth
uniform float u_phase;          // phase of the pattern of directions, 0 to 1

out vec2 f_occlusion;           // fraction of the ambient light, and z in camera space

const int SLICES = 2, STEPS = 4;
const float PI = 3.14159265;

vec3 position_at(vec2 pixel, float z) {
    vec2 place = u_unproject.xy * pixel + u_unproject.zw;
    return vec3(u_orthographic ? place : -z * place, z);
}

// Integral of a clamped cosine from the view direction to a horizon; n is the normal's angle.
float arc(float horizon, float n) {
    return 0.25 * (-cos(2.0 * horizon - n) + cos(n) + 2.0 * horizon * sin(n));
}

// Largest cosine of the angle between the view direction and the horizon in one image direction.
float horizon(vec2 pixel, vec2 direction, vec3 position, vec3 to_eye, float reach, float start,
              float lowest) {
    float found = lowest;
    ivec2 last = textureSize(u_geometry, 0) - 1;
    for (int i = 0; i < STEPS; ++i) {
        float part = (float(i) + start) / float(STEPS);
        vec2 place = pixel + direction * max(reach * part * part, float(i) + 1.0);
        ivec2 texel = ivec2(floor(place));
        float z = texelFetch(u_geometry, clamp(texel, ivec2(0), last), 0).a;
        vec3 away = position_at(vec2(texel) + 0.5, z) - position;
        float size = length(away);
        bool counts = z < 0.0 && texel == clamp(texel, ivec2(0), last);
        // Samples beyond the radius count progressively less.
        float kept = counts ? clamp(2.0 - 2.0 * size / u_radius, 0.0, 1.0) : 0.0;
        found = max(found, mix(lowest, dot(away, to_eye) / max(size, 1e-20), kept));
    }
    return found;
}

void main() {
    vec2 pixel = gl_FragCoord.xy;
    vec4 geometry = texelFetch(u_geometry, ivec2(pixel), 0);
    f_occlusion = vec2(1.0, geometry.a);
    if (geometry.a >= 0.0)
        return;
    vec3 position = position_at(pixel, geometry.a), normal = geometry.rgb;
    vec3 to_eye = u_orthographic ? vec3(0.0, 0.0, 1.0) : normalize(-position);
    // The offset prevents rounding errors of the depth from occluding the surface itself.
    position += 1e-3 * u_radius * normal;
    float reach = u_radius * u_pixels / (u_orthographic ? 1.0 : -geometry.a);
    float noise = fract(52.9829189 * fract(dot(pixel, vec2(0.06711056, 0.00583715))) + u_phase);
    float start = fract(noise * 7.0 + 0.5);
    float sum = 0.0;
    for (int slice = 0; slice < SLICES; ++slice) {
        float angle = (float(slice) + noise) * PI / float(SLICES);
        vec2 direction = vec2(cos(angle), sin(angle));
        vec3 tangent = vec3(direction, 0.0);
        vec3 axis = normalize(cross(tangent, to_eye));
        vec3 flat_normal = normal - axis * dot(normal, axis);
        float size = length(flat_normal);
        vec3 ahead = cross(to_eye, axis);
        float n = sign(dot(ahead, flat_normal))
            * acos(clamp(dot(flat_normal, to_eye) / max(size, 1e-6), -1.0, 1.0));
        float high = PI / 2.0;
        float h1 = -acos(clamp(horizon(pixel, -direction, position, to_eye, reach, start,
                                       cos(n - high)), -1.0, 1.0));
        float h2 = acos(clamp(horizon(pixel, direction, position, to_eye, reach, start,
                                      cos(n + high)), -1.0, 1.0));
        h1 = n + max(h1 - n, -high);
        h2 = n + min(h2 - n, high);
        sum += size * (arc(h1, n) + arc(h2, n));
    }
    f_occlusion.r = clamp(sum / float(SLICES), 0.0, 1.0);
}
