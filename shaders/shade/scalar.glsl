// A number per vertex as a colour, lit so lightly that colours can be compared.
flat in vec3 v_corners;          // the numbers at the triangle's corners
in vec3 v_shares;                // barycentric coordinates

uniform vec2 u_scalar_range;     // lowest and highest value shown
uniform sampler2D u_colormap;    // one row, sRGB, decoded by the sampler
uniform bool u_categories;       // whole numbers, each a column of u_colormap; none below 0
uniform bool u_dark_zero;        // what is exactly 0 is no colour of the map
uniform bool u_isolines;         // lines at every tenth of the range
uniform vec3 u_nothing;          // linear

vec3 category_color(float number) {
    int column = int(floor(number + 0.5));
    return column < 0 ? u_nothing : texelFetch(u_colormap, ivec2(column, 0), 0).rgb;
}

// The category that has most of the triangle here; numbers in between would be other categories.
vec3 category() {
    bvec3 same = equal(v_corners.xyz, v_corners.yzx);  // first and second, second and third, …
    vec3 shares = v_shares;
    shares += mix(vec3(0.0), v_shares.yzx, same);
    shares += mix(vec3(0.0), v_shares.zxy, same.zxy);
    int best = shares.x >= shares.y ? (shares.x >= shares.z ? 0 : 2) : (shares.y >= shares.z ? 1 : 2);
    int next = best;
    float second = -1.0;
    for (int corner = 0; corner < 3; corner++)
        if (v_corners[corner] != v_corners[best] && shares[corner] > second) {
            next = corner;
            second = shares[corner];
        }
    // Mixed over the one pixel that the border lies in.
    vec3 widths = fwidth(v_shares);
    float width = 2.0 * max(widths.x, max(widths.y, widths.z));
    float share = clamp(0.5 + (shares[best] - second) / max(width, 1e-6), 0.5, 1.0);
    vec3 color = category_color(v_corners[best]);
    return next == best ? color : mix(category_color(v_corners[next]), color, share);
}

// How much of a pixel a line at whole numbers covers, about one and a half pixels wide; none at
// the range's ends, and none where they lie so close that they would hide the colours.
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
    float share = clamp(place, 0.0, 1.0);
    vec3 color = texture(u_colormap, vec2((0.5 + 255.0 * share) / 256.0, 0.5)).rgb;
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
