// Slopes and floors of src/ops/projected_relu.hpp.
const float LEAKY_SLOPE = 0.2;
const float PLANE_NORM_FLOOR = 1e-8;

float leaky(float x) { return x > 0.0 ? x : LEAKY_SLOPE * x; }

// x minus what lies behind the plane with normal `mixed`; `square`: over the normal's squared length.
vec3 projected_relu(vec3 x, vec3 mixed, bool square) {
  const float along = dot(x, mixed);
  const float norm = max(length(mixed), PLANE_NORM_FLOOR);
  const float share = (1.0 - LEAKY_SLOPE) * along / norm / (square ? norm : 1.0);
  return along >= 0.0 ? x : x - share * mixed;
}
