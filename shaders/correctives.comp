#version 430
// Adds the pose correctives of several actors to their rest positions: P' = P + sum_i w_i O_i.
// Each invocation sums one coordinate of one vertex for eight actors, so that every offset is read
// once for all of them.

layout(local_size_x = 64) in;

const int ACTORS = 8;

layout(std430, binding = 0) writeonly buffer Rows { float rows[]; };    // actor, column
layout(std430, binding = 1) readonly buffer Rest { float rest[]; };     // column
layout(std430, binding = 2) readonly buffer Sources { int sources[]; }; // vertex of a split vertex
layout(std430, binding = 3) readonly buffer Offsets { float offsets[]; };  // corrective, coordinate
layout(std430, binding = 4) readonly buffer Weights { int weights[]; };
// u_n_active indices of correctives, then the bits of their weights for each actor, padded with
// actors of weight 0.

uniform int u_n_actors;
uniform int u_n_columns;  // coordinates of all split vertices
uniform int u_n_offsets;  // coordinates of all vertices
uniform int u_n_active;

void main() {
    int column = int(gl_GlobalInvocationID.x);
    if (column >= u_n_columns) {
        return;
    }
    int first = ACTORS * int(gl_WorkGroupID.y);
    int coordinate = 3 * sources[column / 3] + column % 3;
    float sums[ACTORS];
    for (int actor = 0; actor < ACTORS; ++actor) {
        sums[actor] = 0.0;
    }
    int row = (1 + first) * u_n_active;
    for (int i = 0; i < u_n_active; ++i) {
        float offset = offsets[weights[i] * u_n_offsets + coordinate];
        for (int actor = 0; actor < ACTORS; ++actor) {
            sums[actor] += intBitsToFloat(weights[row + actor * u_n_active + i]) * offset;
        }
    }
    for (int actor = 0; actor < ACTORS && first + actor < u_n_actors; ++actor) {
        rows[(first + actor) * u_n_columns + column] = rest[column] + sums[actor];
    }
}
