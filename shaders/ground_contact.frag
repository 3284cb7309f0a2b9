#version 330
// Contact shadows on the ground: black with an opacity, so that they also show on a transparent
// background.

in vec2 v_place;            // position in the field, 0 to 1

uniform sampler2D u_field;  // darkness by contact, and by occluders farther above
uniform vec2 u_opacity;     // opacity of each kind

out vec4 f_color;           // sRGB, premultiplied by alpha

void main() {
    vec2 light = 1.0 - u_opacity * texture(u_field, v_place).rg;
    f_color = vec4(0.0, 0.0, 0.0, 1.0 - light.x * light.y);
}
