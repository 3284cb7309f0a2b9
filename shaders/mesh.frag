#version 330
// Two-sided shading of a surface in camera space, with linear colours. The result of a chunk is
// displayed unchanged: lit chunks apply the tone curve, chunks that show data do not.

#pragma include tone
#ifdef SHADOWS
#pragma include shadow
#endif
#pragma include lights
#pragma include surface

in vec3 v_position;
in vec3 v_normal;
in float v_scalar;
flat in float v_opacity;

uniform bool u_flat;            // one normal per triangle
uniform bool u_orthographic;
uniform float u_opacity;

#ifdef HULL
uniform vec3 u_outline_color;   // linear
uniform float u_outline_mix;    // 0 to 1: degree to which the surface's colour multiplies it
#endif

out vec4 f_color;               // sRGB, premultiplied by alpha

#pragma chunk

void main() {
    vec3 to_eye = u_orthographic ? vec3(0.0, 0.0, 1.0) : normalize(-v_position);
    vec3 face = cross(dFdx(v_position), dFdy(v_position));
    // Orient the face normal towards the eye instead of trusting the winding: some files are
    // clockwise.
    face *= dot(face, to_eye) < 0.0 ? -1.0 : 1.0;
    face = dot(face, face) > 0.0 ? normalize(face) : to_eye;
    vec3 normal = u_flat || dot(v_normal, v_normal) == 0.0 ? face : normalize(v_normal);
    // Flip normals that face away. The threshold is well beyond 90 degrees: at exactly 90 degrees
    // rounding would flip pixels at random.
    float side = dot(normal, face) < -0.1 ? -1.0 : 1.0;
#ifdef HULL
    side = 1.0;                 // back faces of a hull are lit like the surface at its edge
#endif
    normal *= side;
    float opacity = u_opacity * v_opacity;
#ifdef MATERIALS
    normal = mapped_normal(v_position, normal, side);
    opacity *= surface_alpha();
#endif
    vec3 color = shade(v_position, normal, to_eye);
#ifdef HULL
    color = u_outline_color * mix(vec3(1.0), color, u_outline_mix);
#endif
    f_color = vec4(encode(color) * opacity, opacity);
}
