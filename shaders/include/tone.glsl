// Conversion of scene-linear light for display: one tone curve, then the sRGB encoding.

// Khronos PBR Neutral (github.com/KhronosGroup/ToneMapping): colours up to 0.8 are unchanged,
// brighter colours approach 1 and fade towards white, so that nothing saturates and no hue shifts.
// The curve's toe is omitted: it removes the 4 % that glossy surfaces reflect in a white room, and
// would blacken surfaces without that reflection.
vec3 toned(vec3 color) {
    const float start = 0.8, desaturation = 0.15;
    // At the start of the curve, the result is exactly the original colour.
    float peak = max(max(color.r, color.g), max(color.b, start));
    float lowered = 1.0 - (1.0 - start) * (1.0 - start) / (peak + 1.0 - 2.0 * start);
    float kept = 1.0 / (desaturation * (peak - lowered) + 1.0);
    return kept * (lowered / peak) * color + lowered * (1.0 - kept);
}

// Linear to sRGB, IEC 61966-2-1. The power 1 / 2.4 is a polynomial of the fourth root, within
// 0.01 of 255 (fitted to the largest error): powers take a tenth of a frame on software drivers.
vec3 encode(vec3 color) {
    vec3 root = sqrt(sqrt(color));
    vec3 high = ((0.0813275 * root - 0.3354952) * root + 1.1226759) * root + 0.1961381;
    return mix(high * root - 0.0646118, 12.92 * color, lessThanEqual(color, vec3(0.0031308)));
}
