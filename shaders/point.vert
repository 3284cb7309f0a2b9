#version 330
// One capsule per instance: two hemispheres, one at each end. A keypoint is a capsule whose ends
// coincide; a limb connects two keypoints.

in vec4 in_corner;      // xyz: on the unit sphere; w: 0 at the start, 1 at the end
in vec3 in_start;       // per instance: figure space minus centre
in vec3 in_end;
in float in_radius;     // per instance, figure units
in vec4 in_color;       // per instance: linear colour and opacity

uniform mat4 u_model_view;     // figure space, minus centre, to camera space
uniform mat3 u_normal_matrix;
uniform mat4 u_projection;

out vec3 v_position;    // camera space
out vec3 v_normal;      // camera space, any length
out vec2 v_uv;
out vec3 v_color;
out float v_scalar;
flat out float v_opacity;
flat out int v_instance;

void main() {
    vec3 along = in_end - in_start;
    float size = length(along);
    vec3 z = size > 0.0 ? along / size : vec3(0.0, 0.0, 1.0);
    vec3 x = normalize(cross(abs(z.x) < 0.5 ? vec3(1.0, 0.0, 0.0) : vec3(0.0, 1.0, 0.0), z));
    vec3 normal = mat3(x, cross(z, x), z) * in_corner.xyz;
    vec3 point = mix(in_start, in_end, in_corner.w) + in_radius * normal;
    vec4 position = u_model_view * vec4(point, 1.0);
    v_position = position.xyz;
    v_normal = u_normal_matrix * normal;
    v_uv = vec2(0.0);
    v_scalar = 0.0;
    v_color = in_color.rgb;
    v_opacity = in_color.a;
    v_instance = gl_InstanceID;
    gl_Position = u_projection * position;
}
