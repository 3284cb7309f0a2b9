#version 330
// One rectangle of a texture per instance, drawn at its size in pixels.

in vec2 in_corner;          // per instance: top left corner in the image, pixels
in vec2 in_source;          // top left corner in the texture, texels
in vec2 in_extent;          // width and height, pixels
in vec3 in_color;           // sRGB colour of the letters

uniform vec2 u_picture;     // size of the image, pixels

out vec2 v_pixel;           // texel coordinates
flat out vec3 v_color;

void main() {
    vec2 corner = in_extent * vec2(gl_VertexID & 1, gl_VertexID >> 1);
    v_pixel = in_source + corner;
    v_color = in_color;
    vec2 place = 2.0 * (in_corner + corner) / u_picture - 1.0;
    gl_Position = vec4(place.x, -place.y, 0.0, 1.0);
}
