// Attention over a two-sided layer's messages, a work group per node: what the layer (pair_attention.comp) and its
// gradient (pair_attention_gradient.comp) begin with. Needs common/pair_layer.glsl and common/parameters.glsl.
layout(constant_id = 1) const int K = 24;
layout(constant_id = 2) const int HEADS = 2;
layout(constant_id = 17) const int OUT0 = 4;
layout(constant_id = 18) const int OUT1 = 4;
layout(constant_id = 19) const int OUT2 = 4;
layout(constant_id = 20) const int OUT3 = 4;
layout(constant_id = 21) const bool SELF = true;
layout(constant_id = 22) const bool RELU = true;
layout(constant_id = 23) const bool RELU_SQUARE = false;

layout(set = 0, binding = 0) readonly buffer Features { float features[]; };
layout(set = 0, binding = 1) readonly buffer Messages { float messages[]; };
layout(set = 0, binding = 2) readonly buffer Weights { float weights[]; };
layout(push_constant) uniform Push { PairParameters p; };

#define OUT(d) PICK(d, OUT0, OUT1, OUT2, OUT3)

// Rows of keys, values and results, by degree.
const int KEY1 = KEYS0, KEY2 = KEY1 + 3 * KEYS1, KEY3 = KEY2 + 3 * KEYS2, KEY_COUNT = KEY3 + 9 * KEYS3;
const int VALUE1 = VALUES0, VALUE2 = VALUE1 + 3 * VALUES1, VALUE3 = VALUE2 + 3 * VALUES2;
const int VALUE_COUNT = VALUE3 + 9 * VALUES3;
const int RESULT1 = OUT0, RESULT2 = RESULT1 + 3 * OUT1, RESULT3 = RESULT2 + 3 * OUT2;
const int RESULT_COUNT = RESULT3 + 9 * OUT3, RESULT_STRIDE = (RESULT_COUNT + 3) / 4 * 4;
#define KEY(d) PICK(d, 0, KEY1, KEY2, KEY3)
#define VALUE(d) PICK(d, 0, VALUE1, VALUE2, VALUE3)
#define RESULT(d) PICK(d, 0, RESULT1, RESULT2, RESULT3)
#define DEGREE(i, second, third, fourth) ((i) < (second) ? 0 : (i) < (third) ? 1 : (i) < (fourth) ? 2 : 3)

// Where the matrices begin in weights[].
const int QUERY1 = KEYS0 * IN0, QUERY2 = QUERY1 + KEYS1 * IN1, QUERY3 = QUERY2 + KEYS2 * IN2;
const int PROJECT0 = QUERY3 + KEYS3 * IN3, PROJECT1 = PROJECT0 + OUT0 * VALUES0;
const int PROJECT2 = PROJECT1 + OUT1 * VALUES1, PROJECT3 = PROJECT2 + OUT2 * VALUES2;
const int SELF0 = PROJECT3 + OUT3 * VALUES3, SELF1 = SELF0 + (SELF ? OUT0 * IN0 : 0);
const int SELF2 = SELF1 + (SELF ? OUT1 * IN1 : 0), SELF3 = SELF2 + (SELF ? OUT2 * IN2 : 0);
const int PLANE1 = SELF3 + (SELF ? OUT3 * IN3 : 0), PLANE2 = PLANE1 + OUT1 * OUT1, PLANE3 = PLANE2 + OUT2 * OUT2;

const int LANES = int(gl_WorkGroupSize.x);

shared float query[KEY_COUNT];
shared float weight[K * HEADS];  // by head: logits, then their exponentials
shared float share[HEADS];       // one over their sum
shared float sum[VALUE_COUNT];
shared float linear[RESULT_COUNT], mixed[RESULT_COUNT];

void make_queries(int lane, uint own) {
  for (int i = lane; i < KEY_COUNT; i += LANES) {
    const int d = DEGREE(i, KEY1, KEY2, KEY3), at = i - KEY(d);
    const int row = PICK(d, 0, QUERY1, QUERY2, QUERY3) + at / DIM(d) * IN_CHANNELS(d);
    const uint from = own + FEATURE(d) + at % DIM(d);
    float x = 0.0;
    for (int c = 0; c < IN_CHANNELS(d); ++c) x += weights[row + c] * features[from + c * DIM(d)];
    query[i] = x;
  }
}

void make_logits(int lane, uint first) {
  for (int i = lane; i < K * HEADS; i += LANES) {
    const int j = i % K, head = i / K;
    float logit = 0.0;
    for (int d = 0; d < 4; ++d) {
      const int count = KEYS(d) / HEADS * DIM(d), at = KEY(d) + head * count;
      const uint from = first + j * MESSAGE_STRIDE + MESSAGE(d) + VALUES(d) * DIM(d) + head * count;
      for (int c = 0; c < count; ++c) logit += query[at + c] * messages[from + c];
    }
    weight[i] = logit;
  }
}

// In the place of the logits.
void make_exponentials(int lane) {
  for (int head = lane; head < HEADS; head += LANES) {
    float largest = weight[K * head], total = 0.0;
    for (int j = 1; j < K; ++j) largest = max(largest, weight[K * head + j]);
    for (int j = 0; j < K; ++j) {
      const float x = exp(weight[K * head + j] - largest);
      weight[K * head + j] = x;
      total += x;
    }
    share[head] = 1.0 / total;
  }
}

// Before the ReLU, and what its planes' normals make of it.
void make_linear(int lane, uint own) {
  for (int i = lane; i < RESULT_COUNT; i += LANES) {
    const int d = DEGREE(i, RESULT1, RESULT2, RESULT3), channel = (i - RESULT(d)) / DIM(d);
    const int component = (i - RESULT(d)) % DIM(d);
    const int row = PICK(d, PROJECT0, PROJECT1, PROJECT2, PROJECT3) + channel * VALUES(d);
    const int self_row = PICK(d, SELF0, SELF1, SELF2, SELF3) + channel * IN_CHANNELS(d);
    const uint from = own + FEATURE(d) + component;
    float x = 0.0;
    for (int c = 0; c < VALUES(d); ++c) x += weights[row + c] * sum[VALUE(d) + c * DIM(d) + component];
    if (SELF)
      for (int c = 0; c < IN_CHANNELS(d); ++c) x += weights[self_row + c] * features[from + c * DIM(d)];
    linear[i] = x;
  }
}

void make_mixed(int lane) {
  for (int i = lane + RESULT1; i < RESULT_COUNT; i += LANES) {
    const int d = DEGREE(i, RESULT1, RESULT2, RESULT3), channel = (i - RESULT(d)) / DIM(d);
    const int row = PICK(d, 0, PLANE1, PLANE2, PLANE3) + channel * OUT(d);
    const int from = RESULT(d) + (i - RESULT(d)) % DIM(d);
    float x = 0.0;
    for (int c = 0; c < OUT(d); ++c) x += weights[row + c] * linear[from + c * DIM(d)];
    mixed[i] = x;
  }
}
