// Metallic-roughness surfaces as glTF 2.0 defines them (appendix B), lit by the studio and, more
// faintly, by the two lights. The lobe is GGX (Walter et al. 2007) with the height-correlated Smith
// term (Heitz 2014) and Schlick's Fresnel term; the studio's light is evaluated as a split sum
// (Karis 2013) with multiple-scattering compensation (Fdez-Aguera 2019).
#pragma include studio
uniform float u_metallic;
uniform float u_roughness;
uniform sampler2D u_split_sum;  // scale and bias of the reflectance, by n . v and roughness
uniform bool u_unlit;
#ifdef MATERIALS
uniform sampler2D u_metallic_map;
uniform sampler2D u_roughness_map;
uniform sampler2D u_occlusion_map;
uniform sampler2D u_emissive_map;
uniform vec4 u_channels[7];     // which channel of a texel is used
uniform bool u_has_metallic_map;
uniform bool u_has_roughness_map;
uniform bool u_has_emissive_map;
uniform float u_occlusion_map_strength;  // 0: no map
uniform vec3 u_emissive;        // linear
uniform vec3 u_shade_color;     // colour of the side away from the key light, linear
uniform vec2 u_shade_range;     // cosines at which the surface is fully in shade and fully lit
uniform sampler2D u_shade_map;
uniform bool u_has_shade_map;
uniform bool u_has_rim;         // true: the metallic and roughness maps are matcap and rim map
uniform vec3 u_rim_color;       // linear
uniform float u_rim_power;
uniform float u_rim_lift;
uniform float u_rim_mix;        // 0 to 1: degree to which the light multiplies the rim
uniform vec3 u_matcap_factor;   // linear
#endif

const float PI = 3.14159265358979;
const float LIGHTS = 0.30;      // strength of the two lights relative to the studio's
const float BOX = 0.5;          // fraction of the studio's light on a surface facing its key light
const float SMOOTHEST = 0.045;  // lowest roughness with visible highlights of point lights

struct Surface {
    vec3 diffuse;               // albedo
    vec3 specular;              // reflectance at normal incidence
    float roughness;
};

// The selected channel of a texel.
#ifdef MATERIALS
float number(sampler2D map, int index) {
    return dot(texture(map, place(index)), u_channels[index]);
}
#endif

Surface surface(vec3 base) {
    float metallic = u_metallic, roughness = u_roughness;
#ifdef MATERIALS
    if (u_has_metallic_map)
        metallic *= number(u_metallic_map, METALLIC_MAP);
    if (u_has_roughness_map)
        roughness *= number(u_roughness_map, ROUGHNESS_MAP);
#endif
    return Surface(base * (1.0 - metallic), mix(vec3(0.04), base, metallic), roughness);
}

// Studio light reflected towards the eye.
vec3 surrounding(Surface s, vec3 normal, vec3 to_eye, float occlusion) {
    float n_v = clamp(dot(normal, to_eye), 1e-3, 1.0);
    vec2 table = texture(u_split_sum, vec2(n_v, s.roughness)).rg;
    vec3 single = s.specular * table.x + table.y;
    float lost = 1.0 - (table.x + table.y);
    vec3 average = s.specular + (1.0 - s.specular) / 21.0;
    vec3 several = single * average / (1.0 - lost * average) * lost;
    vec3 diffuse = s.diffuse * (1.0 - single - several);
    vec3 reflected = studio_light(reflect(-to_eye, normal), s.roughness);
    return occlusion * (single * reflected + (several + diffuse) * studio_irradiance(normal));
}

// Light from one direction reflected towards the eye: BRDF times pi times cosine.
vec3 direct(Surface s, vec3 normal, vec3 to_eye, vec3 to_light) {
    float n_l = dot(normal, to_light), n_v = max(dot(normal, to_eye), 1e-3);
    if (n_l <= 0.0)
        return vec3(0.0);
    vec3 halfway = normalize(to_light + to_eye);
    float n_h = clamp(dot(normal, halfway), 0.0, 1.0), v_h = clamp(dot(to_eye, halfway), 0.0, 1.0);
    float alpha = max(s.roughness, SMOOTHEST);
    float squared = alpha * alpha * alpha * alpha;
    float narrow = n_h * n_h * (squared - 1.0) + 1.0;
    float lobe = squared / (narrow * narrow);  // GGX lobe times pi
    float smith = n_l * sqrt(n_v * n_v * (1.0 - squared) + squared)
        + n_v * sqrt(n_l * n_l * (1.0 - squared) + squared);
    vec3 fresnel = s.specular + (1.0 - s.specular) * pow(1.0 - v_h, 5.0);
    return n_l * ((1.0 - fresnel) * s.diffuse + fresnel * (0.5 * lobe / smith));
}

#ifdef MATERIALS
// Light at the edges of a toon surface, with this fraction of the key light.
vec3 rim(vec3 normal, vec3 to_eye, float seen) {
    float edge = clamp(1.0 - dot(normal, to_eye) + u_rim_lift, 0.0, 1.0);
    vec3 color = u_rim_color * pow(max(edge, 1e-6), u_rim_power);
    if (u_has_metallic_map) {
        vec3 right = normalize(vec3(to_eye.z, 0.0, -to_eye.x)), up = cross(to_eye, right);
        vec2 uv = 0.5 + 0.5 * vec2(dot(right, normal), dot(up, normal));
        color += u_matcap_factor * texture(u_metallic_map, uv).rgb;
    }
    if (u_has_roughness_map)
        color *= texture(u_roughness_map, place(ROUGHNESS_MAP)).rgb;
    return color * mix(1.0, seen, u_rim_mix);
}

// Two colours of a surface, by the angle of incidence of the key light (VRMC_materials_mtoon 1.0).
vec3 toon(vec3 lit, vec3 position, vec3 normal, vec3 to_eye) {
    vec3 dark = u_shade_color;
    if (u_has_shade_map)
        dark *= texture(u_shade_map, place(SHADE_MAP)).rgb;
    float cosine = dot(normal, u_light_directions[0]), width = u_shade_range.y - u_shade_range.x;
    float part = clamp((cosine - u_shade_range.x) / max(width, 1e-4), 0.0, 1.0);
    float seen = visibility(0, position, normal, max(cosine, 0.0));
    part *= seen;
    vec3 color = u_emissive;
    if (u_has_emissive_map)
        color *= texture(u_emissive_map, place(EMISSIVE_MAP)).rgb;
    if (u_has_rim)
        color += rim(normal, to_eye, seen);
    return color + mix(dark, lit, part);
}
#endif

vec3 shade(vec3 position, vec3 normal, vec3 to_eye) {
    vec3 base = base_color().rgb;
#ifdef MATERIALS
    if (u_toon)
        return toon(base, position, normal, to_eye);
#endif
    if (u_unlit)
        return base;
    Surface s = surface(base);
    float occlusion = 1.0;
    vec3 color = vec3(0.0);
#ifdef MATERIALS
    if (u_occlusion_map_strength > 0.0)
        occlusion = mix(1.0, number(u_occlusion_map, OCCLUSION_MAP), u_occlusion_map_strength);
    color = u_emissive;
    if (u_has_emissive_map)
        color *= texture(u_emissive_map, place(EMISSIVE_MAP)).rgb;
#endif
    float ambient = ambient_visibility(position.z);
    occlusion *= ambient;
    for (int i = 0; i < 2; ++i) {
        float cosine = max(dot(normal, u_light_directions[i]), 0.0);
        float seen = visibility(i, position, normal, cosine);
        // Only the key light has a shadow map; occlusion approximates the rim light's shadow.
        seen *= i == 1 ? mix(1.0, ambient, 0.7) : 1.0;
        color += seen * LIGHTS * u_light_colors[i] * direct(s, normal, to_eye, u_light_directions[i]);
        // The studio's key softbox is near the key light, so the same objects block it.
        if (i == 0)
            occlusion *= 1.0 - BOX * cosine * (1.0 - seen);
    }
    color += surrounding(s, normal, to_eye, occlusion);
    return toned(color);
}
