#version 330
// What is seen at a pixel, in numbers.

in vec3 v_position;     // camera space
flat in int v_instance;

uniform int u_item;     // which draw, from 1 on

out ivec4 f_id;         // draw, instance, triangle, depth in camera space as the bits of a float

void main() {
    f_id = ivec4(u_item, v_instance, gl_PrimitiveID, floatBitsToInt(v_position.z));
}
