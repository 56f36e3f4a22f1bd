// neighbour_attention.comp: softmax attention of every query over its neighbours, eight invocations per query and head;
// see src/ops/neighbour_attention.hpp.
// in  0 queries f32[Q,HEADS,D4] D = KEY_WIDTH numbers, padded to D4, a multiple of 4
// in  1 keys    f32[P,HEADS,D4]
// in  2 values  f32[P,HEADS,V4] V = VALUE_WIDTH numbers, padded to V4
// in  3 index   u32[Q,K]
// out 4 result  f32[Q,HEADS,V4]
// spec 0 WORKGROUP=64  1 K≤64  2 HEADS  3 KEY_WIDTH≤1024  4 VALUE_WIDTH≤1024 |
// grid ceil(Q / 8), HEADS | shared 4.25 KiB
// loops ≤ D4/4 + V4/32 · K ≤ 2304 | error: see src/ops/neighbour_attention.hpp | fp32
#version 450
#extension GL_EXT_control_flow_attributes : require
#extension GL_GOOGLE_include_directive : require
#include "common/parameters.glsl"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const uint K = 24;
layout(constant_id = 2) const uint HEADS = 1;
layout(constant_id = 3) const uint KEY_WIDTH = 4;
layout(constant_id = 4) const uint VALUE_WIDTH = 4;

const uint LANES = 8;    // for a query
const uint QUERIES = 8;  // in a work group
const uint EDGES = (K + LANES - 1) / LANES;
// A row's vec4s, and the numbers in the last of them.
const uint D4 = (KEY_WIDTH + 3) / 4, D_REST = KEY_WIDTH - 4 * (D4 - 1);
const uint V4 = (VALUE_WIDTH + 3) / 4, V_REST = VALUE_WIDTH - 4 * (V4 - 1);

layout(set = 0, binding = 0) readonly buffer Queries { vec4 queries[]; };
layout(set = 0, binding = 1) readonly buffer Keys { vec4 keys[]; };
layout(set = 0, binding = 2) readonly buffer Values { vec4 values[]; };
layout(set = 0, binding = 3) readonly buffer Index { uint index[]; };
layout(set = 0, binding = 4) writeonly buffer Result { vec4 result[]; };
layout(push_constant) uniform Push { NeighbourAttentionParameters p; };

shared uint neighbours[QUERIES * 64];
shared float weights[QUERIES * 64];
shared float largest[QUERIES * LANES];

void main() {
  const uint query = gl_LocalInvocationID.x / LANES, lane = gl_LocalInvocationID.x % LANES;
  const uint head = gl_WorkGroupID.y;
  const uint row = gl_WorkGroupID.x * QUERIES + query, safe_row = min(row, p.rows - 1);
  const uint first_edge = query * K;

  // Every eighth edge is this invocation's; beyond the last one it looks at the last one and writes nothing.
  const uint q = (safe_row * HEADS + head) * D4;
  uint k[EDGES];
  vec4 products[EDGES];
  [[unroll]] for (uint e = 0; e < EDGES; ++e) {
    const uint j = e * LANES + lane;
    const uint neighbour = index[safe_row * K + min(j, K - 1)];
    if (j < K) neighbours[first_edge + j] = neighbour;
    k[e] = (neighbour * HEADS + head) * D4;
    products[e] = vec4(0);
  }
  for (uint i = 0; i + 1 < D4; ++i) {
    const vec4 part = queries[q + i];
    [[unroll]] for (uint e = 0; e < EDGES; ++e) products[e] += part * keys[k[e] + i];
  }
  // What pads a row may be anything, even not a number.
  const vec4 a = queries[q + D4 - 1];
  float greatest = uintBitsToFloat(0xff800000u);
  float logit[EDGES];
  [[unroll]] for (uint e = 0; e < EDGES; ++e) {
    const vec4 b = keys[k[e] + D4 - 1];
    products[e].x += a.x * b.x;
    if (D_REST > 1) products[e].y += a.y * b.y;
    if (D_REST > 2) products[e].z += a.z * b.z;
    if (D_REST > 3) products[e].w += a.w * b.w;
    logit[e] = p.scale * ((products[e].x + products[e].y) + (products[e].z + products[e].w));
    greatest = max(greatest, logit[e]);
  }
  largest[gl_LocalInvocationID.x] = greatest;
  barrier();

  [[unroll]] for (uint i = 0; i < LANES; ++i) greatest = max(greatest, largest[query * LANES + i]);
  [[unroll]] for (uint e = 0; e < EDGES; ++e) {
    const uint j = e * LANES + lane;
    if (j < K) weights[first_edge + j] = exp(logit[e] - greatest);
  }
  barrier();

  for (uint column = lane; column < V4; column += LANES) {
    vec4 sum = vec4(0);
    float total = 0.0;
    for (uint j = 0; j < K; ++j) {
      const float weight = weights[first_edge + j];
      sum += weight * values[(neighbours[first_edge + j] * HEADS + head) * V4 + column];
      total += weight;
    }
    if (column + 1 == V4) {
      if (V_REST < 2) sum.y = 0.0;
      if (V_REST < 3) sum.z = 0.0;
      if (V_REST < 4) sum.w = 0.0;
    }
    if (row < p.rows) result[(row * HEADS + head) * V4 + column] = sum / total;
  }
}
