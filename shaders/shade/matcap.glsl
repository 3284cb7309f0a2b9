// A lit sphere's image, looked up by the normal (Sloan et al. 2001, "The Lit Sphere").
uniform sampler2D u_matcap;  // sRGB, decoded by the sampler; the sphere touches its edges

vec3 shade(vec3 position, vec3 normal, vec3 to_eye) {
    // Right and up as the eye sees this point, so that perspective does not shift the image.
    vec3 right = normalize(vec3(to_eye.z, 0.0, -to_eye.x));
    vec3 up = cross(to_eye, right);
    vec2 place = vec2(dot(right, normal), dot(up, normal));
    return texture(u_matcap, 0.5 + 0.498 * place).rgb;
}
