#version 330
// One segment per instance: a strip of four vertices of constant screen width. A segment of
// length 0 is a dot.

in vec3 in_start;       // scene space minus centre
in vec3 in_end;
in vec4 in_color;       // sRGB and opacity
in float in_width;      // pixels

uniform mat4 u_model_view;
uniform mat4 u_projection;
uniform vec2 u_size;        // size of the image, pixels
uniform float u_border;     // width of the border, pixels
uniform float u_lift;       // fraction of the eye distance by which the segment is moved forward
uniform float u_height;     // distance moved forward in parallel projections, scene units
uniform bool u_orthographic;

out vec4 v_color;
noperspective out vec2 v_place;     // pixels along and across the segment
flat out float v_length;            // pixels
flat out float v_radius;            // pixels

// Moves a point towards the eye without changing its pixel, so that it is not hidden by the surface
// on which it lies.
vec4 lifted(vec3 place) {
    vec3 seen = (u_model_view * vec4(place, 1.0)).xyz;
    seen = u_orthographic ? seen + vec3(0.0, 0.0, u_height) : seen * (1.0 - u_lift);
    return u_projection * vec4(seen, 1.0);
}

// Clips end a of the segment from a to b at the near plane.
vec4 clip_near(vec4 a, vec4 b) {
    float distance_a = a.z + a.w, distance_b = b.z + b.w;
    return distance_a < 0.0 && distance_b > 0.0
        ? mix(a, b, distance_a / (distance_a - distance_b)) : a;
}

void main() {
    vec4 first = lifted(in_start), second = lifted(in_end);
    vec4 start = clip_near(first, second), end = clip_near(second, first);
    vec2 way = 0.5 * (end.xy / end.w - start.xy / start.w) * u_size;
    v_length = length(way);
    way = v_length > 0.0 ? way / v_length : vec2(1.0, 0.0);
    v_radius = 0.5 * in_width;
    bool at_end = gl_VertexID >= 2;
    // Extend all sides by half a pixel, for antialiased edges.
    float reach = v_radius + u_border + 0.5;
    float along = at_end ? reach : -reach, side = gl_VertexID % 2 == 0 ? -reach : reach;
    vec4 place = at_end ? end : start;
    place.xy += 2.0 / u_size * (along * way + side * vec2(-way.y, way.x)) * place.w;
    gl_Position = place;
    v_place = vec2(along + (at_end ? v_length : 0.0), side);
    v_color = in_color;
}
