#version 330
// A strip of four vertices for each image tile that contains the edge of a mask or is next to it.

uniform sampler2D u_mask;       // coverage, 0 to 1, with mipmaps
uniform int u_level;            // mipmap level to sample
uniform int u_reach;            // pixels around the tile to consider

const int SIDE = 16;            // width and height of a tile, pixels

void main() {
    ivec2 size = textureSize(u_mask, 0), coarse = textureSize(u_mask, u_level);
    int columns = (size.x + SIDE - 1) / SIDE;
    ivec2 low = SIDE * ivec2(gl_InstanceID % columns, gl_InstanceID / columns);
    ivec2 high = min(low + SIDE, size);
    vec2 scale = vec2(coarse) / vec2(size);
    ivec2 first = clamp(ivec2(floor(vec2(low - u_reach) * scale)), ivec2(0), coarse - 1);
    ivec2 last = clamp(ivec2(floor(vec2(high + u_reach) * scale)), ivec2(0), coarse - 1);
    vec2 least = vec2(1.0), most = vec2(0.0);
    for (int y = first.y; y <= last.y; ++y) {
        for (int x = first.x; x <= last.x; ++x) {
            vec2 cover = texelFetch(u_mask, ivec2(x, y), u_level).rg;
            least = min(least, cover);
            most = max(most, cover);
        }
    }
    bool has_edge = any(bvec2(most.x > 0.0 && least.x < 1.0, most.y > 0.0 && least.y < 1.0));
    vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1);
    vec2 place = 2.0 * mix(vec2(low), vec2(high), corner) / vec2(size) - 1.0;
    gl_Position = has_edge ? vec4(place, 0.0, 1.0) : vec4(2.0, 2.0, 2.0, 1.0);
}
