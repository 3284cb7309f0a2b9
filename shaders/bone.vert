#version 330
// Transforms parts of a skeleton: instances of a shape between a joint and its child, or at a
// joint.

in vec3 in_corner;      // x and z across in half widths, y from the joint (0) to the end (1)
in vec3 in_normal;      // in the frame of in_corner; 0 for one normal per triangle
in float in_tint;       // 0: the joint's colour, 1: the colour of axis in_link.z
in ivec3 in_link;       // joint; child, -1 for an end, -2 for a ball; axis that marks the roll
in vec4 in_end;         // for an end: direction in joint space, length in figure units
in vec3 in_width;       // half width: fraction of the length; minimum and maximum, figure units
in vec3 in_color;       // linear

uniform mat4 u_model_view;     // figure space, minus the skeleton's centre, to camera space
uniform mat3 u_normal_matrix;
uniform mat4 u_projection;
uniform sampler2D u_world;     // joint matrices to figure space minus centre, three rows each
uniform int u_selected;        // joint to draw in u_highlight; -1 for none
uniform int u_only;            // joint to draw alone; -1 for all
uniform float u_height;         // height of the image, pixels
uniform vec3 u_highlight;      // linear
uniform bool u_has_color;      // use u_color instead of in_color
uniform vec3 u_color;          // linear

out vec3 v_position;    // camera space
out vec3 v_normal;      // camera space, any length
out vec2 v_uv;
out vec3 v_color;
out float v_scalar;
flat out float v_opacity;
flat out int v_instance;    // joint

const float THINNEST = 0.7;     // smallest half width, in pixels
const float STUBBIEST = 0.35;   // largest half width, relative to the length
const vec3 AXES[3] = vec3[](
    vec3(0.80, 0.09, 0.08), vec3(0.15, 0.62, 0.11), vec3(0.10, 0.30, 0.95));

vec4 world_row(int joint, int row) {
    // upload.py's rows hold 256 matrices.
    return texelFetch(u_world, ivec2(3 * (joint & 255) + row, joint >> 8), 0);
}

mat3x4 world(int joint) {
    return mat3x4(world_row(joint, 0), world_row(joint, 1), world_row(joint, 2));
}

vec3 place(mat3x4 rows) {
    return vec3(rows[0].w, rows[1].w, rows[2].w);
}

vec3 axis(mat3x4 rows, int index) {
    return vec3(rows[0][index], rows[1][index], rows[2][index]);
}

vec3 unit_or(vec3 v, vec3 otherwise) {
    float size = length(v);
    return size > 1e-12 ? v / size : otherwise;
}

// Unit vector perpendicular to a unit direction: the perpendicular part of an axis of the joint, or
// an arbitrary one if that axis is parallel to the direction.
vec3 across(vec3 way, vec3 wanted) {
    vec3 side = unit_or(wanted, vec3(0.0));
    side -= way * dot(way, side);
    vec3 spare = cross(way, abs(way.x) < 0.7 ? vec3(1.0, 0.0, 0.0) : vec3(0.0, 1.0, 0.0));
    return dot(side, side) > 1e-6 ? normalize(side) : normalize(spare);
}

// Size of a pixel at a point, figure units.
float pixel(vec3 point) {
    float w = (u_projection * (u_model_view * vec4(point, 1.0))).w;
    return 2.0 * max(w, 0.0) / (u_projection[1][1] * u_height * length(u_model_view[0].xyz));
}

void main() {
    mat3x4 joint = world(in_link.x);
    vec3 head = place(joint), way = vec3(0.0, 1.0, 0.0);
    float size = in_end.w, half_width = in_width.z;
    if (in_link.y >= 0) {
        vec3 span = place(world(in_link.y)) - head;
        size = length(span);
        way = unit_or(span, way);
    } else if (in_link.y == -1) {
        vec3 end = in_end.x * unit_or(axis(joint, 0), vec3(0.0))
            + in_end.y * unit_or(axis(joint, 1), vec3(0.0))
            + in_end.z * unit_or(axis(joint, 2), vec3(0.0));
        way = unit_or(end, way);
    }
    float thinnest = THINNEST * pixel(head);
    if (in_link.y == -2) {
        half_width = size = max(half_width, 1.5 * thinnest);
    } else {
        half_width = max(clamp(in_width.x * size, in_width.y, in_width.z), thinnest);
        half_width = min(half_width, STUBBIEST * size);
    }
    vec3 side = across(way, axis(joint, in_link.z));
    mat3 frame = mat3(side, way, cross(side, way));
    vec3 corner = in_corner * vec3(half_width, size, half_width);
    corner *= u_only < 0 || u_only == in_link.x ? 1.0 : 0.0;
    vec4 position = u_model_view * vec4(head + frame * corner, 1.0);
    v_position = position.xyz;
    v_normal = u_normal_matrix * (frame * in_normal);
    v_uv = vec2(0.0);
    v_scalar = 0.0;
    v_color = u_has_color ? u_color : in_color;
    v_color = in_link.x == u_selected ? u_highlight : v_color;
    v_color = mix(v_color, AXES[in_link.z], in_tint);
    v_opacity = 1.0;
    v_instance = in_link.x;
    gl_Position = u_projection * position;
}
