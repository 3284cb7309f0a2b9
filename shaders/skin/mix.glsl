#pragma needs lbs dqs
// Mixture of linear blend and dual quaternion skinning: (1 - blend factor) LBS + blend factor DQS.
uniform float u_blend_factor;   // weight of DQS, 0 to 1; below 0 for that of each vertex
in float in_dqs_fraction;       // weight of DQS that the file states

void skin(inout vec3 position, inout vec3 normal) {
    float factor = u_blend_factor < 0.0 ? in_dqs_fraction : u_blend_factor;
    vec3 rest_normal = normal, dual_position = position, dual_normal = normal;
    skin_lbs(position, normal);
#ifdef AFFINE_PALETTE
    mat3 mixed = (1.0 - factor) * linear;
#endif
    skin_dqs(dual_position, dual_normal);
    position = mix(position, dual_position, factor);
    normal = mix(unit(normal), unit(dual_normal), factor);
#ifdef AFFINE_PALETTE
    if (!is_rigid) {
        // Use the Jacobian of the blended map: blending the two normals would be wrong here.
        mixed = transpose(mixed + factor * linear);
        normal = blended_normal(mixed[0], mixed[1], mixed[2], rest_normal);
    }
#endif
}
