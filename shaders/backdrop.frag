#version 330
// The studio out of focus, dithered by half a quantization step so that 8 bits show no banding.

#pragma include tone
#pragma include studio

in vec3 v_ray;              // camera space

const float BLUR = 0.6;     // roughness that determines the blur

out vec4 f_color;           // sRGB

void main() {
    float noise = fract(52.9829189 * fract(dot(gl_FragCoord.xy, vec2(0.06711056, 0.00583715))));
    vec3 light = studio_light(normalize(v_ray), BLUR);
    f_color = vec4(encode(toned(light)) + (noise - 0.5) / 255.0, 1.0);
}
