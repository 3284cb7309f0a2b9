#version 330
// Ground grid: lines one pixel wide at any distance, every tenth one stronger, fading out with
// distance.

in vec2 v_ground;

uniform float u_step;       // distance between lines, scene units
uniform vec2 u_origin;      // the scene's origin, in grid steps from v_ground = 0
uniform float u_fade;       // distance at which the grid has faded out, scene units
uniform vec3 u_line_color;  // sRGB

out vec4 f_color;           // sRGB, premultiplied by alpha

// Coverage of lines at integers, given the width of a pixel; 0 if the lines are less than a pixel
// apart.
float lines(vec2 place, vec2 width) {
    vec2 distance = abs(fract(place - 0.5) - 0.5) / width;
    vec2 line = clamp(1.0 - distance, 0.0, 1.0) * clamp(1.0 - 2.0 * width, 0.0, 1.0);
    return max(line.x, line.y);
}

void main() {
    vec2 place = v_ground / u_step - u_origin;
    vec2 width = max(fwidth(place), vec2(1e-5));
    float strength = max(0.45 * lines(place, width), 0.9 * lines(0.1 * place, 0.1 * width));
    float away = clamp(length(v_ground) / u_fade, 0.0, 1.0);
    float alpha = strength * (1.0 - away) * (1.0 - away);
    f_color = vec4(u_line_color * alpha, alpha);
}
