// Numbers of src/ops/loss.hpp and of src/ops/pose.hpp.
const float MATRIX_NORM_FLOOR = 1e-5;
const float SPREAD_WEIGHT = 0.1, SPREAD_REACH = 0.1;
const float DIRECT_ROTATION_WEIGHT = 2.7, DIRECT_SOFTENING = 1e-4;
const float ROBUST_ROTATION_WEIGHT = 0.5, ROBUST_SOFTENING = 1e-3;
// ops::LossKind's.
const uint OFFICIAL_KIND = 0, ROBUST_KIND = 2;
const float INVERSE_SQRT3 = 0.57735026918962576;

// Columns of `R` are those of the matrix.
struct Truth {
  mat3 R;
  vec3 t;
};

// Cosine and sine of an angle of a few turns. What devices have for them may be wrong in the third digit.
vec2 cos_sin(float angle) {
  const float quarters = round(angle * 0.63661977236758134);
  const float x = (angle - quarters * 1.57079637) + quarters * 4.3711388e-8, y = x * x;
  const float cosine = 1.0 - y * (1.0 / 2.0 - y * (1.0 / 24.0 - y * (1.0 / 720.0 - y / 40320.0)));
  const float sine = x * (1.0 - y * (1.0 / 6.0 - y * (1.0 / 120.0 - y * (1.0 / 5040.0 - y / 362880.0))));
  const int quadrant = int(quarters) & 3;
  const vec2 first = (quadrant & 1) == 0 ? vec2(cosine, sine) : vec2(-sine, cosine);
  return quadrant < 2 ? first : -first;
}

// The true pose of 20 numbers that is nearest to an estimate of the rotation, whatever its length.
Truth truth_of(vec4 a, vec4 b, vec4 c, vec4 d, vec4 e, mat3 estimate) {
  const mat3 R = mat3(a.x, a.w, b.z, a.y, b.x, b.w, a.z, b.y, c.x), A = transpose(R) * estimate;
  const vec3 axis = d.xyz, centre = vec3(d.w, e.xy);
  // ⟨A, S(θ)⟩ is largest here.
  const vec3 skew = vec3(A[1].z - A[2].y, A[2].x - A[0].z, A[0].y - A[1].x);
  const float along = A[0].x + A[1].y + A[2].z - dot(axis, A * axis), across = dot(axis, skew);
  const float size = length(vec2(along, across));
  vec2 turned = size > 0.0 ? vec2(along, across) / size : vec2(1, 0);
  if (e.z > 0.0) turned = cos_sin(e.z * round(atan(across, along) / e.z));
  const float cosine = turned.x, sine = turned.y;
  const mat3 turn = cosine * mat3(1) + (1.0 - cosine) * outerProduct(axis, axis) +
                    sine * mat3(0, axis.z, -axis.y, -axis.z, 0, axis.x, axis.y, -axis.x, 0);
  return Truth(R * turn, c.yzw + R * (centre - turn * centre));
}

float square(mat3 m) { return dot(m[0], m[0]) + dot(m[1], m[1]) + dot(m[2], m[2]); }
