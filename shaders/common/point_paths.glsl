// The paths of an edge of a one-sided layer (common/point_layer.glsl), and how they meet the queries. Needs Features
// (common/texels.glsl), common/point_weights.glsl, tiles[], record[], p.

// Factors of the Clebsch–Gordan products 1 ⊗ 1 → 1: −1/√3, 1/√2, 1/√6.
const float CG0 = -0.57735026918962576, CG1 = 0.70710678118654752, CG2 = 0.40824829046386302;

#define SCALAR(f, c) f[c]
#define VECTOR(f, c) vec3(f[C0 + 3 * (c)], f[C0 + 3 * (c) + 1], f[C0 + 3 * (c) + 2])

float own[4 * F4], feature[4 * F4];
float phi0[N0];
vec3 phi1[AT_LEAST_N1];
float zero_phi0[Z0];
vec3 zero_phi1[AT_LEAST_Z1];
float query0[HEADS * N0], zero_query0[HEADS * Z0];
vec3 query1[HEADS * AT_LEAST_N1], zero_query1[HEADS * AT_LEAST_Z1];

vec4 feature_part(uint row, int i) {
  return CONSTANT ? vec4(weights[WEIGHTS - 1].x, 0, 0, 0) : VEC4_OF(Features, row * F4 + i);
}

#define LOAD(array, i, part) \
  array[4 * (i)] = part.x, array[4 * (i) + 1] = part.y, array[4 * (i) + 2] = part.z, array[4 * (i) + 3] = part.w

// From the row's own feature.
void make_queries(uint row) {
  [[unroll]] for (int i = 0; i < F4; ++i) {
    const vec4 part = feature_part(row, i);
    LOAD(own, i, part);
  }
  WEIGHTS0(m0, M0, HEADS * N0 * Z0)
  [[unroll]] for (int i = 0; i < HEADS * N0; ++i) {
    query0[i] = m0[i * Z0 + C0];
    [[unroll]] for (int c = 0; c < C0; ++c) query0[i] += m0[i * Z0 + c] * SCALAR(own, c);
  }
  [[unroll]] for (int i = 0; i < KEYS1 * HEADS * N1; ++i) {
    query1[i] = vec3(0);
    [[unroll]] for (int c = 0; c < C1; ++c) query1[i] += weight1(M1 + i * C1 + c) * VECTOR(own, c);
  }
  if (ZERO) {
    WEIGHTS0(mz0, MZ0, HEADS * Z0 * Z0)
    [[unroll]] for (int i = 0; i < HEADS * Z0; ++i) {
      zero_query0[i] = mz0[i * Z0 + C0];
      [[unroll]] for (int c = 0; c < C0; ++c) zero_query0[i] += mz0[i * Z0 + c] * SCALAR(own, c);
    }
    [[unroll]] for (int i = 0; i < KEYS1 * HEADS * Z1; ++i) {
      zero_query1[i] = vec3(0);
      [[unroll]] for (int c = 0; c < C1; ++c) zero_query1[i] += weight1(MZ1 + i * C1 + c) * VECTOR(own, c);
    }
  }
}

// φ, zero for edges of length zero; φᶻ, zero for all others.
void make_paths(Edge edge, uint neighbour) {
  [[unroll]] for (int i = 0; i < F4; ++i) {
    const vec4 part = feature_part(neighbour, i);
    LOAD(feature, i, part);
  }
  const vec3 v = edge.direction;
  const float positive = edge.zero ? 0.0 : 1.0;
  [[unroll]] for (int c = 0; c < C0; ++c) phi0[c] = positive * SCALAR(feature, c);
  [[unroll]] for (int c = 0; c < C1; ++c) phi0[C0 + c] = dot(v, VECTOR(feature, c));
  if (DIRECTION) {
    phi0[N0 - 3] = v.x;
    phi0[N0 - 2] = v.y;
    phi0[N0 - 1] = v.z;
  }
  if (N1 > 0) {
    [[unroll]] for (int c = 0; c < C0; ++c) phi1[c] = v * SCALAR(feature, c);
    [[unroll]] for (int c = 0; c < C1; ++c) {
      phi1[C0 + c] = CG0 * positive * VECTOR(feature, c);
      phi1[C0 + C1 + c] = CG1 * cross(v, VECTOR(feature, c));
      phi1[C0 + 2 * C1 + c] = CG2 * (3.0 * phi0[C0 + c] * v - edge.square * VECTOR(feature, c));
    }
  }
  if (ZERO) {
    const float zero = 1.0 - positive;
    [[unroll]] for (int c = 0; c < C0; ++c) zero_phi0[c] = zero * SCALAR(feature, c);
    zero_phi0[C0] = zero;
    [[unroll]] for (int c = 0; c < Z1; ++c) zero_phi1[c] = zero * VECTOR(feature, c);
  }
}

float logit(int h) {
  float sum = 0.0;
  [[unroll]] for (int i = 0; i < N0; ++i) sum += query0[h * N0 + i] * phi0[i];
  [[unroll]] for (int i = 0; i < KEYS1 * N1; ++i) sum += dot(query1[h * N1 + i], phi1[i]);
  if (ZERO) {
    [[unroll]] for (int i = 0; i < Z0; ++i) sum += zero_query0[h * Z0 + i] * zero_phi0[i];
    [[unroll]] for (int i = 0; i < KEYS1 * Z1; ++i) sum += dot(zero_query1[h * Z1 + i], zero_phi1[i]);
  }
  return sum;
}

// Into a record. Beyond the array's end there are zeros.
#define ENTRY(array, i, n) ((i) < (n) ? array[(i) < (n) ? (i) : 0] : 0.0)
#define COMPONENT(array, i, n, a) ((i) < (n) ? array[(i) < (n) ? (i) : 0][a] : 0.0)
#define STORE(to, array, n)                                                                                     \
  [[unroll]] for (int i = 0; i < QUADS(n); ++i)                                                                 \
    record[(to) + i] = vec4(ENTRY(array, 4 * i, n), ENTRY(array, 4 * i + 1, n), ENTRY(array, 4 * i + 2, n),     \
                            ENTRY(array, 4 * i + 3, n))
#define STORE_VECTORS(to, array, n)                                                                             \
  [[unroll]] for (int a = 0; a < 3; ++a)                                                                        \
    [[unroll]] for (int i = 0; i < QUADS(n); ++i)                                                               \
      record[(to) + a * QUADS(n) + i] =                                                                         \
          vec4(COMPONENT(array, 4 * i, n, a), COMPONENT(array, 4 * i + 1, n, a),                                \
               COMPONENT(array, 4 * i + 2, n, a), COMPONENT(array, 4 * i + 3, n, a))

// The tiles a work group takes: its own, or, of 32 in a row, those that have edges of length zero.
const uint TILES = 32;
shared uint flagged[TILES], list[TILES];

uint list_flagged() {
  const uint tile = gl_WorkGroupID.x * TILES + gl_LocalInvocationID.x;
  if (gl_LocalInvocationID.x < TILES) {
    const uvec4 rows = tiles[p.first_tile + min(tile, p.tiles - 1u)];
    uint any = 0u;
    for (uint row = rows.y; row < rows.z; ++row)
      any |= floatBitsToUint(record[(row - p.first_row) * RECORD + STATE].x);
    flagged[gl_LocalInvocationID.x] = tile < p.tiles ? any : 0u;
  }
  barrier();
  uint count = 0u;
  for (uint i = 0; i < TILES; ++i)
    if (flagged[i] != 0u) {
      if (gl_LocalInvocationID.x == 0u) list[count] = p.first_tile + gl_WorkGroupID.x * TILES + i;
      ++count;
    }
  barrier();
  return count;
}
