// pair_attention_gradient.comp: the gradient of a two-sided layer from its result to its messages, a work group per
// node; see src/ops/pair_attention.hpp. Sums and logits are made again from the messages.
// in  0 features   f32[B·KEYS,F]  four degrees of IN0 … IN3 channels, padded to F, a multiple of 4
// in  1 messages   f32[N·K,M]     of the run's N nodes: [values ; keys] by degree; padded to M, a multiple of 4
// in  2 weights    f32[W]         by degree, rows are outputs: query, project, self (if any), planes (if any, not (0,0))
// in  3 given      f32[B·KEYS,R]  gradient of the result: four degrees of OUT0 … OUT3 channels, padded to R
// out 4 record     f32[N,RECORD]  of the run's nodes: common/pair_record.glsl
// out 5 d_messages f32[N·K,M]     gradient of the messages
// spec 0 WORKGROUP=32  1 K≤64  2 HEADS≤64  3–6 IN  7–10 VALUES  11–14 KEYS  15 LINEAR  16 SEARCH  17–20 OUT  21 SELF
//      22 RELU  23 RELU_SQUARE
// grid N | shared 4·(2·K·HEADS + HEADS + numbers of keys + 2·values + 5·R) bytes ≤ 16 KiB
// loops ≤ 4·K·HEADS + (2·K·(HEADS·keys + values) + keys·IN + R·(VALUES + IN + 2·OUT + 20)) / WORKGROUP < 65535
// error: see src/ops/gradient.hpp | fp32
#version 450
#extension GL_GOOGLE_include_directive : require
#include "common/pair_layer.glsl"
#include "common/parameters.glsl"
#include "common/projected_relu.glsl"
#include "common/pair_record.glsl"

layout(local_size_x_id = 0) in;
#include "common/pair_attention.glsl"
layout(set = 0, binding = 3) readonly buffer Given { float given[]; };
layout(set = 0, binding = 4) writeonly buffer Record { float record[]; };
layout(set = 0, binding = 5) writeonly buffer DMessages { float d_messages[]; };

const int FEATURE_COUNT = FEATURE3 + 9 * IN3;

// A list of a node's record: numbers by degree, component and channel.
#define LIST1(a) PADDED(a)
#define LIST2(a, b) (LIST1(a) + 3 * PADDED(b))
#define LIST3(a, b, c) (LIST2(a, b) + 3 * PADDED(c))
#define LIST4(a, b, c, d) (LIST3(a, b, c) + 9 * PADDED(d))
#define PART(d, a, b, c) PICK(d, 0, LIST1(a), LIST2(a, b), LIST3(a, b, c))
const int GIVEN_AT = 0, MIXED_AT = GIVEN_AT + LIST4(OUT0, OUT1, OUT2, OUT3);
const int LINEAR_AT = MIXED_AT + LIST4(OUT0, OUT1, OUT2, OUT3);
const int SUM_AT = LINEAR_AT + LIST4(OUT0, OUT1, OUT2, OUT3);
const int QUERY_AT = SUM_AT + LIST4(VALUES0, VALUES1, VALUES2, VALUES3);
const int FEATURE_AT = QUERY_AT + LIST4(KEYS0, KEYS1, KEYS2, KEYS3);
const int OWN_AT = FEATURE_AT + LIST4(IN0, IN1, IN2, IN3);  // gradient of the node's feature, as a row of features
const int RECORD = OWN_AT + FEATURE_STRIDE;

// query becomes its own gradient once d_messages have it.
shared float d_logit[K * HEADS];  // by head
shared float d_sum[VALUE_COUNT];
shared float d_mixed[RESULT_COUNT];
shared float d_half[RESULT_COUNT], d_linear[RESULT_COUNT];  // behind the ReLU with its normals held; all of it

void make_weights(int lane, uint first) {
  make_logits(lane, first);
  barrier();
  make_exponentials(lane);
  barrier();
  for (int i = lane; i < K * HEADS; i += LANES) weight[i] *= share[i / K];
}

void make_sums(int lane, uint first) {
  for (int i = lane; i < VALUE_COUNT; i += LANES) {
    const int d = DEGREE(i, VALUE1, VALUE2, VALUE3), at = i - VALUE(d);
    const int head = at / (VALUES(d) / HEADS * DIM(d));
    const uint from = first + MESSAGE(d) + at;
    float x = 0.0;
    for (int j = 0; j < K; ++j) x += weight[K * head + j] * messages[from + j * MESSAGE_STRIDE];
    sum[i] = x;
  }
}

void differentiate_relu(int lane, uint result) {
  for (int i = lane; i < RESULT_COUNT; i += LANES) {
    const float g = given[result + i];
    const int d = DEGREE(i, RESULT1, RESULT2, RESULT3);
    float x = g, m = 0.0;
    if (d == 0) {
      x = linear[i] > 0.0 ? g : LEAKY_SLOPE * g;
    } else {
      const int begin = i - (i - RESULT(d)) % DIM(d);
      float along = 0.0, across = 0.0, length2 = 0.0;
      for (int c = 0; c < DIM(d); ++c) {
        along += linear[begin + c] * mixed[begin + c];
        across += given[result + begin + c] * mixed[begin + c];
        length2 += mixed[begin + c] * mixed[begin + c];
      }
      const float norm = max(sqrt(length2), PLANE_NORM_FLOOR);
      const float share = along >= 0.0 ? 0.0 : (1.0 - LEAKY_SLOPE) / (RELU_SQUARE ? norm * norm : norm);
      // The norm is a constant where it is floored.
      const float turn =
          sqrt(length2) > PLANE_NORM_FLOOR ? (RELU_SQUARE ? 2.0 : 1.0) * along * across / length2 : 0.0;
      x = g - share * across * mixed[i];
      m = share * (turn * mixed[i] - across * linear[i] - along * g);
    }
    d_half[i] = x;
    d_mixed[i] = m;
  }
  barrier();
  for (int i = lane; i < RESULT_COUNT; i += LANES) {
    const int d = DEGREE(i, RESULT1, RESULT2, RESULT3), channel = (i - RESULT(d)) / DIM(d);
    float x = d_half[i];
    if (d > 0) {
      const int column = PICK(d, 0, PLANE1, PLANE2, PLANE3) + channel, from = RESULT(d) + (i - RESULT(d)) % DIM(d);
      for (int o = 0; o < OUT(d); ++o) x += weights[column + o * OUT(d)] * d_mixed[from + o * DIM(d)];
    }
    d_linear[i] = x;
  }
}

void differentiate_sums(int lane) {
  for (int i = lane; i < VALUE_COUNT; i += LANES) {
    const int d = DEGREE(i, VALUE1, VALUE2, VALUE3), channel = (i - VALUE(d)) / DIM(d);
    const int column = PICK(d, PROJECT0, PROJECT1, PROJECT2, PROJECT3) + channel;
    const int from = RESULT(d) + (i - VALUE(d)) % DIM(d);
    float x = 0.0;
    for (int o = 0; o < OUT(d); ++o) x += weights[column + o * VALUES(d)] * d_linear[from + o * DIM(d)];
    d_sum[i] = x;
  }
}

void differentiate_weights(int lane, uint first) {
  for (int i = lane; i < K * HEADS; i += LANES) {
    const int j = i % K, head = i / K;
    float x = 0.0;
    for (int d = 0; d < 4; ++d) {
      const int count = VALUES(d) / HEADS * DIM(d), at = VALUE(d) + head * count;
      const uint from = first + j * MESSAGE_STRIDE + MESSAGE(d) + head * count;
      for (int c = 0; c < count; ++c) x += d_sum[at + c] * messages[from + c];
    }
    d_logit[i] = x;
  }
  barrier();
  for (int head = lane; head < HEADS; head += LANES) {
    float mean = 0.0;
    for (int j = 0; j < K; ++j) mean += weight[K * head + j] * d_logit[K * head + j];
    share[head] = mean;
  }
  barrier();
  for (int i = lane; i < K * HEADS; i += LANES) d_logit[i] = weight[i] * (d_logit[i] - share[i / K]);
}

void differentiate_messages(int lane, uint first) {
  for (int i = lane; i < K * MESSAGE_COUNT; i += LANES) {
    const int j = i / MESSAGE_COUNT, m = i % MESSAGE_COUNT;
    const int d = DEGREE(m, MESSAGE1, MESSAGE2, MESSAGE3), at = m - MESSAGE(d), values = VALUES(d) * DIM(d);
    float x;
    if (at < values)
      x = weight[K * (at / (VALUES(d) / HEADS * DIM(d))) + j] * d_sum[VALUE(d) + at];
    else
      x = d_logit[K * ((at - values) / (KEYS(d) / HEADS * DIM(d))) + j] * query[KEY(d) + at - values];
    d_messages[first + j * MESSAGE_STRIDE + m] = x;
  }
}

void differentiate_queries(int lane, uint first) {
  for (int i = lane; i < KEY_COUNT; i += LANES) {
    const int d = DEGREE(i, KEY1, KEY2, KEY3), at = i - KEY(d);
    const int head = at / (KEYS(d) / HEADS * DIM(d));
    const uint from = first + MESSAGE(d) + VALUES(d) * DIM(d) + at;
    float x = 0.0;
    for (int j = 0; j < K; ++j) x += d_logit[K * head + j] * messages[from + j * MESSAGE_STRIDE];
    query[i] = x;
  }
}

// By degree, component and channel.
#define KEEP(at, i, begin, d, channels, part, x)                                                                  \
  record[(at) + (part) + ((i) - (begin)) % DIM(d) * PADDED(channels) + ((i) - (begin)) / DIM(d)] = x

void keep(int lane, uint own, uint at) {
  for (int i = lane; i < RESULT_COUNT; i += LANES) {
    const int d = DEGREE(i, RESULT1, RESULT2, RESULT3), part = PART(d, OUT0, OUT1, OUT2);
    KEEP(at + GIVEN_AT, i, RESULT(d), d, OUT(d), part, d_linear[i]);
    if (RELU) {
      KEEP(at + MIXED_AT, i, RESULT(d), d, OUT(d), part, d_mixed[i]);
      KEEP(at + LINEAR_AT, i, RESULT(d), d, OUT(d), part, linear[i]);
    }
  }
  for (int i = lane; i < VALUE_COUNT; i += LANES) {
    const int d = DEGREE(i, VALUE1, VALUE2, VALUE3), part = PART(d, VALUES0, VALUES1, VALUES2);
    KEEP(at + SUM_AT, i, VALUE(d), d, VALUES(d), part, sum[i]);
  }
  for (int i = lane; i < KEY_COUNT; i += LANES) {
    const int d = DEGREE(i, KEY1, KEY2, KEY3), part = PART(d, KEYS0, KEYS1, KEYS2);
    KEEP(at + QUERY_AT, i, KEY(d), d, KEYS(d), part, query[i]);
  }
  for (int i = lane; i < FEATURE_STRIDE; i += LANES) {
    float x = 0.0;
    if (i < FEATURE_COUNT) {
      const int d = DEGREE(i, FEATURE1, FEATURE2, FEATURE3), part = PART(d, IN0, IN1, IN2);
      const int channel = (i - FEATURE(d)) / DIM(d), component = (i - FEATURE(d)) % DIM(d);
      KEEP(at + FEATURE_AT, i, FEATURE(d), d, IN_CHANNELS(d), part, features[own + i]);
      int column = PICK(d, 0, QUERY1, QUERY2, QUERY3) + channel;
      for (int o = 0; o < KEYS(d); ++o)
        x += weights[column + o * IN_CHANNELS(d)] * query[KEY(d) + o * DIM(d) + component];
      column = PICK(d, SELF0, SELF1, SELF2, SELF3) + channel;
      if (SELF)
        for (int o = 0; o < OUT(d); ++o)
          x += weights[column + o * IN_CHANNELS(d)] * d_linear[RESULT(d) + o * DIM(d) + component];
    }
    record[at + OWN_AT + i] = x;
  }
}

void main() {
  const int lane = int(gl_LocalInvocationID.x);
  const uint node = p.first_node + gl_WorkGroupID.x, own = node * FEATURE_STRIDE, result = node * RESULT_STRIDE;
  const uint first = gl_WorkGroupID.x * K * MESSAGE_STRIDE;
  make_queries(lane, own);
  barrier();
  make_weights(lane, first);
  barrier();
  make_sums(lane, first);
  barrier();
  if (RELU) {
    make_linear(lane, own);
    barrier();
    make_mixed(lane);
    barrier();
    differentiate_relu(lane, result);
  } else {
    for (int i = lane; i < RESULT_COUNT; i += LANES) d_linear[i] = given[result + i];
  }
  barrier();
  differentiate_sums(lane);
  barrier();
  differentiate_weights(lane, first);
  barrier();
  differentiate_messages(lane, first);
  barrier();
  differentiate_queries(lane, first);
  barrier();
  keep(lane, own, gl_WorkGroupID.x * RECORD);
}
