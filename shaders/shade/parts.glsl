// Body parts in distinct colours, lit from the eye; a figure without parts has one colour.
vec3 shade(vec3 position, vec3 normal, vec3 to_eye) {
    float light = 0.25 + 0.75 * max(dot(normal, to_eye), 0.0);
    return v_color * light;
}
