// The lights of the scene, for every shading that is lit by them.

uniform vec3 u_light_directions[2];  // key and rim: towards each light, unit length, camera space
uniform vec3 u_light_colors[2];      // linear, times strength
uniform vec3 u_up;                   // the scene's up axis, unit length, camera space
uniform vec3 u_sky;                  // ambient light on a surface that faces up, linear
uniform vec3 u_ground;               // on one that faces down

// Hemisphere lighting: what a surface receives from a sky above and a ground below it.
vec3 ambient_light(vec3 normal) {
    return mix(u_ground, u_sky, 0.5 + 0.5 * dot(normal, u_up));
}
