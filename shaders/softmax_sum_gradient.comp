// softmax_sum_gradient.comp: of sums over a cloud weighted by softmax, with respect to the logits and to one tensor of
// values, an invocation per row; see src/ops/softmax_sum.hpp.
// in  0 logits     f32[P,L]      the first CHANNELS columns are used; rows padded to L, a multiple of 4
// in  1 normaliser f32[S,L/4,8]  as in softmax_normaliser.comp
// in  2 tiles      u32[tiles,4]
// in  3 values     f32[P,V]      COLUMNS columns from SKIP on are summed; rows padded to V, a multiple of 4
// in  4 sums       f32[S·CHANNELS,C4]  COLUMNS, padded to C4
// in  5 d_sums     f32[S·CHANNELS,C4]  if FLAGS & 8; else zero
// mod 6 d_logits   f32[P,L]      if FLAGS & 1; & 2: added to
// out 7 d_values   f32[P,V]      if FLAGS & 4
// spec 0 WORKGROUP=32  1 CHANNELS≤1024  2 L  3 V  4 SKIP  5 COLUMNS≤256  6 FLAGS≤15 | grid tiles | shared 0 KiB
// loops ≤ CHANNELS + 4·L ≤ 5120 < 65535 | error: see src/ops/gradient.hpp | fp32
#version 450
#extension GL_EXT_control_flow_attributes : require
#extension GL_GOOGLE_include_directive : require
#include "common/parameters.glsl"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const uint CHANNELS = 32;
layout(constant_id = 2) const uint L = 32;
layout(constant_id = 3) const uint V = 4;
layout(constant_id = 4) const uint SKIP = 0;
layout(constant_id = 5) const uint COLUMNS = 3;
layout(constant_id = 6) const uint FLAGS = 13;

const bool LOGITS = (FLAGS & 1u) != 0u;
const bool MORE = (FLAGS & 2u) != 0u;
const bool VALUES = (FLAGS & 4u) != 0u;
const bool GIVEN = (FLAGS & 8u) != 0u;
const uint C4 = (COLUMNS + 3) / 4;

layout(set = 0, binding = 0) readonly buffer Logits { float logits[]; };
layout(set = 0, binding = 1) readonly buffer Normaliser { float normaliser[]; };
layout(set = 0, binding = 2) readonly buffer Tiles { uvec4 tiles[]; };
layout(set = 0, binding = 3) readonly buffer Values { float values[]; };
layout(set = 0, binding = 4) readonly buffer Sums { vec4 sums[]; };
layout(set = 0, binding = 5) readonly buffer SumGradient { vec4 d_sums[]; };
layout(set = 0, binding = 6) buffer LogitGradient { float d_logits[]; };
layout(set = 0, binding = 7) writeonly buffer ValueGradient { float d_values[]; };
layout(push_constant) uniform Push { TileParameters p; };

void main() {
  const uvec4 tile = tiles[p.first_tile + gl_WorkGroupID.x];
  const uint row = tile.y + gl_LocalInvocationID.x;
  if (row >= tile.z) return;

  vec4 value[C4], d_value[C4];
  [[unroll]] for (uint i = 0; i < C4; ++i) {
    d_value[i] = vec4(0);
    value[i] = vec4(0);
    [[unroll]] for (uint j = 0; j < 4; ++j)
      if (4 * i + j < COLUMNS) value[i][j] = values[row * V + SKIP + 4 * i + j];
  }
  for (uint c = 0; c < CHANNELS; ++c) {
    const uint at = (tile.x * L + c / 4 * 4) * 2 + c % 4, sum = (tile.x * CHANNELS + c) * C4;
    const float weight = exp(logits[row * L + c] - normaliser[at]) * normaliser[at + 4];
    float along = 0.0;
    [[unroll]] for (uint i = 0; i < C4; ++i) {
      vec4 d = GIVEN ? d_sums[sum + i] : vec4(0), off = value[i] - sums[sum + i];
      // Padding is any number.
      if (4 * i + 1 >= COLUMNS) d.y = 0.0, off.y = 0.0;
      if (4 * i + 2 >= COLUMNS) d.z = 0.0, off.z = 0.0;
      if (4 * i + 3 >= COLUMNS) d.w = 0.0, off.w = 0.0;
      d_value[i] += weight * d;
      along += dot(d, off);
    }
    if (LOGITS) d_logits[row * L + c] = weight * along + (MORE ? d_logits[row * L + c] : 0.0);
  }
  if (LOGITS && !MORE)
    for (uint c = CHANNELS; c < L; ++c) d_logits[row * L + c] = 0.0;
  if (VALUES) {
    [[unroll]] for (uint i = 0; i < C4; ++i)
      [[unroll]] for (uint j = 0; j < 4; ++j)
        if (4 * i + j < COLUMNS) d_values[row * V + SKIP + 4 * i + j] = d_value[i][j];
    for (uint j = 0; j < SKIP; ++j) d_values[row * V + j] = 0.0;
    for (uint j = SKIP + COLUMNS; j < V; ++j) d_values[row * V + j] = 0.0;
  }
}
