// A one-sided layer where its gradient is made: what is kept of a row between the shaders. Needs common/point_layer.glsl.
const bool ZERO = (FLAGS & POINT_ZERO) != 0u;
const bool CONSTANT = (FLAGS & POINT_CONSTANT) != 0u;
const bool FEATURES = (FLAGS & POINT_FEATURES) != 0u;
const bool CENTRES = (FLAGS & POINT_CENTRES) != 0u;
const bool KEPT = (FLAGS & POINT_KEPT) != 0u;

// A row's record, in vec4s; vectors component by component. src/vk/point_attention_gradient.cpp counts the same.
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

