#version 330
// Hands a triangle's three numbers on to its pixels, and how near each pixel is to each corner.
// What the vertex shader calls v_name arrives here as v_vertex_name: see program.py.

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
flat out vec3 v_corners;    // the numbers at the triangle's corners
out vec3 v_shares;          // barycentric coordinates

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
        v_shares = vec3(corner == 0, corner == 1, corner == 2);
        gl_Position = gl_in[corner].gl_Position;
        EmitVertex();
    }
    EndPrimitive();
}
