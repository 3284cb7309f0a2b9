#version 330
// The key light's shadow on the ground: black with an opacity, so that it also shows on a
// transparent background.

#pragma include shadow

in vec2 v_place;            // position in a part of the shadow map, 0 to 1

uniform vec4 u_part;        // lower corner and size of that part in the map, 0 to 1
uniform vec3 u_depth;       // depth in the map at v_place 0, and its increase along each axis
uniform float u_opacity;

out vec4 f_color;           // sRGB, premultiplied by alpha

void main() {
    float depth = min(u_depth.x + dot(u_depth.yz, v_place), 1.0);
    vec2 place = u_part.xy + u_part.zw * v_place;
    f_color = vec4(0.0, 0.0, 0.0, u_opacity * (1.0 - unshadowed(vec3(place, depth))));
}
