// Normals under linear maps, for every vertex shader that moves them.

// A normal of any length under a matrix given as rows: the inverse transpose times |determinant|,
// as rows of the cofactor matrix. Its sign keeps outward normals outward where the matrix mirrors,
// that is where the determinant is below -rounding.
vec3 inverse_transposed(vec3 x, vec3 y, vec3 z, vec3 normal, float rounding) {
    vec3 a = cross(y, z), b = cross(z, x), c = cross(x, y);
    vec3 moved = vec3(dot(a, normal), dot(b, normal), dot(c, normal));
    return dot(x, a) < -rounding ? -moved : moved;
}
