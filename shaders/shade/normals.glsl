// The normal as a colour: red, green and blue for right, up and towards the eye.
vec3 shade(vec3 position, vec3 normal, vec3 to_eye) {
    vec3 shown = 0.5 * normal + 0.5;
    return shown * shown;  // roughly linear, so that sRGB encoding yields the usual pastel colours
}
