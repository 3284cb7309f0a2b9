#version 330
// Transforms vertices that skin.vert has already skinned to camera and clip space: those of one
// actor, or with INSTANCED those of many, of which each is an instance.

#ifdef INSTANCED
#pragma include normals

layout(std430, binding = 1) readonly buffer Posed { float posed[]; };  // position and normal
uniform int u_n_vertices;      // per actor

in vec3 in_model_x;            // per instance: rows of the linear part of the matrix from figure
in vec3 in_model_y;            // to scene space
in vec3 in_model_z;
in vec3 in_place;              // per instance: posed centre in scene space, as the sum of two
in vec3 in_place_rest;         // floats, since differences of large coordinates must be exact
in vec3 in_actor_color;        // per instance: linear
in float in_actor_opacity;     // per instance
uniform vec3 u_eye;            // point of scene space at the camera's origin, as the sum of two
uniform vec3 u_eye_rest;       // floats
uniform mat3 u_view;           // linear part of the matrix from scene to camera space
#else
in vec3 in_position;           // figure units, minus the posed centre
in vec3 in_normal;             // unit length
in float in_scalar;            // value of the scalar quantity
uniform mat4 u_model_view;     // to camera space
uniform mat3 u_normal_matrix;  // inverse transpose of the model-view matrix
uniform vec3 u_color;          // linear
#endif

in vec2 in_uv;                 // v = 0 at the bottom row of the texture
in vec3 in_color;              // linear

uniform mat4 u_projection;
uniform bool u_has_colors;     // use in_color instead of the actor's colour

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
#ifdef INSTANCED
    int at = 6 * (gl_InstanceID * u_n_vertices + gl_VertexID);
    vec3 position = vec3(posed[at], posed[at + 1], posed[at + 2]);
    vec3 normal = vec3(posed[at + 3], posed[at + 4], posed[at + 5]);
    precise vec3 place = (in_place - u_eye) + (in_place_rest - u_eye_rest);
    mat3 rows = mat3(in_model_x, in_model_y, in_model_z);
    v_position = u_view * (position * rows + place);
    mat3 model_view = transpose(u_view * transpose(rows));
    v_normal = inverse_transposed(model_view[0], model_view[1], model_view[2], normal, 0.0);
    v_scalar = 0.0;
    vec3 color = in_actor_color;
    v_opacity = in_actor_opacity;
#else
    v_position = (u_model_view * vec4(in_position, 1.0)).xyz;
    v_normal = u_normal_matrix * in_normal;
    v_scalar = in_scalar;
    vec3 color = u_color;
    v_opacity = 1.0;
#endif
    v_uv = in_uv;
#ifdef MATERIALS
    v_other_uvs = in_other_uvs;
    v_tint = in_tint;
#endif
    v_color = u_has_colors ? in_color : color;
    v_instance = gl_InstanceID;
    gl_Position = u_projection * vec4(v_position, 1.0);
}
