// Numbers of src/ops/loss.hpp and of src/ops/pose.hpp.
const float MATRIX_NORM_FLOOR = 1e-5;
const float SPREAD_WEIGHT = 0.1, SPREAD_REACH = 0.1;
const float DIRECT_ROTATION_WEIGHT = 2.7, DIRECT_SOFTENING = 1e-4;
const float INVERSE_SQRT3 = 0.57735026918962576;

// Columns of `R` are those of the matrix.
struct Truth {
  mat3 R;
  vec3 t;
};

// The true pose of 20 numbers that is nearest to an estimate of the rotation, whatever its length.
Truth truth_of(vec4 a, vec4 b, vec4 c, vec4 d, vec4 e, mat3 estimate) {
  const mat3 R = mat3(a.x, a.w, b.z, a.y, b.x, b.w, a.z, b.y, c.x), A = transpose(R) * estimate;
  const vec3 axis = d.xyz, centre = vec3(d.w, e.xy);
  // ⟨A, S(θ)⟩ is largest here.
  const vec3 skew = vec3(A[1].z - A[2].y, A[2].x - A[0].z, A[0].y - A[1].x);
  float angle = atan(dot(axis, skew), A[0].x + A[1].y + A[2].z - dot(axis, A * axis));
  if (e.z > 0.0) angle = e.z * round(angle / e.z);
  const float cosine = cos(angle), sine = sin(angle);
  const mat3 turn = cosine * mat3(1) + (1.0 - cosine) * outerProduct(axis, axis) +
                    sine * mat3(0, axis.z, -axis.y, -axis.z, 0, axis.x, axis.y, -axis.x, 0);
  return Truth(R * turn, c.yzw + R * (centre - turn * centre));
}

float square(mat3 m) { return dot(m[0], m[0]) + dot(m[1], m[1]) + dot(m[2], m[2]); }
