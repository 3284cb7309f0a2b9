// The lights of the scene, for all lit shading modes.

uniform vec3 u_light_directions[2];  // to the key and rim lights, unit length, camera space
uniform vec3 u_light_colors[2];      // linear colour times strength
uniform vec3 u_up;                   // the scene's up axis, unit length, camera space
uniform vec3 u_ambient;              // ambient light on an upright surface, linear
uniform vec3 u_ambient_growth;       // added to surfaces that face up, subtracted if they face down

// Hemisphere lighting: light that a surface receives from the sky above and the ground below.
vec3 ambient_light(vec3 normal) {
    return u_ambient + u_ambient_growth * dot(normal, u_up);
}

#ifdef SHADOWS
uniform mat4 u_shadow_matrix;    // camera space to the shadow map, 0 to 1 on all axes
uniform float u_shadow_offset;   // offset along the normal of a surface at grazing incidence
uniform float u_shadow_strength;
#endif

// Fraction of the key or rim light that reaches a surface at this cosine of the incidence angle.
float visibility(int light, vec3 position, vec3 normal, float cosine) {
#ifdef SHADOWS
    if (light != 0)
        return 1.0;
    float sine = sqrt(max(1.0 - cosine * cosine, 0.0));
    vec3 lifted = position + u_shadow_offset * (0.2 + sine) * normal;
    vec4 place = u_shadow_matrix * vec4(lifted, 1.0);
    return 1.0 - u_shadow_strength * (1.0 - unshadowed(place.xyz));
#else
    return 1.0;
#endif
}

#ifdef OCCLUSION
uniform sampler2D u_occlusion;   // fraction of the ambient light, and depth; at half resolution
uniform float u_occlusion_strength;
#endif

// Fraction of the ambient light that reaches a surface at this depth in camera space.
float ambient_visibility(float depth) {
#ifdef OCCLUSION
    // Bilateral upsampling: neighbours are weighted by their similarity in depth.
    vec2 place = 0.5 * gl_FragCoord.xy - 0.5;
    ivec2 corner = ivec2(floor(place)), last = textureSize(u_occlusion, 0) - 1;
    vec2 part = place - vec2(corner);
    float sum = 0.0, weights = 0.0;
    for (int i = 0; i < 4; ++i) {
        ivec2 step = ivec2(i & 1, i >> 1);
        vec2 found = texelFetch(u_occlusion, clamp(corner + step, ivec2(0), last), 0).rg;
        vec2 near = mix(1.0 - part, part, vec2(step)) + 0.01;
        float weight = near.x * near.y / (1e-3 + abs(found.g / depth - 1.0));
        sum += weight * found.r;
        weights += weight;
    }
    return 1.0 - u_occlusion_strength * (1.0 - sum / weights);
#else
    return 1.0;
#endif
}
