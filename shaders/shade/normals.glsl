// The normal itself: red, green, blue for right, up, towards the eye.
vec3 shade(vec3 position, vec3 normal, vec3 to_eye) {
    vec3 shown = 0.5 * normal + 0.5;
    return shown * shown;  // about linear, so that encoding shows the usual pastel colours
}
