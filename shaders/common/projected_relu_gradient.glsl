// The gradient of the projected ReLU of one vector (projected_relu.glsl), from that of what it made.
struct ReluGradient {
  vec3 x, mixed;  // with respect to the vector, its normal held; to the normal
};

ReluGradient projected_relu_gradient(vec3 x, vec3 mixed, vec3 given, bool square) {
  const float along = dot(x, mixed), across = dot(given, mixed), length2 = dot(mixed, mixed);
  const float norm = max(sqrt(length2), PLANE_NORM_FLOOR), divisor = square ? norm * norm : norm;
  const float share = along >= 0.0 ? 0.0 : (1.0 - LEAKY_SLOPE) / divisor;
  // The norm is a constant where it is floored.
  const float turn = sqrt(length2) > PLANE_NORM_FLOOR ? (square ? 2.0 : 1.0) * along * across / length2 : 0.0;
  return ReluGradient(given - share * across * mixed, share * (turn * mixed - across * x - along * given));
}
