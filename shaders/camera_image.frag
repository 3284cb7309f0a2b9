#version 330
// A camera's image without its lens distortion: each ideal pixel is looked up where the lens
// projected it (the model of OpenCV, as in viewer/rendering/pinhole.py).

in vec2 v_pixel;                // ideal pixel; 0, 0 is the centre of the first pixel

uniform sampler2D u_texture;    // sRGB, straight alpha, first row at the top
uniform vec2 u_size;            // size of the calibrated image, pixels
uniform mat3 u_intrinsic;       // camera space to pixels
uniform mat3 u_inverse;         // pixels to camera space
uniform float u_lens[8];        // k1 k2 p1 p2 k3 k4 k5 k6
uniform float u_brightness;     // 0 to 1

out vec4 f_color;               // sRGB, premultiplied by alpha

void main() {
    vec2 n = (u_inverse * vec3(v_pixel, 1.0)).xy;
    float r2 = dot(n, n);
    float over = 1.0 + r2 * (u_lens[0] + r2 * (u_lens[1] + r2 * u_lens[4]));
    float under = 1.0 + r2 * (u_lens[5] + r2 * (u_lens[6] + r2 * u_lens[7]));
    vec2 p = vec2(u_lens[2], u_lens[3]);
    vec2 bent = n * over / under + 2.0 * p * n.x * n.y + p.yx * (r2 + 2.0 * n * n);
    vec2 place = ((u_intrinsic * vec3(bent, 1.0)).xy + 0.5) / u_size;
    if (any(lessThan(place, vec2(0.0))) || any(greaterThan(place, vec2(1.0)))) {
        discard;
    }
    vec4 color = texture(u_texture, place);
    f_color = vec4(u_brightness * color.rgb * color.a, color.a);
}
