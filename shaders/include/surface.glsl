// The surface of the material that is drawn: its colour, opacity and normal. Files with at most one
// image per material are drawn without MATERIALS, at no extra cost.

in vec2 v_uv;
in vec3 v_color;                // linear

uniform bool u_has_uv;
uniform bool u_textured;
uniform sampler2D u_texture;    // sRGB, decoded by the sampler

#ifndef MATERIALS
vec4 base_color() {
#ifdef UNTEXTURED  // software drivers would sample the texture and discard the result
    return vec4(v_color, 1.0);
#else
    return u_textured ? texture(u_texture, v_uv) : vec4(v_color, 1.0);
#endif
}
#else
const int BASE_MAP = 0, METALLIC_MAP = 1, ROUGHNESS_MAP = 2;
const int NORMAL_MAP = 3, OCCLUSION_MAP = 4, EMISSIVE_MAP = 5;
const int SHADE_MAP = 6;

in vec4 v_other_uvs;            // second and third set of texture coordinates in use
in vec4 v_tint;                 // vertex colour, linear, and opacity

uniform vec4 u_base_factor;     // linear
uniform bool u_has_base_factor; // if false, untextured surfaces use v_color
uniform bool u_has_tint;        // v_tint multiplies the base colour and replaces v_color
uniform bool u_toon;            // toon materials ignore vertex colours
uniform int u_alpha_mode;       // 0: opaque, 1: mask, 2: blend
uniform float u_alpha_cutoff;
uniform mat3 u_places[7];       // transform of the texture coordinates of each image
uniform int u_uv_sets[7];       // 0: v_uv, 1 and 2: v_other_uvs
uniform sampler2D u_normal_map;
uniform float u_normal_scale;   // 0: no map

vec2 place(int map) {
    int set = u_uv_sets[map];
    vec2 uv = set == 0 ? v_uv : set == 1 ? v_other_uvs.xy : v_other_uvs.zw;
    return (u_places[map] * vec3(uv, 1.0)).xy;
}

vec4 base_color() {
    vec4 color = u_has_base_factor ? u_base_factor : vec4(u_has_tint ? vec3(1.0) : v_color, 1.0);
    if (u_textured)
        color = u_base_factor * texture(u_texture, place(BASE_MAP));
    return u_has_tint && !u_toon ? v_tint * color : color;
}

// Opacity of the surface; masked fragments are discarded.
float surface_alpha() {
    if (u_alpha_mode == 0)
        return 1.0;
    float alpha = base_color().a;
    if (u_alpha_mode == 2)
        return alpha;
    if (alpha < u_alpha_cutoff)
        discard;
    return 1.0;
}

const float FAINTEST = 0.05;    // largest alpha of blended surfaces that counts as invisible

// Discards masked fragments, and blended fragments up to this alpha.
void cut_out(float alpha) {
    if (surface_alpha() <= alpha)
        discard;
}

// Normal perturbed by the normal map. Tangents are computed from screen-space derivatives
// (Schueler 2013, "Normal Mapping Without Precomputed Tangents"), so meshes need none, and mirrored
// texture coordinates need no sign. On the back of a surface, side -1, bumps are dents.
vec3 mapped_normal(vec3 position, vec3 normal, float side) {
    if (u_normal_scale == 0.0)
        return normal;
    vec2 uv = place(NORMAL_MAP);
    vec3 mapped = 2.0 * texture(u_normal_map, uv).xyz - 1.0;
    vec3 across = cross(dFdy(position), normal), up = cross(normal, dFdx(position));
    vec2 right_uv = dFdx(uv), up_uv = dFdy(uv);
    vec3 tangent = across * right_uv.x + up * up_uv.x;
    vec3 bitangent = across * right_uv.y + up * up_uv.y;
    float longest = max(dot(tangent, tangent), dot(bitangent, bitangent));
    if (longest == 0.0)
        return normal;
    mapped.xy *= side * u_normal_scale * inversesqrt(longest);
    return normalize(tangent * mapped.x + bitangent * mapped.y + normal * max(mapped.z, 1e-3));
}
#endif
