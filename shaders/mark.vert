#version 330
// One mark per instance: a strip of four vertices around a point, or around a line between two.

in vec3 in_start;       // scene space minus centre
in vec3 in_end;         // the same as the start for a point
in float in_radius;     // pixels

uniform mat4 u_model_view;
uniform mat4 u_projection;
uniform vec2 u_size;        // of the picture, pixels
uniform float u_border;     // pixels around it
uniform float u_lift;       // share of the way to the eye by which a mark lies before its place
uniform float u_height;     // the same for parallel projections: scene units
uniform bool u_orthographic;

flat out vec2 v_start;      // pixels
flat out vec2 v_end;
flat out float v_radius;

// What lies on a surface is drawn a little before it, at the same place of the picture.
vec4 lifted(vec3 place) {
    vec3 seen = (u_model_view * vec4(place, 1.0)).xyz;
    seen = u_orthographic ? seen + vec3(0.0, 0.0, u_height) : seen * (1.0 - u_lift);
    return u_projection * vec4(seen, 1.0);
}

// Where the line from a to b, with a behind the near plane, crosses it.
vec4 cut(vec4 a, vec4 b) {
    float distance_a = a.z + a.w, distance_b = b.z + b.w;
    return distance_a < 0.0 && distance_b > 0.0
        ? mix(a, b, distance_a / (distance_a - distance_b)) : a;
}

void main() {
    vec4 first = lifted(in_start), second = lifted(in_end);
    vec4 start = cut(first, second), end = cut(second, first);
    v_radius = in_radius;
    if (start.w <= 0.0 || end.w <= 0.0) {  // all of it lies behind the eye
        v_start = v_end = vec2(0.0);
        gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
        return;
    }
    v_start = (0.5 * start.xy / start.w + 0.5) * u_size;
    v_end = (0.5 * end.xy / end.w + 0.5) * u_size;
    vec2 way = v_end - v_start;
    way = dot(way, way) > 0.0 ? normalize(way) : vec2(1.0, 0.0);
    bool at_end = gl_VertexID >= 2;
    float side = gl_VertexID % 2 == 0 ? -1.0 : 1.0;
    vec2 corner = (at_end ? way : -way) + side * vec2(-way.y, way.x);
    vec4 place = at_end ? end : start;
    // A picture is 2 wide in this space.
    place.xy += 2.0 * (in_radius + u_border + 1.0) * corner / u_size * place.w;
    gl_Position = place;
}
