// Numbers of src/ops/loss.hpp and of src/ops/pose.hpp.
const float MATRIX_NORM_FLOOR = 1e-5;
const float SPREAD_WEIGHT = 0.1, SPREAD_REACH = 0.1;
const float DIRECT_ROTATION_WEIGHT = 2.7, DIRECT_SOFTENING = 1e-4;
const float INVERSE_SQRT3 = 0.57735026918962576;

// Of 12 numbers; columns of `R` are those of the matrix.
struct Truth {
  mat3 R;
  vec3 t;
};

Truth truth_of(vec4 a, vec4 b, vec4 c) {
  return Truth(mat3(a.x, a.w, b.z, a.y, b.x, b.w, a.z, b.y, c.x), c.yzw);
}

float square(mat3 m) { return dot(m[0], m[0]) + dot(m[1], m[1]) + dot(m[2], m[2]); }
