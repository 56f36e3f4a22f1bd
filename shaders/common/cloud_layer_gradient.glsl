// What the gradient of cloud_layer.glsl's coefficients leads to. Needs d_coefficients[] and NUMBER(cloud, i): the
// cloud's appended scalars, then its appended vectors.
const uint NUMBERS = EXTRA + 3 * C1;
const uint VECTORS = EXTRA;

// The gradient with respect to an entry of the condensed weights, whose last column is C0.
float row_gradient(uint cloud, uint row, uint column) {
  const uint from = cloud * N4;
  if (row < ZERO_KEYS) {
    const uint path = row % PATHS, at = from + M0 + row / PATHS * LAYER_PATHS * FROM + column;
    if (path < OWN) return d_coefficients[at + path * FROM];
    float sum = 0.0;
    for (uint a = 0; a < 3; ++a)
      sum += NUMBER(cloud, VECTORS + 3 * (path - OWN) + a) * d_coefficients[at + (OWN + a) * FROM];
    return sum;
  }
  if (row < SKIP) {
    const uint path = (row - ZERO_KEYS) % Z, head = (row - ZERO_KEYS) / Z;
    const float scale = path >= C0 && path < C0 + EXTRA ? NUMBER(cloud, path - C0) : 1.0;
    return scale * d_coefficients[from + MZ0 + (head * FROM + min(path, C0)) * FROM + column];
  }
  if (row < ZERO_VALUES) return d_coefficients[from + S0 + (row - SKIP) * FROM + column];
  return d_coefficients[from + OZ0 + (row - ZERO_VALUES) * FROM + column];
}

// The gradient with respect to a path of the values, `row` being output · HEADS + head.
float value_gradient(uint cloud, uint row, uint path) {
  const uint at = cloud * N4 + O0 + row * LAYER_PATHS;
  if (path < OWN) return d_coefficients[at + path];
  float sum = 0.0;
  for (uint a = 0; a < 3; ++a)
    sum += NUMBER(cloud, VECTORS + 3 * (path - OWN) + a) * d_coefficients[at + OWN + a];
  return sum;
}
