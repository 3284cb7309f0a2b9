#version 330
// Transforms one box per joint, an instance of a cube from 0 to 1.

#pragma include normals

in vec3 in_corner;      // corner of the cube
in vec3 in_normal;      // normal of the cube's face
in vec3 in_low;         // per joint: lowest corner of the box, joint space
in vec3 in_high;        // per joint: highest corner
in vec3 in_color;       // per joint, linear

uniform mat4 u_model_view;     // figure space, minus the skeleton's centre, to camera space
uniform mat3 u_normal_matrix;
uniform mat4 u_projection;
uniform sampler2D u_world;     // joint matrices to figure space minus centre, three rows each
uniform int u_selected;        // joint to draw in u_highlight; -1 for none
uniform int u_only;            // joint to draw alone; -1 for all
uniform vec3 u_highlight;      // linear
uniform bool u_has_color;      // use u_color instead of in_color
uniform vec3 u_color;          // linear

out vec3 v_position;    // camera space
out vec3 v_normal;      // camera space, any length
out vec2 v_uv;
out vec3 v_color;
out float v_scalar;
flat out float v_opacity;
flat out int v_instance;

vec4 world_row(int row) {
    // The texture rows of upload.py hold 256 matrices.
    return texelFetch(u_world, ivec2(3 * (gl_InstanceID & 255) + row, gl_InstanceID >> 8), 0);
}

void main() {
    vec4 corner = vec4(mix(in_low, in_high, in_corner), 1.0);
    corner *= u_only < 0 || u_only == gl_InstanceID ? 1.0 : 0.0;
    vec4 x = world_row(0), y = world_row(1), z = world_row(2);
    vec3 normal = inverse_transposed(x.xyz, y.xyz, z.xyz, in_normal, 0.0);
    vec4 position = u_model_view * vec4(dot(x, corner), dot(y, corner), dot(z, corner), 1.0);
    v_position = position.xyz;
    v_normal = u_normal_matrix * normal;
    v_uv = vec2(0.0);
    v_scalar = 0.0;
    v_color = u_has_color ? u_color : in_color;
    v_color = gl_InstanceID == u_selected ? u_highlight : v_color;
    v_opacity = 1.0;
    v_instance = gl_InstanceID;
    gl_Position = u_projection * position;
}
