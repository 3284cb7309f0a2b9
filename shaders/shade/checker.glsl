// Checkerboard of 16 x 16 squares in texture space, to judge stretching and seams.
vec3 shade(vec3 position, vec3 normal, vec3 to_eye) {
    float light = 0.25 + 0.75 * max(dot(normal, to_eye), 0.0);
    if (!u_has_uv) {
        return vec3(0.25) * light;
    }
    vec2 cell = floor(v_uv * 16.0);
    float odd = mod(cell.x + cell.y, 2.0);
    vec3 place = vec3(fract(v_uv), 0.5);
    return mix(vec3(0.08), 0.25 + 0.6 * place, odd) * light;
}
