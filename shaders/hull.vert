#version 330
// Moves a mesh that skin.vert has already skinned outwards along its normals, for outlines, and
// transforms it to camera and clip space.

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
uniform float u_hull_width;    // camera space, or a fraction of the image height
uniform bool u_hull_on_screen; // whether u_hull_width is a fraction of the image height
uniform bool u_has_width_map;
uniform sampler2D u_width_map; // factor of the width, in the green channel
uniform mat3 u_width_place;    // transform of the texture coordinates to the map's
uniform int u_width_set;       // 0: in_uv, 1 and 2: in_other_uvs

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
    v_normal = u_normal_matrix * in_normal;
    float width = u_hull_width;
    if (u_has_width_map) {
        vec2 uv = in_uv;
#ifdef MATERIALS
        if (u_width_set > 0)
            uv = u_width_set == 1 ? in_other_uvs.xy : in_other_uvs.zw;
#endif
        width *= textureLod(u_width_map, (u_width_place * vec3(uv, 1.0)).xy, 0.0).g;
    }
    if (u_hull_on_screen)
        width *= 2.0 * (u_projection * position).w / u_projection[1][1];
    if (dot(v_normal, v_normal) > 0.0)
        position.xyz += width * normalize(v_normal);
    v_position = position.xyz;
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
