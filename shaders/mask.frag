#version 330
// Coverage of the outlined parts: one channel for each kind of outline.

uniform vec4 u_mask;

out vec4 f_color;

#ifdef MATERIALS
#pragma include surface
#endif

void main() {
#ifdef MATERIALS
    cut_out(FAINTEST);
#endif
    f_color = u_mask;
}
