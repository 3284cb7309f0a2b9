// Filtered lookups in the key light's shadow map.

uniform sampler2DShadow u_shadow_map;
uniform vec2 u_shadow_filter;       // radius relative to the map's width, rotated by an angle

// Points spread evenly over the unit disc: a spiral of golden angles (Vogel 1979).
const vec2 taps[12] = vec2[](
    vec2(0.2041, 0.0000), vec2(-0.2607, 0.2388), vec2(0.0399, -0.4547), vec2(0.3286, 0.4286),
    vec2(-0.6030, -0.1067), vec2(0.5712, -0.3634), vec2(-0.1911, 0.7107), vec2(-0.3644, -0.7016),
    vec2(0.7906, 0.2887), vec2(-0.8224, 0.3395), vec2(0.3965, -0.8472), vec2(0.2930, 0.9341)
);

// Fraction of the filter around a point of the map (0 to 1 on all axes) that the light reaches.
float unshadowed(vec3 place) {
    mat2 turn = mat2(u_shadow_filter, -u_shadow_filter.y, u_shadow_filter.x);
    float sum = 0.0;
    for (int i = 0; i < 12; ++i)
        sum += texture(u_shadow_map, vec3(place.xy + turn * taps[i], place.z));
    return sum / 12.0;
}
