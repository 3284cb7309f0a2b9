// Linear blend skinning: v' = B [v 1] and n' = B [n 0] with B = sum w M, or n' = B^-T n if a joint of
// the vertex scales or shears.
void skin(inout vec3 position, inout vec3 normal) {
    vec4 x = vec4(0.0), y = vec4(0.0), z = vec4(0.0);
#ifdef AFFINE_PALETTE
    float lowest = 1e38, highest = 0.0;
#endif
    uint end = in_bindings.x + in_bindings.y;
    for (uint index = in_bindings.x; index < end; ++index) {
        vec2 pair = influence(index);
        int joint = int(pair.x);
        vec4 row_x = palette_row(joint, 0), row_y = palette_row(joint, 1);
        vec4 row_z = palette_row(joint, 2);
        x += pair.y * row_x;
        y += pair.y * row_y;
        z += pair.y * row_z;
#ifdef AFFINE_PALETTE
        if (pair.y != 0.0) {
            float size = rigid_size(row_x.xyz, row_y.xyz, row_z.xyz);
            lowest = min(lowest, size);
            highest = max(highest, size);
        }
#endif
    }
    vec4 point = vec4(position, 1.0);
    // Each matrix has the posed centre subtracted, so the blend subtracts it sum(w) times; add back
    // the excess.
    position = vec3(dot(x, point), dot(y, point), dot(z, point)) + excess() * center;
#ifdef AFFINE_PALETTE
    is_rigid = lowest > 0.0 && highest - lowest <= RIGID * highest;
    linear = transpose(mat3(x.xyz, y.xyz, z.xyz));
#endif
    normal = blended_normal(x.xyz, y.xyz, z.xyz, normal);
}
