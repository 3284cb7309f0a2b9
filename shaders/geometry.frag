#version 330
// Normal and depth of the visible surface, for effects in screen space.

in vec3 v_position;     // camera space
in vec3 v_normal;       // camera space, any length

uniform bool u_orthographic;

#ifdef MATERIALS
#pragma include surface
#endif

out vec4 f_geometry;    // unit normal towards the eye, and z in camera space

void main() {
#ifdef MATERIALS
    cut_out(0.0);
#endif
    vec3 to_eye = u_orthographic ? vec3(0.0, 0.0, 1.0) : normalize(-v_position);
    vec3 normal = dot(v_normal, v_normal) > 0.0 ? normalize(v_normal) : to_eye;
    f_geometry = vec4(dot(normal, to_eye) < 0.0 ? -normal : normal, v_position.z);
}
