// pair_attention.comp: attention over a two-sided layer's messages, and its projected ReLU, a work group per node; see
// src/ops/pair_attention.hpp.
// in  0 features f32[B·KEYS,F]  four degrees of IN0 … IN3 channels, padded to F, a multiple of 4
// in  1 messages f32[N·K,M]     of the run's N nodes: [values ; keys] by degree; padded to M, a multiple of 4
// in  2 weights  f32[W]         by degree, rows are outputs: query, project, self (if any), planes (if any, not (0,0))
// out 3 result   f32[B·KEYS,R]  four degrees of OUT0 … OUT3 channels, padded to R, a multiple of 4
// spec 0 WORKGROUP=32  1 K≤64  2 HEADS≤64  3–6 IN  7–10 VALUES  11–14 KEYS  15 LINEAR  16 SEARCH  17–20 OUT  21 SELF
//      22 RELU  23 RELU_SQUARE
// grid N | shared 4·(K·HEADS + HEADS + numbers of keys and values + 2·R) bytes ≤ 16 KiB
// loops ≤ 2·K·HEADS + (K·(HEADS·keys + values) + keys·IN + R·(VALUES + IN + OUT + 10)) / WORKGROUP < 65535
// error: see src/ops/pair_attention.hpp | fp32
#version 450
#extension GL_GOOGLE_include_directive : require
#include "common/pair_layer.glsl"
#include "common/parameters.glsl"
#include "common/projected_relu.glsl"

layout(local_size_x_id = 0) in;
#include "common/pair_attention.glsl"
layout(set = 0, binding = 3) writeonly buffer Result { float result[]; };

void main() {
  const int lane = int(gl_LocalInvocationID.x);
  const uint own = (p.first_node + gl_WorkGroupID.x) * FEATURE_STRIDE;
  const uint first = gl_WorkGroupID.x * K * MESSAGE_STRIDE;

  make_queries(lane, own);
  barrier();
  make_logits(lane, first);
  barrier();
  make_exponentials(lane);
  barrier();

  for (int i = lane; i < VALUE_COUNT; i += LANES) {
    const int d = DEGREE(i, VALUE1, VALUE2, VALUE3), at = i - VALUE(d);
    const int head = at / (VALUES(d) / HEADS * DIM(d));
    const uint from = first + MESSAGE(d) + at;
    float x = 0.0;
    for (int j = 0; j < K; ++j) x += weight[K * head + j] * messages[from + j * MESSAGE_STRIDE];
    sum[i] = x * share[head];
  }
  barrier();

  make_linear(lane, own);
  barrier();
  if (RELU) {
    make_mixed(lane);
    barrier();
  }

  const uint to = (p.first_node + gl_WorkGroupID.x) * RESULT_STRIDE;
  for (int i = lane; i < RESULT_STRIDE; i += LANES) {
    float x = 0.0;
    if (i < RESULT_COUNT) {
      const int d = DEGREE(i, RESULT1, RESULT2, RESULT3);
      x = linear[i];
      if (RELU && d == 0) x = leaky(x);
      if (RELU && d > 0) {
        const int begin = i - (i - RESULT(d)) % DIM(d);
        float along = 0.0, square = 0.0;
        for (int m = begin; m < begin + DIM(d); ++m) {
          along += linear[m] * mixed[m];
          square += mixed[m] * mixed[m];
        }
        const float norm = max(sqrt(square), PLANE_NORM_FLOOR);
        if (!(along >= 0.0)) x -= (1.0 - LEAKY_SLOPE) * along / norm / (RELU_SQUARE ? norm : 1.0) * mixed[i];
      }
    }
    result[to + i] = x;
  }
}
