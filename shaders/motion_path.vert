#version 330
// One segment of a motion path per instance: a strip of four vertices of constant screen width.

in vec3 in_start;       // figure space minus centre
in vec3 in_end;
in vec2 in_times;       // scene times of both ends, seconds
in vec3 in_color;       // sRGB

uniform mat4 u_model_view;
uniform mat4 u_projection;
uniform vec2 u_size;    // size of the image, pixels
uniform float u_width;  // width of the line, pixels

out vec3 v_color;       // sRGB
out float v_time;

// Clips end a of the segment from a to b at the near plane.
vec4 clip_near(vec4 a, vec4 b) {
    float distance_a = a.z + a.w, distance_b = b.z + b.w;
    return distance_a < 0.0 && distance_b > 0.0
        ? mix(a, b, distance_a / (distance_a - distance_b)) : a;
}

void main() {
    mat4 matrix = u_projection * u_model_view;
    vec4 first = matrix * vec4(in_start, 1.0), second = matrix * vec4(in_end, 1.0);
    vec4 start = clip_near(first, second), end = clip_near(second, first);
    bool at_end = gl_VertexID >= 2;
    vec2 way = (end.xy / end.w - start.xy / start.w) * u_size;
    way = dot(way, way) > 0.0 ? normalize(way) : vec2(1.0, 0.0);
    float side = gl_VertexID % 2 == 0 ? -1.0 : 1.0;
    vec4 place = at_end ? end : start;
    // Offset by half a width to each side; the image is 2 units wide in normalized device
    // coordinates.
    place.xy += u_width / u_size * side * vec2(-way.y, way.x) * place.w;
    gl_Position = place;
    v_time = at_end ? in_times.y : in_times.x;
    v_color = in_color;
}
