// A one-sided layer (src/ops/point_attention.hpp): its sizes, and where its matrices lie.
#include "common/point_flags.glsl"

layout(constant_id = 1) const int K = 24;
layout(constant_id = 2) const int C0 = 4;
layout(constant_id = 3) const int C1 = 4;
layout(constant_id = 4) const int OUT0 = 4;
layout(constant_id = 5) const int OUT1 = 4;
layout(constant_id = 6) const int HEADS = 2;
layout(constant_id = 7) const uint FLAGS = 0;
layout(constant_id = 8) const int WEIGHTS = 64;  // vec4s

const bool UNIFORM = (FLAGS & POINT_UNIFORM) != 0u;
const bool DIRECTION = (FLAGS & POINT_DIRECTION) != 0u;
const bool PER_CLOUD = (FLAGS & POINT_PER_CLOUD) != 0u;
const bool RELU = (FLAGS & POINT_RELU) != 0u;
const bool VECTOR_KEYS = (FLAGS & POINT_VECTOR_KEYS) != 0u;
const bool RELU_SQUARE = (FLAGS & POINT_RELU_SQUARE) != 0u;

// Paths of the two degrees, of edges and of zero-length edges.
const int N0 = C0 + C1 + (DIRECTION ? 3 : 0);
const int N1 = OUT1 > 0 ? C0 + 3 * C1 : 0;
const int Z0 = C0 + 1;
const int Z1 = OUT1 > 0 ? C1 : 0;
const int QUERIES = UNIFORM ? 0 : 1;
const int KEYS1 = UNIFORM || !VECTOR_KEYS ? 0 : 1;

const int M1 = 0;
const int O1 = M1 + KEYS1 * HEADS * N1 * C1;
const int S1 = O1 + OUT1 * HEADS * N1;
const int MZ1 = S1 + QUERIES * OUT1 * C1;
const int OZ1 = MZ1 + KEYS1 * HEADS * Z1 * C1;
const int PLANE = OZ1 + OUT1 * HEADS * Z1;
const int DEGREE0 = (PLANE + (RELU ? OUT1 * OUT1 : 0) + 3) / 4 * 4;

const int M0 = 0;
const int O0 = M0 + QUERIES * HEADS * N0 * Z0;
const int S0 = O0 + OUT0 * HEADS * N0;
const int MZ0 = S0 + QUERIES * OUT0 * Z0;
const int OZ0 = MZ0 + QUERIES * HEADS * Z0 * Z0;
const int COEFFICIENT_STRIDE = (OZ0 + OUT0 * HEADS * Z0 + 3) / 4 * 4;

const int F4 = (C0 + 3 * C1 + 3) / 4;
const int R4 = (OUT0 + 3 * OUT1 + 3) / 4;

#define QUADS(n) (((n) + 3) / 4)
