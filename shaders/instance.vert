#version 330
// Skins and transforms a vertex of an instanced mesh: one instance per actor of a shared figure.

#pragma include normals
#pragma include skinning

in vec2 in_uv;              // v = 0 at the bottom row of the texture
in vec3 in_color;           // linear
in vec4 in_model_x;         // per instance: rows of the matrix from figure space, minus the posed
in vec4 in_model_y;         // centre, to camera space
in vec4 in_model_z;
in vec3 in_actor_color;     // per instance: linear
in vec3 in_rest_shift;      // per instance: rest centre minus posed centre
in vec3 in_center;          // per instance: posed centre, figure space

uniform mat4 u_projection;
uniform bool u_has_colors;  // use in_color instead of in_actor_color

out vec3 v_position;        // camera space
out vec3 v_normal;          // camera space, any length
out vec2 v_uv;
out vec3 v_color;
out float v_scalar;
flat out float v_opacity;
flat out int v_instance;

#ifdef MATERIALS
in vec4 in_other_uvs;   // second and third set of texture coordinates in use
in vec4 in_tint;        // linear, with opacity
out vec4 v_other_uvs;
out vec4 v_tint;
#endif

#pragma chunk

void main() {
    rest_shift = in_rest_shift;
    center = in_center;
    vec3 position, normal;
    pose_vertex(true, position, normal);
    vec4 point = vec4(position, 1.0);
    v_position = vec3(dot(in_model_x, point), dot(in_model_y, point), dot(in_model_z, point));
    v_normal = inverse_transposed(in_model_x.xyz, in_model_y.xyz, in_model_z.xyz, normal, 0.0);
    v_uv = in_uv;
#ifdef MATERIALS
    v_other_uvs = in_other_uvs;
    v_tint = in_tint;
#endif
    v_color = u_has_colors ? in_color : in_actor_color;
    v_scalar = 0.0;
    v_opacity = 1.0;
    v_instance = gl_InstanceID;
    gl_Position = u_projection * vec4(v_position, 1.0);
}
