#version 330
// One axis of a separable Gaussian blur of two fields of darkness. The first pass
// converts depths to darkness.

in vec2 v_place;

uniform sampler2D u_field;  // depth from below the ground, or the fields blurred along one axis
uniform bool u_is_depth;
uniform float u_bottom;     // heights at depths 0 and 1, in figure sizes
uniform float u_top;
uniform float u_near;       // height at which contact ends
uniform vec2 u_narrow;      // standard deviations of the two blurs, in field widths
uniform vec2 u_wide;

out vec2 f_darkness;        // darkness by contact, and by occluders farther above

const int REACH = 8;        // samples on either side, over two and a half deviations

vec2 darkness(vec2 place) {
    vec2 found = texture(u_field, place).rg;
    if (u_is_depth) {
        float height = max(mix(u_bottom, u_top, found.r), 0.0);
        found = clamp(1.0 - height / vec2(u_near, u_top), 0.0, 1.0);
        found *= found;
    }
    return found;
}

void main() {
    vec2 sum = vec2(0.0);
    float weights = 0.0;
    for (int i = -REACH; i <= REACH; ++i) {
        float at = 2.5 * float(i) / float(REACH), weight = exp(-0.5 * at * at);
        sum.r += weight * darkness(v_place + at * u_narrow).r;
        sum.g += weight * darkness(v_place + at * u_wide).g;
        weights += weight;
    }
    f_darkness = sum / weights;
}
