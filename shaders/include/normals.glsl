// Transformation of normals by linear maps, shared by all vertex shaders that need it.

// Transforms a normal of any length by the inverse transpose of the matrix with rows x, y, z,
// scaled by |determinant|: the cofactor matrix with the determinant's sign. The sign keeps outward
// normals outward under a reflection, which is detected as a determinant below -rounding.
vec3 inverse_transposed(vec3 x, vec3 y, vec3 z, vec3 normal, float rounding) {
    vec3 a = cross(y, z), b = cross(z, x), c = cross(x, y);
    vec3 moved = vec3(dot(a, normal), dot(b, normal), dot(c, normal));
    return dot(x, a) < -rounding ? -moved : moved;
}
