#version 330
// A rectangle that shows part of a calibrated camera's image plane.

uniform vec4 u_corner;      // upper left corner, clip space
uniform vec4 u_right;       // vector from that corner to the upper right one
uniform vec4 u_down;        // vector from that corner to the lower left one
uniform vec4 u_pixels;      // ideal pixels at the upper left and the lower right corner

out vec2 v_pixel;           // undistorted pixel; 0, 0 is the centre of the first pixel

void main() {
    vec2 place = vec2(gl_VertexID & 1, gl_VertexID >> 1);
    v_pixel = mix(u_pixels.xy, u_pixels.zw, place);
    gl_Position = u_corner + place.x * u_right + place.y * u_down;
}
