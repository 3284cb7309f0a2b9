#version 330
// Transforms a mesh that skin.vert has already skinned to camera and clip space.

in vec3 in_position;    // figure units, minus the posed centre
in vec3 in_normal;      // unit length
in vec2 in_uv;          // v = 0 at the bottom row of the texture
in vec3 in_color;       // linear
in float in_scalar;     // value of the scalar quantity

uniform mat4 u_model_view;     // to camera space
uniform mat3 u_normal_matrix;  // inverse transpose of the model-view matrix
uniform mat4 u_projection;
uniform bool u_has_colors;     // use in_color instead of u_color
uniform vec3 u_color;          // linear

out vec3 v_position;    // camera space
out vec3 v_normal;      // camera space, any length
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

void main() {
    vec4 position = u_model_view * vec4(in_position, 1.0);
    v_position = position.xyz;
    v_normal = u_normal_matrix * in_normal;
    v_uv = in_uv;
#ifdef MATERIALS
    v_other_uvs = in_other_uvs;
    v_tint = in_tint;
#endif
    v_color = u_has_colors ? in_color : u_color;
    v_scalar = in_scalar;
    v_opacity = 1.0;
    v_instance = gl_InstanceID;
    gl_Position = u_projection * position;
}
