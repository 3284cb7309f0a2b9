// Dual quaternion skinning (Kavan et al. 2008): a linear stretch, then a rigid motion.
uniform sampler2D u_rigid;      // five texels per joint: real part, dual part, three stretch rows;
                                // for each instance in turn

// One texel of a joint in u_rigid; the texture rows of upload.py hold 128 joints.
vec4 rigid_texel(int joint, int texel) {
    int index = instance * u_n_joints + joint;
    return texelFetch(u_rigid, ivec2(5 * (index & 127) + texel, index >> 7), 0);
}

vec3 rotate(vec4 q, vec3 v) {
    return v + 2.0 * cross(q.xyz, cross(q.xyz, v) + q.w * v);
}

void skin(inout vec3 position, inout vec3 normal) {
    vec4 real = vec4(0.0), dual = vec4(0.0), first = vec4(0.0);
    vec4 x = vec4(0.0), y = vec4(0.0), z = vec4(0.0);
    uint end = in_bindings.x + in_bindings.y;
    float sum = 0.0;  // divisor of the blended stretch
    for (uint index = in_bindings.x; index < end; ++index) {
        vec2 pair = influence(index);
        int joint = int(pair.x);
        float weight = pair.y;
        sum += weight;
        vec4 q = rigid_texel(joint, 0);
        // q and -q are the same rotation: flip q to the hemisphere of the strongest influence,
        // which comes first.
        first = index == in_bindings.x ? q : first;
        float signed_weight = dot(q, first) < 0.0 ? -weight : weight;
        real += signed_weight * q;
        dual += signed_weight * rigid_texel(joint, 1);
        x += weight * rigid_texel(joint, 2);
        y += weight * rigid_texel(joint, 3);
        z += weight * rigid_texel(joint, 4);
    }
    float size = length(real);
    if (abs(1.0 + excess()) < 1e-12 || size < 1e-12 * abs(sum)) {
        position += rest_shift;  // influences that cancel out define no rotation
#ifdef AFFINE_PALETTE
        linear = mat3(1.0);
#endif
        return;
    }
    // A negative sum would only negate the blended quaternion, which is the same rotation.
    real /= size;
    dual /= size;
    x /= sum;
    y /= sum;
    z /= sum;
    vec4 point = vec4(position, 1.0);
    vec3 stretched = vec3(dot(x, point), dot(y, point), dot(z, point));
    vec3 shift = 2.0 * (real.w * dual.xyz - dual.w * real.xyz + cross(real.xyz, dual.xyz));
    position = rotate(real, stretched) + shift;
#ifdef AFFINE_PALETTE
    vec3 first_column = rotate(real, vec3(x.x, y.x, z.x));
    vec3 second_column = rotate(real, vec3(x.y, y.y, z.y));
    vec3 third_column = rotate(real, vec3(x.z, y.z, z.z));
    linear = mat3(first_column, second_column, third_column);
#endif
    normal = rotate(real, blended_normal(x.xyz, y.xyz, z.xyz, normal));
}
