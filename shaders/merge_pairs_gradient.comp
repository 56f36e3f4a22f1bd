// merge_pairs_gradient.comp: with respect to the key points' positions and features, an invocation per number; see
// src/ops/merge_pairs.hpp.
// in  0 features    f32[2B·K,W4]  W = CHANNELS · (1 + 3), padded to a multiple of 4; sources' key points, then
//                                 references'
// in  1 d_node      f32[B·K,8]    xyz of both, if GIVEN_POSITIONS; else zero
// in  2 d_merged    f32[B·K,16·CHANNELS] if GIVEN_FEATURES; else zero
// out 3 d_positions f32[2B·K,4]   if POSITIONS
// out 4 d_features  f32[2B·K,W4]  if FEATURES
// spec 0 WORKGROUP=32  1 CHANNELS  2 GIVEN_POSITIONS  3 GIVEN_FEATURES  4 POSITIONS  5 FEATURES
// grid ceil(2B·K·(W + 4) / WORKGROUP), in parts | shared 0 KiB
// loops ≤ 3 < 65535 | error: see src/ops/gradient.hpp | fp32
#version 450
#extension GL_GOOGLE_include_directive : require
#include "common/parameters.glsl"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const uint CHANNELS = 4;
layout(constant_id = 2) const bool GIVEN_POSITIONS = true;
layout(constant_id = 3) const bool GIVEN_FEATURES = true;
layout(constant_id = 4) const bool POSITIONS = true;
layout(constant_id = 5) const bool FEATURES = true;

const uint FEATURE_STRIDE = 4 * CHANNELS;
const uint WIDTH = 16 * CHANNELS;

layout(set = 0, binding = 0) readonly buffer Features { float features[]; };
layout(set = 0, binding = 1) readonly buffer NodeGradient { float d_node[]; };
layout(set = 0, binding = 2) readonly buffer MergedGradient { float d_merged[]; };
layout(set = 0, binding = 3) writeonly buffer PositionGradient { float d_positions[]; };
layout(set = 0, binding = 4) writeonly buffer FeatureGradient { float d_features[]; };
layout(push_constant) uniform Push { MergeParameters p; };

float feature_gradient(uint node, bool source, uint column) {
  const uint from = node * WIDTH;
  if (column < CHANNELS) return d_merged[from + column];
  const uint channel = (column - CHANNELS) / 3, i = (column - CHANNELS) % 3;
  const uint outer = from + 7 * CHANNELS + 9 * channel;
  const uint other = (source ? node + p.nodes : node) * FEATURE_STRIDE + CHANNELS + 3 * channel;
  float sum = d_merged[from + (source ? 4 : 1) * CHANNELS + 3 * channel + i];
  for (uint j = 0; j < 3; ++j) sum += d_merged[outer + (source ? 3 * i + j : 3 * j + i)] * features[other + j];
  return sum;
}

void main() {
  const uint item = p.first_item + gl_GlobalInvocationID.x;
  const uint row = item / (FEATURE_STRIDE + 4), column = item % (FEATURE_STRIDE + 4);
  if (row >= 2 * p.nodes) return;
  const bool source = row < p.nodes;
  const uint node = source ? row : row - p.nodes;
  if (column < FEATURE_STRIDE) {
    if (FEATURES) d_features[row * FEATURE_STRIDE + column] = GIVEN_FEATURES ? feature_gradient(node, source, column) : 0.0;
  } else if (POSITIONS) {
    const uint i = column - FEATURE_STRIDE;
    d_positions[row * 4 + i] = GIVEN_POSITIONS && i < 3 ? d_node[node * 8 + (source ? i : i + 3)] : 0.0;
  }
}
