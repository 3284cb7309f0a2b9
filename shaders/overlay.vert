#version 330
// A rectangle of the image, drawn at its size in pixels.

uniform vec2 u_place;       // lower left corner, pixels
uniform vec2 u_extent;      // width and height, pixels
uniform vec2 u_picture;     // size of the image, pixels

out vec2 v_pixel;           // pixels from the lower left corner

void main() {
    v_pixel = u_extent * vec2(gl_VertexID & 1, gl_VertexID >> 1);
    gl_Position = vec4(2.0 * (u_place + v_pixel) / u_picture - 1.0, 0.0, 1.0);
}
