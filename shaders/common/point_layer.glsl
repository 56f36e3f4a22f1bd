// A one-sided layer (src/ops/point_attention.hpp) where its gradient is made: its sizes, where its matrices lie, and
// what is kept of a row between the shaders.
layout(constant_id = 1) const int K = 24;
layout(constant_id = 2) const int C0 = 4;
layout(constant_id = 3) const int C1 = 4;
layout(constant_id = 4) const int OUT0 = 4;
layout(constant_id = 5) const int OUT1 = 4;
layout(constant_id = 6) const int HEADS = 2;
layout(constant_id = 7) const uint FLAGS = 0;
layout(constant_id = 8) const int WEIGHTS = 64;  // vec4s

const bool UNIFORM = (FLAGS & 1u) != 0u;
const bool DIRECTION = (FLAGS & 2u) != 0u;
const bool PER_CLOUD = (FLAGS & 4u) != 0u;
const bool RELU = (FLAGS & 8u) != 0u;
const bool VECTOR_KEYS = (FLAGS & 16u) != 0u;
const bool RELU_SQUARE = (FLAGS & 32u) != 0u;
const bool ZERO = (FLAGS & 64u) != 0u;       // tiles that have edges of length zero
const bool CONSTANT = (FLAGS & 128u) != 0u;  // one feature for all points, the last of weights[]
const bool FEATURES = (FLAGS & 256u) != 0u;  // their gradient is wanted
const bool CENTRES = (FLAGS & 512u) != 0u;   // that of the centres is
const bool KEPT = (FLAGS & 1024u) != 0u;     // point_attention.comp has left its sums, but for edges of length zero

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

// A row's record, in vec4s; vectors component by component. src/vk/point_attention_gradient.cpp counts the same.
#define QUADS(n) (((n) + 3) / 4)
const int GIVEN0 = 0;                                         // gradient before the ReLU
const int GIVEN1 = GIVEN0 + QUADS(OUT0);
const int MIXED = GIVEN1 + 3 * QUADS(OUT1);                   // gradient of the planes' normals
const int LINEAR = MIXED + (RELU ? 3 * QUADS(OUT1) : 0);      // vectors before the ReLU
const int OWN0 = LINEAR + (RELU ? 3 * QUADS(OUT1) : 0);       // the row's feature, and 1
const int OWN1 = OWN0 + QUADS(Z0);
const int SUM0 = OWN1 + 3 * QUADS(C1);
const int SUM1 = SUM0 + QUADS(HEADS * N0);
const int QUERY0 = SUM1 + 3 * QUADS(HEADS * N1);              // gradient of the queries
const int QUERY1 = QUERY0 + QUERIES * QUADS(HEADS * N0);
const int ZERO_SUM0 = QUERY1 + KEYS1 * 3 * QUADS(HEADS * N1);
const int ZERO_SUM1 = ZERO_SUM0 + QUADS(HEADS * Z0);
const int ZERO_QUERY0 = ZERO_SUM1 + 3 * QUADS(HEADS * Z1);
const int ZERO_QUERY1 = ZERO_QUERY0 + QUERIES * QUADS(HEADS * Z0);
const int SUM_GRADIENT0 = ZERO_QUERY1 + KEYS1 * 3 * QUADS(HEADS * Z1);  // where OUT1 = 0
const int ZERO_SUM_GRADIENT0 = SUM_GRADIENT0 + (OUT1 == 0 ? QUADS(HEADS * N0) : 0);
const int STATE = ZERO_SUM_GRADIENT0 + (OUT1 == 0 ? QUADS(HEADS * Z0) : 0);
const int OWN = STATE + 1 + HEADS;   // gradient of the row's feature; STATE: flag, then (largest, 1 / total, delta)
const int CENTRE = OWN + F4;         // gradient of its position
const int RECORD = CENTRE + 1;

const int AT_LEAST_N1 = N1 > 0 ? N1 : 1, AT_LEAST_Z1 = Z1 > 0 ? Z1 : 1, AT_LEAST_OUT1 = OUT1 > 0 ? OUT1 : 1;

