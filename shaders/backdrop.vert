#version 330
// One triangle that covers the image, with the viewing ray through each point.

uniform vec2 u_ray_scale;   // half extent of the image at depth 1
uniform vec2 u_ray_shift;   // ray through the centre of the image, at depth 1

out vec3 v_ray;             // camera space, any length

void main() {
    vec2 corner = vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0);
    v_ray = vec3(u_ray_scale * corner + u_ray_shift, -1.0);
    gl_Position = vec4(corner, 0.0, 1.0);
}
