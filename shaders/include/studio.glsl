// Image-based lighting by the studio; assets/make_studio.py generates the maps.

uniform sampler2DArray u_studio;    // octahedral maps; the last layer is irradiance / pi
uniform mat3 u_to_studio;           // camera space to studio space: +y up, +z towards the camera
uniform float u_studio_strength;

const float STUDIO_SIZE = 128.0;    // texels per side, with a border of one texel
const float STUDIO_ROUGH = 7.0;     // layer of roughness 1

// Octahedral coordinates of a direction (Cigolle et al. 2014), +y in the middle.
vec2 studio_place(vec3 direction) {
    vec3 d = direction / (abs(direction.x) + abs(direction.y) + abs(direction.z));
    vec2 folded = (1.0 - abs(d.zx)) * vec2(d.x < 0.0 ? -1.0 : 1.0, d.z < 0.0 ? -1.0 : 1.0);
    vec2 uv = d.y < 0.0 ? folded : d.xz;
    return ((0.5 * uv + 0.5) * STUDIO_SIZE + 1.0) / (STUDIO_SIZE + 2.0);
}

// Light that a surface of this roughness reflects from a direction in camera space.
vec3 studio_light(vec3 direction, float roughness) {
    vec2 place = studio_place(u_to_studio * direction);
    float layer = STUDIO_ROUGH * roughness, low = floor(layer);
    vec3 sharp = texture(u_studio, vec3(place, low)).rgb;
    vec3 rough = texture(u_studio, vec3(place, min(low + 1.0, STUDIO_ROUGH))).rgb;
    return u_studio_strength * mix(sharp, rough, layer - low);
}

// Irradiance / pi of a surface with this normal, camera space.
vec3 studio_irradiance(vec3 normal) {
    vec2 place = studio_place(u_to_studio * normal);
    return u_studio_strength * texture(u_studio, vec3(place, STUDIO_ROUGH + 1.0)).rgb;
}
