#pragma needs lbs dqs
// Between linear blend and dual quaternion skinning: (1 - share) LBS + share DQS.
uniform float u_share;          // of DQS, 0 to 1

void skin(inout vec3 position, inout vec3 normal) {
    vec3 dual_position = position, dual_normal = normal;
    skin_lbs(position, normal);
    skin_dqs(dual_position, dual_normal);
    position = mix(position, dual_position, u_share);
    normal = mix(unit(normal), unit(dual_normal), u_share);
}
