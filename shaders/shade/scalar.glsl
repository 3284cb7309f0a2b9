// A number per vertex through a colour map, lit so lightly that colours can be compared.
uniform vec2 u_scalar_range;     // lowest and highest value shown
uniform sampler2D u_colormap;    // 256 x 1, sRGB, decoded by the sampler

vec3 shade(vec3 position, vec3 normal, vec3 to_eye) {
    float width = max(u_scalar_range.y - u_scalar_range.x, 1e-30);
    float share = clamp((v_scalar - u_scalar_range.x) / width, 0.0, 1.0);
    vec3 color = texture(u_colormap, vec2((0.5 + 255.0 * share) / 256.0, 0.5)).rgb;
    return color * (0.6 + 0.4 * max(dot(normal, to_eye), 0.0));
}
