// Sizes of a layer whose features are extended by numbers that are constant over a cloud, and where its coefficients
// lie; see src/ops/cloud_coefficients.hpp. Needs C0, C1, GLOBALS, OUT and HEADS.
const uint EXTRA = 2 * GLOBALS + 2 * C0;
const uint Z = C0 + EXTRA + 1;
const uint PATHS = C0 + 2 * C1;
const uint M4 = (C0 + 3 * C1 + 3) / 4 * 4;
const uint G4 = (GLOBALS + 3) / 4 * 4;

// Rows of the weights.
const uint ZERO_KEYS = HEADS * PATHS;
const uint SKIP = ZERO_KEYS + HEADS * Z;
const uint ZERO_VALUES = SKIP + OUT;
const uint ROWS = ZERO_VALUES + OUT * HEADS;
const uint VALUES = ROWS * Z;

// Sizes of the layer with per-cloud coefficients, and where its matrices begin.
const uint FROM = C0 + 1;
const uint OWN = C0 + C1;
const uint LAYER_PATHS = OWN + 3;
const uint M0 = 0;
const uint O0 = M0 + HEADS * LAYER_PATHS * FROM;
const uint S0 = O0 + OUT * HEADS * LAYER_PATHS;
const uint MZ0 = S0 + OUT * FROM;
const uint OZ0 = MZ0 + HEADS * FROM * FROM;
const uint N = OZ0 + OUT * HEADS * FROM;
const uint N4 = (N + 3) / 4 * 4;
