// Scalar quantity as a colour, weakly lit so that colours remain comparable.
flat in vec3 v_corners;          // scalars at the triangle's corners
in vec3 v_barycentric;           // barycentric coordinates

uniform vec2 u_scalar_range;     // lowest and highest value shown
uniform sampler2D u_colormap;    // one row, sRGB, decoded by the sampler
uniform bool u_categories;       // values are columns of u_colormap; negative: no category
uniform bool u_dark_zero;        // show values of exactly 0 in u_nothing
uniform bool u_isolines;         // draw lines at every tenth of the range
uniform vec3 u_nothing;          // linear

vec3 category_color(float number) {
    int column = int(floor(number + 0.5));
    return column < 0 ? u_nothing : texelFetch(u_colormap, ivec2(column, 0), 0).rgb;
}

// Colour of the category with the largest barycentric weight here. Interpolating the numbers would
// yield other categories.
vec3 category() {
    bvec3 same = equal(v_corners.xyz, v_corners.yzx);  // corners 1 and 2, 2 and 3, 3 and 1
    vec3 w = v_barycentric;  // summed over corners of the same category
    w += mix(vec3(0.0), v_barycentric.yzx, same);
    w += mix(vec3(0.0), v_barycentric.zxy, same.zxy);
    int best = w.x >= w.y ? (w.x >= w.z ? 0 : 2) : (w.y >= w.z ? 1 : 2);
    int next = best;
    float second = -1.0;
    for (int corner = 0; corner < 3; corner++)
        if (v_corners[corner] != v_corners[best] && w[corner] > second) {
            next = corner;
            second = w[corner];
        }
    // Blend the two categories across one pixel at their border.
    vec3 widths = fwidth(v_barycentric);
    float width = 2.0 * max(widths.x, max(widths.y, widths.z));
    float blend = clamp(0.5 + (w[best] - second) / max(width, 1e-6), 0.5, 1.0);
    vec3 color = category_color(v_corners[best]);
    return next == best ? color : mix(category_color(v_corners[next]), color, blend);
}

// Pixel coverage of isolines at integers, about 1.5 pixels wide; 0 at the ends of the range and
// where the lines are so dense that they would hide the colours.
float isoline(float tenths) {
    float width = fwidth(tenths);
    float nearest = floor(tenths + 0.5);
    float line = 1.0 - smoothstep(0.4, 1.3, abs(tenths - nearest) / max(width, 1e-9));
    bool counts = width > 1e-6 && nearest > 0.5 && nearest < 9.5;
    return counts ? line * (1.0 - smoothstep(0.2, 0.45, width)) : 0.0;
}

vec3 shade(vec3 position, vec3 normal, vec3 to_eye) {
    float extent = max(u_scalar_range.y - u_scalar_range.x, 1e-30);
    float place = (v_scalar - u_scalar_range.x) / extent;
    float fraction = clamp(place, 0.0, 1.0);
    vec3 color = texture(u_colormap, vec2((0.5 + 255.0 * fraction) / 256.0, 0.5)).rgb;
    if (u_dark_zero && v_corners == vec3(0.0))
        color = u_nothing;
    float line = isoline(10.0 * place);
    if (u_isolines) {
        float brightness = dot(color, vec3(0.2126, 0.7152, 0.0722));
        vec3 ink = brightness > 0.12 ? 0.25 * color : mix(color, vec3(1.0), 0.35);
        color = mix(color, ink, 0.85 * line);
    }
    if (u_categories)
        color = category();
    return color * (0.6 + 0.4 * max(dot(normal, to_eye), 0.0));
}
