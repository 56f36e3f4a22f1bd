// mean_direction.comp: the first attention layer on a constant feature, an invocation per point; see
// src/ops/mean_direction.hpp. Logits are one number per head for edges of positive length and one for those of
// length zero, so a point needs no more than the sum of its directions and the number of its duplicates.
// in  0 positions f32[P,4]  xyz
// in  1 index     u32[P,K]
// in  2 tiles     u32[tiles,4]
// out 3 result    f32[P,R]  OUT0 scalars, OUT1 vectors (y,z,x); padded to R
// con 4 weights   f32[WEIGHTS,4] base[OUT0]; plane[OUT1,OUT1]; per head: logit, logit at zero, scalars[OUT0],
//                           scalars at zero[OUT0], slopes[OUT1]
// spec 0 WORKGROUP=32  1 K≤64  2 OUT0  3 OUT1  4 HEADS  5 RELU  6 WEIGHTS  7 RELU_SQUARE | grid tiles | shared 0 KiB
// loops ≤ K ≤ 64 < 65535 | error: see src/ops/mean_direction.hpp | fp32
#version 450
#extension GL_EXT_control_flow_attributes : require
#extension GL_GOOGLE_include_directive : require
#include "common/edge.glsl"
#include "common/parameters.glsl"
#include "common/projected_relu.glsl"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const int K = 24;
layout(constant_id = 2) const int OUT0 = 4;
layout(constant_id = 3) const int OUT1 = 4;
layout(constant_id = 4) const int HEADS = 2;
layout(constant_id = 5) const bool RELU = true;
layout(constant_id = 6) const int WEIGHTS = 64;  // vec4s
layout(constant_id = 7) const bool RELU_SQUARE = false;

const int PLANE = OUT0;
const int HEAD = PLANE + (RELU ? OUT1 * OUT1 : 0);
const int HEAD_SIZE = 2 + 2 * OUT0 + OUT1;
const int R4 = (OUT0 + 3 * OUT1 + 3) / 4;

layout(set = 0, binding = 0) readonly buffer Positions { vec4 positions[]; };
layout(set = 0, binding = 1) readonly buffer Index { uint index[]; };
layout(set = 0, binding = 2) readonly buffer Tiles { uvec4 tiles[]; };
layout(set = 0, binding = 3) writeonly buffer Result { vec4 result[]; };
layout(set = 0, binding = 4) uniform Weights { vec4 weights[WEIGHTS]; };
layout(push_constant) uniform Push { PointParameters p; };

float weight(int i) { return weights[i / 4][i % 4]; }

void main() {
  const uvec4 tile = tiles[p.first_tile + gl_WorkGroupID.x];
  const uint row = min(tile.y + gl_LocalInvocationID.x, tile.z - 1);
  const vec3 centre = positions[row].xyz;
  const uint first_edge = (row - p.first_row) * K;

  vec3 sum = vec3(0);
  float zeros = 0.0;
  for (int j = 0; j < K; ++j) {
    const Edge edge = edge_between(centre, positions[index[first_edge + j]].xyz);
    sum += edge.direction;
    zeros += edge.zero ? 1.0 : 0.0;
  }

  float scalars[OUT0];
  vec3 vectors[OUT1 > 0 ? OUT1 : 1];
  [[unroll]] for (int o = 0; o < OUT0; ++o) scalars[o] = weight(o);
  [[unroll]] for (int o = 0; o < OUT1; ++o) vectors[o] = vec3(0);
  [[unroll]] for (int h = 0; h < HEADS; ++h) {
    const int at = HEAD + h * HEAD_SIZE;
    const float above = zeros > 0.0 ? weight(at + 1) - weight(at) : 0.0;
    const float less = exp(-abs(above));
    const float edge_weight = above > 0.0 ? less : 1.0, zero_weight = above > 0.0 ? 1.0 : less;
    const float share = 1.0 / ((float(K) - zeros) * edge_weight + zeros * zero_weight);
    const float edges = (float(K) - zeros) * edge_weight * share, zero_edges = zeros * zero_weight * share;
    [[unroll]] for (int o = 0; o < OUT0; ++o)
      scalars[o] += weight(at + 2 + o) * edges + weight(at + 2 + OUT0 + o) * zero_edges;
    [[unroll]] for (int o = 0; o < OUT1; ++o)
      vectors[o] += weight(at + 2 + 2 * OUT0 + o) * edge_weight * share * sum;
  }

  float row_out[4 * R4];
  [[unroll]] for (int o = 0; o < OUT0; ++o) row_out[o] = RELU ? leaky(scalars[o]) : scalars[o];
  [[unroll]] for (int o = 0; o < OUT1; ++o) {
    vec3 x = vectors[o];
    if (RELU) {
      vec3 mixed = vec3(0);
      [[unroll]] for (int c = 0; c < OUT1; ++c) mixed += weight(PLANE + o * OUT1 + c) * vectors[c];
      x = projected_relu(x, mixed, RELU_SQUARE);
    }
    row_out[OUT0 + 3 * o] = x.x, row_out[OUT0 + 3 * o + 1] = x.y, row_out[OUT0 + 3 * o + 2] = x.z;
  }
  [[unroll]] for (int i = OUT0 + 3 * OUT1; i < 4 * R4; ++i) row_out[i] = 0.0;
  if (tile.y + gl_LocalInvocationID.x < tile.z) {
    [[unroll]] for (int i = 0; i < R4; ++i)
      result[row * R4 + i] = vec4(row_out[4 * i], row_out[4 * i + 1], row_out[4 * i + 2], row_out[4 * i + 3]);
  }
}
