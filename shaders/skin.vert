#version 330
// Skins a vertex of each actor once per changed pose; transform feedback captures the outputs.
// Positions are in figure units; inputs are relative to the rest centre and results to the posed
// centre, so that float32 keeps its precision far from the origin.

#pragma include normals

in vec3 in_position;     // bind space, minus the rest centre
in vec3 in_normal;       // bind space, any length
in uvec3 in_bindings;    // first pair, number of pairs, and the bits of a float: the sum of the
                         // weights minus 1

uniform bool u_attached;        // false: leave the vertex in its bind pose
uniform int u_first;            // row of the first instance in the tables below
uniform sampler2D u_places;     // posed centre in figure space, and rest centre minus posed centre
uniform sampler2D u_palette;    // skinning matrices, three rows each, for each instance in turn
uniform sampler2D u_pairs;      // joint and weight, strongest first for each vertex
uniform int u_n_joints;         // number of matrices per instance

#ifdef REST_ROWS  // every instance has its own rest positions, with its pose correctives
layout(std430, binding = 0) readonly buffer Rests { float rests[]; };
uniform int u_n_vertices;
#endif

out vec3 v_position;     // figure space, minus the posed centre
out vec3 v_normal;       // figure space, unit length

// Properties of the instance, set by main before it calls any function.
int instance;        // row of the tables
vec3 rest_shift;     // rest centre minus posed centre
vec3 center;         // posed centre, figure space
#ifdef AFFINE_PALETTE  // at least one joint of an instance scales or shears
bool is_rigid;       // true if no joint of this vertex scales or shears, set by LBS
mat3 linear;         // linear part of the blended transform, set by skin()
#endif

// Sum of the vertex's weights, minus 1.
float excess() {
    return uintBitsToFloat(in_bindings.z);
}

// The texture rows of upload.py hold 1024 pairs or 256 matrices: powers of two, so that shifts and
// masks replace integer division, which has no SIMD instruction on CPUs.

// Joint index and weight of one pair.
vec2 influence(uint index) {
    return texelFetch(u_pairs, ivec2(index & 1023u, index >> 10), 0).rg;
}

// One row of a joint's skinning matrix.
vec4 palette_row(int joint, int row) {
    int index = instance * u_n_joints + joint;
    return texelFetch(u_palette, ivec2(3 * (index & 255) + row, index >> 8), 0);
}

#ifdef AFFINE_PALETTE
const float RIGID = 1e-5;  // relative tolerance of A^T A = s^2 I, as in viewer/rigs/kinematics.py

// Square of a joint's scale if it is uniform, and 0 for all others; rows of its matrix.
float rigid_size(vec3 x, vec3 y, vec3 z) {
    mat3 matrix = mat3(x, y, z);  // transposed, so the gram matrix is matrix * transpose(matrix)
    mat3 gram = matrix * transpose(matrix);
    float size = gram[0][0];
    vec3 sides = abs(vec3(gram[0][1], gram[0][2], gram[1][2]));
    vec2 others = abs(vec2(gram[1][1], gram[2][2]) - size);
    float error = max(max(max(sides.x, sides.y), sides.z), max(others.x, others.y));
    return error <= RIGID * size && dot(x, cross(y, z)) > 0.0 ? size : 0.0;
}
#endif

vec3 unit(vec3 v) {
    float size = length(v);
    return size > 0.0 ? v / size : v;
}

// Transforms a normal by a blended matrix with rows x, y, z; the result has any length.
vec3 blended_normal(vec3 x, vec3 y, vec3 z, vec3 normal) {
#ifdef AFFINE_PALETTE
    if (!is_rigid) {
        // Only the direction matters, so the matrix is scaled to entries of at most 1: this
        // avoids overflow and bounds the rounding error of the determinant by 1e-5.
        vec3 sizes = max(max(abs(x), abs(y)), abs(z));
        float size = max(max(sizes.x, sizes.y), sizes.z);
        size = size > 0.0 ? size : 1.0;
        return inverse_transposed(x / size, y / size, z / size, normal, 1e-5);
    }
#endif
    return vec3(dot(x, normal), dot(y, normal), dot(z, normal));
}

// A row of texels of upload.py's matrix textures.
vec3 place(int row) {
    return texelFetch(u_places, ivec2(3 * (instance & 255) + row, instance >> 8), 0).xyz;
}

#pragma chunk

void main() {
    instance = u_first + gl_InstanceID;
    center = place(0);
    rest_shift = place(1);
#ifdef REST_ROWS
    int at = 3 * (instance * u_n_vertices + gl_VertexID);
    vec3 position = vec3(rests[at], rests[at + 1], rests[at + 2]);
#else
    vec3 position = in_position;
#endif
    vec3 normal = in_normal;
#ifdef AFFINE_PALETTE
    is_rigid = false;
#endif
    if (u_attached && in_bindings.y > 0u) {
        skin(position, normal);
    } else {
        position += rest_shift;
    }
    v_position = position;
    v_normal = unit(normal);
}
