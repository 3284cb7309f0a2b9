#version 330
// Skins a vertex once per changed pose; transform feedback captures the outputs.

#pragma include normals
#pragma include skinning

uniform bool u_attached;    // false: leave the vertex in its bind pose
uniform vec3 u_rest_shift;  // rest centre minus posed centre
uniform vec3 u_center;      // posed centre, figure space

out vec3 v_position;     // figure space, minus the posed centre
out vec3 v_normal;       // figure space, unit length

#pragma chunk

void main() {
    rest_shift = u_rest_shift;
    center = u_center;
    pose_vertex(u_attached, v_position, v_normal);
}
