// Linear blend skinning: v' = B [v 1] and n' = B [n 0] with B = sum w M, or n' = B^-T n if joints
// scale or shear.
void skin(inout vec3 position, inout vec3 normal) {
    vec4 x = vec4(0.0), y = vec4(0.0), z = vec4(0.0);
    uint end = in_bindings.x + in_bindings.y;
    for (uint index = in_bindings.x; index < end; ++index) {
        vec2 pair = influence(index);
        int joint = int(pair.x);
        x += pair.y * palette_row(joint, 0);
        y += pair.y * palette_row(joint, 1);
        z += pair.y * palette_row(joint, 2);
    }
    vec4 point = vec4(position, 1.0);
    // Each matrix has the posed centre subtracted, so the blend subtracts it sum(w) times; add back
    // the excess.
    position = vec3(dot(x, point), dot(y, point), dot(z, point)) + excess() * center;
#ifdef AFFINE_PALETTE
    linear = transpose(mat3(x.xyz, y.xyz, z.xyz));
#endif
    normal = blended_normal(x.xyz, y.xyz, z.xyz, normal);
}
