#version 330
// Passes the scalars of a triangle's three corners and barycentric coordinates to its fragments.
// program.py renames the vertex shader's output v_name to v_vertex_name.

layout(triangles) in;
layout(triangle_strip, max_vertices = 3) out;

in vec3 v_vertex_position[];
in vec3 v_vertex_normal[];
in vec2 v_vertex_uv[];
in vec3 v_vertex_color[];
in float v_vertex_scalar[];
flat in float v_vertex_opacity[];
flat in int v_vertex_instance[];

out vec3 v_position;        // camera space
out vec3 v_normal;          // camera space, any length
out vec2 v_uv;
out vec3 v_color;
out float v_scalar;
flat out float v_opacity;
flat out int v_instance;
flat out vec3 v_corners;    // scalars at the triangle's corners
out vec3 v_barycentric;     // barycentric coordinates

void main() {
    for (int corner = 0; corner < 3; corner++) {
        v_position = v_vertex_position[corner];
        v_normal = v_vertex_normal[corner];
        v_uv = v_vertex_uv[corner];
        v_color = v_vertex_color[corner];
        v_scalar = v_vertex_scalar[corner];
        v_opacity = v_vertex_opacity[corner];
        v_instance = v_vertex_instance[corner];
        v_corners = vec3(v_vertex_scalar[0], v_vertex_scalar[1], v_vertex_scalar[2]);
        v_barycentric = vec3(corner == 0, corner == 1, corner == 2);
        gl_Position = gl_in[corner].gl_Position;
        EmitVertex();
    }
    EndPrimitive();
}
