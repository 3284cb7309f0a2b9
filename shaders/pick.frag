#version 330
// Identifies the object at a pixel by indices instead of a colour.

in vec3 v_position;     // camera space
flat in int v_instance;

uniform int u_item;     // number of the draw call, from 1

out ivec4 f_id;         // draw call, instance, triangle, bits of the camera-space z

#ifdef MATERIALS
#pragma include surface
#endif

void main() {
#ifdef MATERIALS
    cut_out(FAINTEST);
#endif
    f_id = ivec4(u_item, v_instance, gl_PrimitiveID, floatBitsToInt(v_position.z));
}
