#version 330
// Writes depth only. A blended surface covers a fraction of the texels equal to its alpha, in a
// pattern that the shadow filter averages.

#ifdef MATERIALS
#pragma include surface

uniform float u_threshold;      // phase of the pattern, 0 to 1

// Ordered dithering of 4 x 4 texels (Bayer 1973): 16 levels from 0 to 1.
float pattern() {
    ivec2 place = ivec2(gl_FragCoord.xy) & 3;
    int x = place.x ^ place.y, y = place.y;
    int level = (x & 1) << 3 | (y & 1) << 2 | (x & 2) | y >> 1;
    return fract((float(level) + 0.5) / 16.0 + u_threshold);
}
#endif

void main() {
#ifdef MATERIALS
    cut_out(pattern());
#endif
}
